"""Piper: two AgileX Piper arms, six joints each.

Joint origins, axes, limits, bases, home, fingers, wrist camera and end-effector frame are those
that the official simulator loads; the distance is the one of the official examples.
"""

import math

from robospa.geometry import Pose, Vec3, look_rotation, yaw_rotation
from robospa.harness.robots import links
from robospa.harness.robots.embodiment import Arm
from robospa.harness.robots.links import DARK, STEEL
from robospa.tasks.shapes import Box, Color, Shape
from robospa.workcell import Gripper

WHITE: Color = (0.78, 0.79, 0.80)

UPPER_END = (0.28358, 0.028726, 0.0)
FORE_END = (-0.24221, 0.068514, 0.0)
ALONG_UPPER = ((0.20, 0.02026, 0.0), (0.212, 0.02148, 0.0))
ALONG_FORE = ((-0.160, 0.04526, 0.0), (-0.178, 0.05035, 0.0))
"""Where bands lie around the upper arm and the forearm."""
FORE_HEADING = 2.8659
"""Direction [rad] of the forearm in the x-y plane of its link."""


def _joint(start: Vec3, end: Vec3, radius: float) -> tuple[Shape, ...]:
    return links.capped(start, end, radius, DARK, WHITE, STEEL)


LINK_SHAPES: tuple[tuple[Shape, ...], ...] = (
    (
        links.box((-0.009, 0.0, 0.008), (0.058, 0.05, 0.008), DARK),
        links.shell((-0.009, 0.0, 0.0), (-0.009, 0.0, 0.082), 0.043, WHITE, 0.4),
        links.box((-0.050, 0.0, 0.035), (0.012, 0.028, 0.024), WHITE),
        links.rod((0.0, 0.0, 0.080), (0.0, 0.0, 0.088), 0.037, DARK),
        links.box((-0.009, 0.0, -0.375), (0.05, 0.06, 0.375), STEEL),
    ),
    (
        links.shell((0.0, 0.0, -0.036), (0.0, 0.0, 0.030), 0.036, WHITE, 0.6),
        *_joint((0.0, -0.040, 0.0), (0.0, 0.040, 0.0), 0.030),
    ),
    (
        *_joint((0.0, 0.0, -0.045), (0.0, 0.0, 0.045), 0.035),
        links.shell((0.0, 0.0, 0.0), UPPER_END, 0.030, WHITE),
        links.rod(ALONG_UPPER[0], ALONG_UPPER[1], 0.0312, STEEL),
    ),
    (
        *_joint((0.0, 0.0, -0.040), (0.0, 0.0, 0.040), 0.032),
        links.shell((0.0, 0.0, 0.0), FORE_END, 0.028, WHITE),
        links.rod(ALONG_FORE[0], ALONG_FORE[1], 0.0290, DARK),
        links.block((-0.12, 0.034, 0.0), (0.12, 0.028, 0.03), yaw_rotation(FORE_HEADING)),
    ),
    _joint((0.0, 0.0, -0.036), (0.0, 0.0, 0.0285), 0.031),
    (
        links.shell((0.0, -0.02, 0.0), (0.0, 0.078, 0.0), 0.029, WHITE),
        links.rod((0.0, 0.076, 0.0), (0.0, 0.091, 0.0), 0.030, DARK),
        links.block((0.0, 0.035, 0.0), (0.028, 0.052, 0.028)),
    ),
    (
        links.rod((0.0, 0.0, 0.0), (0.0, 0.0, 0.02), 0.03, DARK),
        links.box((0.0, 0.0, 0.040), (0.026, 0.072, 0.022), WHITE),
        links.box((0.0, 0.0, 0.062), (0.018, 0.068, 0.004), DARK),
        links.box((0.0, 0.0, 0.034), (0.0275, 0.030, 0.012), STEEL),
        # housing of the wrist camera, behind its optical centre
        links.box((-0.05, 0.02, 0.028), (0.012, 0.042, 0.01), DARK, 0.46),
        links.block((0.0, 0.0, 0.0335), (0.03, 0.0725, 0.0335)),
    ),
)
"""Base link and links 1 to 6."""


def _finger(side: float) -> tuple[Shape, ...]:
    """A finger in a frame whose x approaches; its inner face is at y = 0, it lies to `side` y."""
    return (
        Shape(Box((0.0383, 0.006, 0.011)), Pose((-0.0333, side * 0.006, 0.0)), visual=False),
        links.drawn(Shape(Box((0.0383, 0.006, 0.011)), Pose((-0.0333, side * 0.006, 0.0)), DARK)),
        links.drawn(Shape(Box((0.012, 0.012, 0.02)), Pose((-0.058, side * 0.0125, 0.0)), STEEL)),
    )


FINGER_SHAPES: tuple[tuple[Shape, ...], tuple[Shape, ...]] = (_finger(-1.0), _finger(1.0))


DISTANCE = 0.6
Z = (0.0, 0.0, 1.0)

CHAIN: tuple[links.Row, ...] = (
    ("joint1", (0.0, 0.0, 0.123), (0.0, 0.0, -1.5708), Z, (-2.618, 2.618)),
    ("joint2", (0.0, 0.0, 0.0), (1.5708, 0.0, -1.5708), Z, (0.0, 3.14)),
    ("joint3", (0.28358, 0.028726, 0.0), (0.0, 0.0, 0.10095), Z, (-2.697, 2.697)),
    ("joint4", (-0.24221, 0.068514, 0.0), (-1.5708, 0.0, 1.3826), Z, (-1.832, 1.832)),
    ("joint5", (0.0, 0.0, 0.0), (1.5708, 0.0, 0.0), Z, (-1.22, 1.22)),
    ("joint6", (0.0, 0.091, 0.0014165), (-1.5708, -3.1415926, 0.0), Z, (-3.14, 3.14)),
)
FINGERS = (("joint7", (0.0, 0.0, 0.13503), -1.0), ("joint8", (0.0, 0.0, 0.13503), 1.0))
TOOL = Pose((0.0, 0.0, 0.0), look_rotation((0, 0, 1), (0, 1, 0)))

GRIPPER = Gripper(
    grasp_centre=0.12,
    opening=0.08,
    fingertip=0.02,
    hold=0.012,
    finger_half_width=0.011,
    finger_thickness=0.012,
    radius=0.05,
    palm_back=(0.078, 0.105, 0.135),
    palm_half=(0.0725, 0.035),
    hand_back=0.073,
    hand_half=(0.0725, 0.035),
    wrist_back=0.2,
    wrist_half=0.06,
)

SEEDS = (
    (0.0, 1.5, -1.2, 0.0, 0.3, 0.0),
    (0.0, 1.0, -1.0, 0.0, 1.0, 0.0),
    (0.0, 2.0, -1.6, 0.0, 0.6, 0.0),
    (0.0, 1.5, -1.2, 0.0, 0.3, 3.0),
    (0.0, 1.5, -1.2, 0.0, 0.3, -3.0),
)


def _arm(name: str, x: float) -> Arm:
    return links.serial_arm(
        CHAIN,
        FINGERS,
        (0.0, 0.04),
        (*LINK_SHAPES, *FINGER_SHAPES),
        TOOL,
        name=name,
        base=Pose((x, -0.45, 0.75), yaw_rotation(math.pi / 2)),
        travel=(-0.01, 0.04),
        gripper=GRIPPER,
        home=(0.0,) * 6,
        seeds=SEEDS,
        camera=Pose(
            (-0.055, 0.032, 0.038), look_rotation((0.44314, 0.0, 0.89645), (0.0, 1.0, 0.0))
        ),
    )


PIPER = links.two_arms("piper", DISTANCE, _arm)
