"""ARX-X5: two of the arms that Aloha-AgileX has, each with its own base at the table's edge.

Joint origins, axes, limits, bases, home, fingers, wrist camera and end-effector frame are those
that the official simulator loads; the distance is what its maintainers name for this robot.
"""

from __future__ import annotations

import math
from dataclasses import replace

from robospa.geometry import Pose, axis_rotation, yaw_rotation
from robospa.harness.robots import aloha_agilex as same_arm
from robospa.harness.robots import arx
from robospa.harness.robots.embodiment import Arm, Embodiment
from robospa.harness.robots.links import SINGLE_ARM_CAMERAS, Row, box, serial_chain
from robospa.tasks.shapes import Shape

LINK_SHAPES: tuple[tuple[Shape, ...], ...] = (
    (
        *same_arm.LINK_SHAPES[0],
        box((0.0, 0.0, -0.022), (0.05, 0.05, 0.022), same_arm.STEEL),
        box((-0.045, 0.0, -0.392), (0.04, 0.05, 0.392), same_arm.DARK),
    ),
    *same_arm.LINK_SHAPES[1:],
)
"""Base link and links 1 to 6."""
FINGER_SHAPES = same_arm.FINGER_SHAPES


DISTANCE = 0.6
OPEN = (-10.0, 10.0)

CHAIN: tuple[Row, ...] = (
    ("joint1", (0.0, 0.0, 0.0605), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), OPEN),
    ("joint2", (0.02, 0.0, 0.04), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), OPEN),
    ("joint3", (-0.264, 0.0, 0.0), (3.1416, 0.0, 0.0), (0.0, 1.0, 0.0), OPEN),
    ("joint4", (0.245, 0.0, -0.056), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), OPEN),
    ("joint5", (0.06775, 0.0005, -0.0865), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), OPEN),
    ("joint6", (0.02895, 0.0, 0.0865), (-3.1416, 0.0, 0.0), (1.0, 0.0, 0.0), (-3.14, 3.14)),
)
FINGERS = (
    ("joint7", (0.08657, 0.0249, -0.00024), 1.0),
    ("joint8", (0.08657, -0.0249, -0.00024), -1.0),
)
TOOL = Pose()

GRIPPER = replace(arx.GRIPPER, fingertip=0.0375)


def _arm(name: str, x: float) -> Arm:
    shapes = (*LINK_SHAPES, *FINGER_SHAPES)
    joints, fingers, named = serial_chain(CHAIN, TOOL.rotation, FINGERS, (0.0, 0.044), shapes)
    return Arm(
        name=name,
        base=Pose((x, -0.35, 0.784), yaw_rotation(math.pi / 2)),
        base_link=joints[0].parent,
        joints=joints,
        fingers=fingers,
        travel=(-0.01, 0.045),
        gripper=GRIPPER,
        tool=TOOL,
        home=(0.0,) * 6,
        seeds=arx.SEEDS,
        working=arx.WORKING,
        shapes=named,
        camera=Pose((0.0845, 0.0, 0.05), axis_rotation((0, 1, 0), 0.349)),
        geometry="arx",
    )


ARX_X5 = Embodiment(
    name="ARX-X5",
    arms=(_arm("left", -DISTANCE / 2), _arm("right", DISTANCE / 2)),
    cameras=SINGLE_ARM_CAMERAS,
    distance=DISTANCE,
)
