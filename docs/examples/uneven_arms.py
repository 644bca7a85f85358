"""uneven-arms: a made-up robot with six joints on the left and seven on the right, as boxes.

A worked example, not a robot of the benchmark; docs/adding-a-robot.md walks through it. Lengths are
metres, angles radians.
"""

from __future__ import annotations

import math

from robospa.geometry import Pose, Vec3, axis_rotation, yaw_rotation
from robospa.harness.robots.embodiment import Arm, Embodiment, Joint
from robospa.tasks.shapes import Box, Color, Shape
from robospa.workcell import WORKCELL, Gripper

GREY: Color = (0.3, 0.32, 0.35)
BLUE: Color = (0.05, 0.15, 0.4)

BASE_X, BASE_Y, BASE_Z = 0.32, -0.45, 0.76
TRAVEL = 0.042
"""How far a finger slides from the middle."""

Axis = tuple[Vec3, Vec3, float, float]

# joint: origin in the link before it, axis, lower and upper limit
SIX: tuple[Axis, ...] = (
    ((0.0, 0.0, 0.06), (0, 0, 1), -3.0, 3.0),
    ((0.0, 0.0, 0.06), (0, 1, 0), -1.5, 1.8),
    ((0.0, 0.0, 0.31), (0, 1, 0), -1.2, 2.7),
    ((0.30, 0.0, 0.0), (0, 1, 0), -2.1, 2.1),
    ((0.07, 0.0, 0.0), (0, 0, 1), -1.9, 1.9),
    ((0.05, 0.0, 0.0), (1, 0, 0), -3.1, 3.1),
)
UPPER_ARM = 2
"""Index of the joint at the upper arm's far end, the elbow; also that of the link before it."""
TWIST: tuple[Axis, Axis] = (
    ((0.0, 0.0, 0.155), (0, 0, 1), -2.0, 2.0),
    ((0.0, 0.0, 0.155), (0, 1, 0), -1.2, 2.7),
)
"""The upper arm of the right turns about itself half way: what stands in place of its elbow."""
SEVEN = (*SIX[:UPPER_ARM], *TWIST, *SIX[UPPER_ARM + 1 :])

HOME = (0.0, -1.2, 1.4, -0.2, 0.0, 0.0)
SEEDS = tuple(
    (0.0, shoulder, elbow, math.pi / 2 - shoulder - elbow, 0.0, roll)
    for shoulder, elbow in ((0.5, 0.7), (0.1, 1.2), (1.0, 0.2))
    for roll in (0.0, 1.5, -1.5)
)
"""Postures with the hand down, from which inverse kinematics starts."""

GRIPPER = Gripper(
    grasp_centre=0.10,
    opening=0.082,
    fingertip=0.015,
    hold=0.015,
    finger_half_width=0.010,
    finger_thickness=0.012,
    radius=0.055,
    palm_back=(0.085, 0.115, 0.145),
    palm_half=(0.055, 0.025),
    hand_back=0.085,
    hand_half=(0.055, 0.03),
    wrist_back=0.2,
    wrist_half=0.06,
)


def box(centre: Vec3, half: Vec3, color: Color = GREY, collision: bool = False) -> Shape:
    """A box in its link's frame."""
    return Shape(Box(half), Pose(centre), color, collision=collision)


SHAPES: tuple[tuple[Shape, ...], ...] = (
    (box((0.0, 0.0, 0.03), (0.06, 0.06, 0.03)),),
    (box((0.0, 0.0, 0.03), (0.045, 0.045, 0.03)),),
    (box((0.0, 0.0, 0.155), (0.03, 0.03, 0.155), BLUE),),
    (box((0.15, 0.0, 0.0), (0.15, 0.027, 0.027), BLUE),),
    (box((0.035, 0.0, 0.0), (0.035, 0.025, 0.025)),),
    (box((0.025, 0.0, 0.0), (0.025, 0.025, 0.025)),),
    (box((0.03, 0.0, 0.0), (0.03, 0.05, 0.02), collision=True),),
)
"""Base, links 1 to 5, and the palm."""
HALF = (box((0.0, 0.0, 0.0775), (0.03, 0.03, 0.0775), BLUE),)
"""Half of the upper arm."""


def untwisted(posture: tuple[float, ...]) -> tuple[float, ...]:
    """A posture of six joints as one of seven."""
    return (*posture[:UPPER_ARM], 0.0, *posture[UPPER_ARM:])


def arm(name: str, x: float, twists: bool) -> Arm:
    """One arm at `x`, facing the table, of six joints or, if its upper arm `twists`, of seven."""
    chain = SEVEN if twists else SIX
    made = (*SHAPES[:UPPER_ARM], HALF, HALF, *SHAPES[UPPER_ARM + 1 :]) if twists else SHAPES
    links = [f"{name}_base", *(f"{name}_link{i + 1}" for i in range(len(chain)))]
    fingers, shapes = [], dict(zip(links, made, strict=True))
    for side, which in ((1.0, "upper"), (-1.0, "lower")):
        link = f"{name}_{which}_finger"
        shapes[link] = (box((0.05, side * 0.006, 0.0), (0.035, 0.006, 0.01), collision=True),)
        origin, axis = Pose((0.06, 0.0, 0.0)), (0.0, side, 0.0)
        fingers.append(Joint(link, links[-1], link, origin, axis, 0.0, TRAVEL, "prismatic"))
    return Arm(
        name=name,
        base=Pose((x, BASE_Y, BASE_Z), yaw_rotation(math.pi / 2)),
        base_link=links[0],
        joints=tuple(
            Joint(f"{name}_joint{i + 1}", links[i], links[i + 1], Pose(at), axis, low, high)
            for i, (at, axis, low, high) in enumerate(chain)
        ),
        fingers=tuple(fingers),
        travel=(-0.01, TRAVEL),
        gripper=GRIPPER,
        tool=Pose((0.03, 0.0, 0.0)),
        home=untwisted(HOME) if twists else HOME,
        seeds=tuple(untwisted(seed) for seed in SEEDS) if twists else SEEDS,
        shapes=shapes,
        camera=Pose((0.0, 0.0, 0.08), axis_rotation((0, 1, 0), 0.5)),
    )


UNEVEN_ARMS = Embodiment(
    name="uneven-arms",
    arms=(arm("left", -BASE_X, twists=False), arm("right", BASE_X, twists=True)),
    distance=2 * BASE_X,
    cameras={"head": WORKCELL.head},
    body=(Shape(Box((0.4, 0.06, 0.38)), Pose((0.0, BASE_Y - 0.05, 0.38)), GREY, collision=False),),
)
