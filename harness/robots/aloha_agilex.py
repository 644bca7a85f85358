"""Aloha-AgileX, two ARX arms side by side, the default embodiment; ARX-X5, each on its own base.

Joint origins, axes, bases, fingers, wrist cameras and the end-effector frame are those of the robot
description that the official simulator loads. It leaves the joint limits open (+-10 rad), so a
policy may command any angle; `WORKING` are the limits of the same arm's own description, within
which our own inverse kinematics looks. Link shapes are ours: boxes and cylinders fitted to the
listed sizes.
"""

import math
from dataclasses import replace
from typing import Any

from robospa.geometry import Pose, Vec3, axis_rotation, yaw_rotation
from robospa.harness.robots import links
from robospa.harness.robots.embodiment import Arm, Embodiment
from robospa.harness.robots.links import Row
from robospa.tasks.shapes import Box, Color, Cylinder, Shape
from robospa.workcell import WORKCELL, Gripper

BLACK: Color = (0.028, 0.028, 0.032)
DARK: Color = (0.07, 0.07, 0.08)
STEEL: Color = (0.36, 0.37, 0.39)

WORKING = (
    (-math.pi, math.pi),
    (-0.05, 3.4),
    (-0.05, 3.4),
    (-math.pi / 2, math.pi / 2),
    (-1.67, 1.67),
    (-math.pi / 2 - 0.1, math.pi / 2 + 0.1),
)
"""Limits [rad] within which inverse kinematics of an ARX arm looks: those of the arm's own
description, a little widened; the one that the official simulator loads leaves them open."""
SEEDS = (
    (0.0, 1.6, 1.5, 0.0, 0.0, 0.0),
    (0.0, 2.2, 1.6, -0.9, 0.0, 0.0),
    (0.0, 1.2, 1.2, 1.2, 0.0, 0.0),
    (0.0, 2.2, 1.2, 0.3, 0.0, 0.0),
)
"""Postures from which a numerical solution starts."""

GRIPPER = Gripper(
    grasp_centre=0.12,  # official gripper_bias, ahead of link 6
    opening=0.088,
    fingertip=0.035,
    hold=0.012,
    finger_half_width=0.010,
    finger_thickness=0.008,
    radius=0.05,
    palm_back=(0.095, 0.125, 0.155),
    palm_half=(0.08, 0.026),
    hand_back=0.09,
    hand_half=(0.09, 0.03),
    wrist_back=0.22,
    wrist_half=0.09,
)
"""The arm's gripper, with the fingertips where Aloha-AgileX has them."""

WRIST_CAMERA = Pose((0.07, 0.032, 0.065), axis_rotation((0, 1, 0), 0.4))
"""In link 6, above and left of the palm and tilted to the fingers, as officially mounted."""


LINK_SHAPES: tuple[tuple[Shape, ...], ...] = (
    (
        links.drawn(Shape(Cylinder(0.038, 0.008), Pose((0, 0, 0.008)), STEEL)),
        links.drawn(Shape(Cylinder(0.03, 0.031), Pose((0, 0, 0.031)), DARK)),
    ),
    (
        links.box((0.01, 0, 0.012), (0.026, 0.03, 0.012), DARK),
        links.box((0.018, 0.034, 0.032), (0.02, 0.005, 0.025), STEEL),
        links.box((0.018, -0.034, 0.032), (0.02, 0.005, 0.025), STEEL),
        links.pin((0.025, 0, 0.042), 0.026, 0.0395, STEEL),
    ),
    (
        links.bar((0.0, 0.0), (-0.26396, 0.0), (0.031, 0.029), 0.026, BLACK),
        links.bar((-0.06, 0.0), (-0.205, 0.0), (0.012, 0.012), 0.0285, DARK),
        links.pin((-0.26396, 0, 0), 0.022, 0.037, STEEL),
    ),
    (
        links.bar((0.0, 0.0), (0.05, -0.045), (0.03, 0.034), 0.03, BLACK),
        links.bar((0.05, -0.045), (0.246, -0.06), (0.034, 0.027), 0.03, BLACK),
        links.bar((0.085, -0.0485), (0.19, -0.0565), (0.012, 0.011), 0.0325, DARK),
        links.pin((0.246, 0, -0.06), 0.02, 0.038, STEEL),
        links.block((0.12, 0, -0.045), (0.125, 0.03, 0.026), axis_rotation((0, 1, 0), 0.18)),
    ),
    (
        links.bar((0.0, 0.0), (0.06, -0.055), (0.0175, 0.03), 0.027, DARK),
        links.box((0.0677, 0.0015, -0.082), (0.024, 0.024, 0.005), STEEL),
        links.block((0.045, 0, -0.035), (0.042, 0.028, 0.026), axis_rotation((0, 1, 0), 0.7)),
    ),
    (
        links.drawn(Shape(Cylinder(0.0295, 0.0515), Pose((0, 0, 0.0565)), BLACK)),
        links.drawn(Shape(Cylinder(0.024, 0.004), Pose((0.027, 0, 0.0855), links.ALONG_X), STEEL)),
    ),
    (
        links.drawn(Shape(Cylinder(0.027, 0.012), Pose((0.01, 0, 0), links.ALONG_X), STEEL)),
        links.box((0.035, 0, 0), (0.021, 0.045, 0.026), BLACK),
        links.box((0.052, 0, 0), (0.013, 0.087, 0.017), DARK),
        links.box((0.0655, 0, 0.0), (0.0015, 0.08, 0.006), STEEL),
        # bracket and housing of the wrist camera, behind its optical centre
        links.box((0.045, 0.02, 0.042), (0.003, 0.012, 0.018), STEEL),
        links.box((0.056, 0.02, 0.0645), (0.006, 0.042, 0.011), DARK, 0.4),
        links.block((0.03, 0, 0), (0.03, 0.045, 0.026)),
    ),
)
"""Base link and links 1 to 6."""

# Inner faces meet at the gripper's middle plane when the travel is 0; the official finger is 86 mm
# long, from 15 mm behind its joint's origin to 71 mm ahead of it.
_FINGER_HALF: Vec3 = (0.043, 0.004, 0.010)
_MIDDLE = 0.028


def _finger(side: float) -> tuple[Shape, ...]:
    inner = -side * 0.0205
    return (
        Shape(Box(_FINGER_HALF), Pose((_MIDDLE, inner, 0.0)), BLACK, visual=False),
        links.box((_MIDDLE, inner + side * 0.0008, 0.0), (0.043, 0.0032, 0.010), DARK),
        links.box((0.05, inner - side * 0.0031, 0.0), (0.0208, 0.0009, 0.0095), STEEL),
        links.box((-0.012, inner + side * 0.008, 0.0), (0.011, 0.008, 0.0125), BLACK),
    )


FINGER_SHAPES: tuple[tuple[Shape, ...], tuple[Shape, ...]] = (_finger(1.0), _finger(-1.0))

STAND_SHAPES: tuple[Shape, ...] = (
    links.box((0.0035, -0.45, 0.755), (0.36, 0.05, 0.0225), STEEL),
    links.box((0.0035, -0.60, 0.37), (0.25, 0.20, 0.37), DARK),
)


OPEN = (-10.0, 10.0)
"""Joint limits [rad] of the official description: none."""
SKEW = 0.015928
"""Turn [rad] of the forearm about the upright axis in the official description; the wrist takes it
back."""

CHAIN: tuple[Row, ...] = (
    ("joint1", (0.0, 0.0, 0.058), (0.0, 0.0, 0.0), (0, 0, 1), OPEN),
    ("joint2", (0.025013, 0.00060169, 0.042), (0.0, 0.0, 0.0), (0, 1, 0), OPEN),
    ("joint3", (-0.26396, 0.0044548, 0.0), (-3.1416, 0.0, -SKEW), (0, 1, 0), OPEN),
    ("joint4", (0.246, -0.00025, -0.06), (0.0, 0.0, 0.0), (0, 1, 0), OPEN),
    ("joint5", (0.06775, 0.0015, -0.0855), (0.0, 0.0, -SKEW), (0, 0, 1), OPEN),
    ("joint6", (0.03095, 0.0, 0.0855), (-3.1416, 0.0, 0.0), (1, 0, 0), OPEN),
)
FINGERS = (
    ("joint7", (0.08457, 0.02449, -0.0001), 1.0),
    ("joint8", (0.08457, -0.0245, -0.0001), -1.0),
)

ROOT = Pose((0.0, -0.65, 0.0), yaw_rotation(math.pi / 2))
"""Where the robot stands in the world."""


COMMON: dict[str, Any] = {
    "travel": (-0.01, 0.045), "home": (0.0,) * 6, "seeds": SEEDS, "working": WORKING,
    "geometry": "arx",
}  # fmt: skip
"""What both robots' arms have in common besides their shapes."""


def _arm(name: str, prefix: str, base: Vec3, yaw: float) -> Arm:
    """An arm whose base stands at `base` [m] of the robot's frame, turned by `yaw` [rad]."""
    return links.serial_arm(
        [(prefix + row[0], *row[1:]) for row in CHAIN],
        [(prefix + row[0], *row[1:]) for row in FINGERS],
        (0.0, 0.04765),
        (*LINK_SHAPES, *FINGER_SHAPES),
        names=[f"{prefix}base_link", *(f"{prefix}link{i}" for i in range(1, 9))],
        name=name,
        base=ROOT * Pose(base, yaw_rotation(yaw)),
        gripper=GRIPPER,
        camera=WRIST_CAMERA,
        **COMMON,
    )


ALOHA_AGILEX = Embodiment(
    name="aloha-agilex",
    arms=(
        _arm("left", "fl_", (0.2305, 0.297, 0.782), 0.02),
        _arm("right", "fr_", (0.2315, -0.3063, 0.781), 0.01),
    ),
    cameras={"head": WORKCELL.head, "front": links.FRONT, "third": links.THIRD},
    body=STAND_SHAPES,
)


X5_LINK_SHAPES: tuple[tuple[Shape, ...], ...] = (
    (
        *LINK_SHAPES[0],
        links.box((0.0, 0.0, -0.022), (0.05, 0.05, 0.022), STEEL),
        links.box((-0.045, 0.0, -0.392), (0.04, 0.05, 0.392), DARK),
    ),
    *LINK_SHAPES[1:],
)
X5_DISTANCE = 0.6
"""Between the bases of ARX-X5, as its official maintainers name it [m]."""

X5_CHAIN: tuple[Row, ...] = (
    ("joint1", (0.0, 0.0, 0.0605), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), OPEN),
    ("joint2", (0.02, 0.0, 0.04), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), OPEN),
    ("joint3", (-0.264, 0.0, 0.0), (3.1416, 0.0, 0.0), (0.0, 1.0, 0.0), OPEN),
    ("joint4", (0.245, 0.0, -0.056), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), OPEN),
    ("joint5", (0.06775, 0.0005, -0.0865), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), OPEN),
    ("joint6", (0.02895, 0.0, 0.0865), (-3.1416, 0.0, 0.0), (1.0, 0.0, 0.0), (-3.14, 3.14)),
)
X5_FINGERS = (
    ("joint7", (0.08657, 0.0249, -0.00024), 1.0),
    ("joint8", (0.08657, -0.0249, -0.00024), -1.0),
)


def _x5_arm(name: str, x: float) -> Arm:
    return links.serial_arm(
        X5_CHAIN,
        X5_FINGERS,
        (0.0, 0.044),
        (*X5_LINK_SHAPES, *FINGER_SHAPES),
        name=name,
        base=Pose((x, -0.35, 0.784), yaw_rotation(math.pi / 2)),
        gripper=replace(GRIPPER, fingertip=0.0375),
        camera=Pose((0.0845, 0.0, 0.05), axis_rotation((0, 1, 0), 0.349)),
        **COMMON,
    )


ARX_X5 = links.two_arms("ARX-X5", X5_DISTANCE, _x5_arm)
