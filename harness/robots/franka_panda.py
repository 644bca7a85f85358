"""Franka Panda: two arms of seven joints with the vendor's hand.

Joint origins, axes, limits, bases, home, fingers, wrist camera and end-effector frame are those
that the official simulator loads; the distance is the one of its documentation.
"""

import math

from robospa.geometry import Pose, Vec3, look_rotation, yaw_rotation
from robospa.harness.robots import links
from robospa.harness.robots.embodiment import Arm
from robospa.harness.robots.links import DARK, STEEL
from robospa.tasks.objects.meshes import loft, rounded_rectangle
from robospa.tasks.shapes import Box, Color, Shape
from robospa.workcell import Gripper

WHITE: Color = (0.80, 0.81, 0.82)
CAP: Color = (0.52, 0.54, 0.56)

HAND = look_rotation((0, 0, 1), (-1, -1, 0))
"""Rotation of the hand in link 7: x approaches, y is the closing direction."""


def _housing(start: Vec3, end: Vec3, radius: float) -> tuple[Shape, ...]:
    return links.capped(start, end, radius, WHITE, CAP, DARK)


def _seam(x: float, y: float, z: float, radius: float) -> Shape:
    return links.rod((x, y, z), (x, y, z + 0.014), radius, DARK)


def _hand_body() -> Shape:
    """The hand's white body: as wide as a forearm is thick, narrower where it meets the flange."""
    sides = ((-0.033, 0.060, 0.028), (-0.012, 0.100, 0.0315), (0.033, 0.102, 0.0315))
    outlines = [(x, rounded_rectangle(wide, deep, 0.022)) for x, wide, deep in sides]
    rings = [[(y, z, x) for y, z in outline] for x, outline in outlines]
    upright = Pose((0.0, 0.0, 0.14), HAND) * Pose(rotation=TO_APPROACH)
    return links.drawn(Shape(loft(rings), upright, WHITE))


TO_APPROACH = look_rotation((0, 1, 0), (0, 0, 1))
"""Brings x, y, z to y, z, x."""

LINK_SHAPES: tuple[tuple[Shape, ...], ...] = (
    (
        links.shell((-0.10, 0.0, 0.03), (0.07, 0.0, 0.03), 0.075, WHITE, 0.8),
        links.box((-0.05, 0.0, 0.02), (0.10, 0.085, 0.02), WHITE),
        links.shell((0.0, 0.0, 0.0), (0.0, 0.0, 0.14), 0.068, WHITE),
        links.box((-0.04, 0.0, -0.375), (0.13, 0.12, 0.375), STEEL),
    ),
    (
        _seam(0.0, 0.0, -0.197, 0.0585),
        links.shell((0.0, 0.0, -0.185), (0.0, 0.0, 0.02), 0.056, WHITE),
        *_housing((0.0, -0.129, 0.0), (0.0, 0.055, 0.0), 0.056),
    ),
    (
        links.shell((0.0, 0.0, -0.055), (0.0, 0.0, 0.1295), 0.054, WHITE),
        links.shell((0.0, 0.03, 0.0), (0.0, -0.18, 0.0), 0.055, WHITE),
        links.rod((0.0, -0.182, 0.0), (0.0, -0.196, 0.0), 0.057, DARK),
    ),
    (
        links.shell((0.0, 0.0, -0.121), (0.0, 0.0, 0.03), 0.0545, WHITE),
        links.shell((0.0, 0.025, 0.0), (0.0825, 0.025, 0.0), 0.05, WHITE),
        *_housing((0.0825, -0.055, 0.0), (0.0825, 0.111, 0.0), 0.056),
    ),
    (
        links.shell((0.0, 0.0, -0.055), (0.0, 0.0, 0.111), 0.054, WHITE),
        links.shell((0.0, 0.025, 0.0), (-0.0825, 0.025, 0.0), 0.05, WHITE),
        links.shell((-0.0825, -0.03, 0.0), (-0.0825, 0.112, 0.0), 0.0545, WHITE),
        links.rod((-0.0825, 0.112, 0.0), (-0.0825, 0.126, 0.0), 0.057, DARK),
    ),
    (
        links.shell((0.0, 0.0, -0.2646), (0.0, 0.0, -0.11), 0.054, WHITE),
        links.shell((0.0, 0.03, -0.20), (0.0, 0.075, 0.02), 0.042, WHITE, 1.0),
        *_housing((0.0, -0.05, 0.0), (0.0, 0.13, 0.0), 0.049),
        links.block((0.0, 0.03, -0.12), (0.05, 0.06, 0.14)),
    ),
    (
        links.shell((0.0, 0.0, -0.044), (0.0, 0.0, 0.056), 0.048, WHITE),
        links.shell((-0.02, 0.0, 0.0), (0.11, 0.0, 0.0), 0.042, WHITE, 0.9),
        *_housing((0.088, -0.05, 0.0), (0.088, 0.082, 0.0), 0.044),
        links.rod((0.088, -0.060, 0.0), (0.088, -0.047, 0.0), 0.0455, DARK),
        links.block((0.045, 0.015, 0.0), (0.085, 0.06, 0.045)),
    ),
    (
        links.shell((0.0, 0.0, 0.045), (0.0, 0.0, 0.092), 0.043, WHITE),
        links.rod((0.0, 0.0, 0.090), (0.0, 0.0, 0.109), 0.032, DARK),
        _hand_body(),
        links.drawn(Shape(Box((0.004, 0.09, 0.012)), Pose((0.0, 0.0, 0.171), HAND), DARK)),
        # housing of the wrist camera, behind its optical centre
        links.drawn(Shape(Box((0.012, 0.03, 0.012)), Pose((0.011, -0.039, 0.112), HAND), DARK)),
        links.block((0.0, 0.0, 0.14), (0.033, 0.102, 0.0315), HAND),
    ),
)
"""Base link and links 1 to 7."""


def _finger(side: float) -> tuple[Shape, ...]:
    """A finger in a frame whose x approaches; its inner face is at y = 0, it lies to `side` y."""
    pose = Pose((0.027, side * 0.0075, 0.0))
    return (
        Shape(Box((0.027, 0.0075, 0.0105)), pose, visual=False),
        links.drawn(Shape(Box((0.018, 0.011, 0.009)), Pose((0.013, side * 0.013, 0.0)), STEEL)),
        links.drawn(Shape(Box((0.014, 0.006, 0.0105)), Pose((0.040, side * 0.0065, 0.0)), DARK)),
    )


FINGER_SHAPES: tuple[tuple[Shape, ...], tuple[Shape, ...]] = (_finger(-1.0), _finger(1.0))


DISTANCE = 0.8
QUARTER = math.pi / 2
Z = (0.0, 0.0, 1.0)

CHAIN: tuple[links.Row, ...] = (
    ("panda_joint1", (0.0, 0.0, 0.333), (0.0, 0.0, 0.0), Z, (-2.8973, 2.8973)),
    ("panda_joint2", (0.0, 0.0, 0.0), (-QUARTER, 0.0, 0.0), Z, (-1.7628, 1.7628)),
    ("panda_joint3", (0.0, -0.316, 0.0), (QUARTER, 0.0, 0.0), Z, (-2.8973, 2.8973)),
    ("panda_joint4", (0.0825, 0.0, 0.0), (QUARTER, 0.0, 0.0), Z, (-3.0718, -0.0698)),
    ("panda_joint5", (-0.0825, 0.384, 0.0), (-QUARTER, 0.0, 0.0), Z, (-2.8973, 2.8973)),
    ("panda_joint6", (0.0, 0.0, 0.0), (QUARTER, 0.0, 0.0), Z, (-0.0175, 3.7525)),
    ("panda_joint7", (0.088, 0.0, 0.0), (QUARTER, 0.0, 0.0), Z, (-2.8973, 2.8973)),
)
FINGERS = (
    ("panda_finger_joint1", (0.0, 0.0, 0.1654), -1.0),
    ("panda_finger_joint2", (0.0, 0.0, 0.1654), 1.0),
)
TOOL = Pose((0.0, 0.0, 0.067), look_rotation((0, 0, 1), (-1, -1, 0)))

GRIPPER = Gripper(
    grasp_centre=0.12,
    opening=0.08,
    fingertip=0.0324,
    hold=0.012,
    finger_half_width=0.0105,
    finger_thickness=0.015,
    radius=0.05,
    palm_back=(0.05, 0.08, 0.11),
    palm_half=(0.102, 0.032),
    hand_back=0.046,
    hand_half=(0.102, 0.032),
    wrist_back=0.2,
    wrist_half=0.09,
)

SEEDS = (
    (0.0, 0.2, 0.0, -2.3, 0.0, 2.6, 0.785),
    (0.0, -0.3, 0.0, -2.5, 0.0, 2.2, 0.785),
    (0.0, 0.5, 0.0, -1.8, 0.0, 2.2, 0.785),
    (0.5, 0.2, -0.5, -2.2, 0.2, 2.5, 0.785),
    (-0.5, 0.2, 0.5, -2.2, -0.2, 2.5, 0.785),
    (0.0, 0.2, 0.0, -2.3, 0.0, 2.6, 2.3),
    (0.0, 0.2, 0.0, -2.3, 0.0, 2.6, -0.785),
)


def _arm(name: str, x: float) -> Arm:
    return links.serial_arm(
        CHAIN,
        FINGERS,
        (0.0, 0.04),
        (*LINK_SHAPES, *FINGER_SHAPES),
        TOOL,
        name=name,
        base=Pose((x, -0.65, 0.75), yaw_rotation(math.pi / 2)),
        travel=(-0.01, 0.05),
        gripper=GRIPPER,
        home=(0.0, 0.19635, 0.0, -2.61799, 0.0, 2.94159, 0.785398),
        seeds=SEEDS,
        camera=Pose((0.00707, -0.04243, 0.124), look_rotation((0, 0, 1), (-1, -1, 0))),
    )


FRANKA_PANDA = links.two_arms("franka-panda", DISTANCE, _arm)
