"""What the Aloha-AgileX arms are made of: few boxes and cylinders in the sizes of the real links.

Each entry is in its link's frame. Fingers carry the contacts that matter; the palm, the wrist and
the forearm collide too, so that a careless policy cannot move through the scene.
"""

from __future__ import annotations

import math

from robospa.tasks.geometry import Pose, Vec3, axis_rotation
from robospa.tasks.shapes import Box, Color, Cylinder, Shape

BLACK: Color = (0.035, 0.035, 0.04)
DARK: Color = (0.09, 0.09, 0.10)
GREY: Color = (0.32, 0.33, 0.35)
ALONG_Y = axis_rotation((1, 0, 0), math.pi / 2)
ALONG_X = axis_rotation((0, 1, 0), math.pi / 2)


def _box(centre: Vec3, half: Vec3, color: Color, pitch: float = 0.0, solid: bool = False) -> Shape:
    pose = Pose(centre, axis_rotation((0, 1, 0), pitch))
    return Shape(Box(half), pose, color, collision=solid)


def _pin(centre: Vec3, radius: float, half: float, color: Color) -> Shape:
    return Shape(Cylinder(radius, half), Pose(centre, ALONG_Y), color, collision=False)


LINK_SHAPES: tuple[tuple[Shape, ...], ...] = (
    (Shape(Cylinder(0.03, 0.031), Pose((0, 0, 0.031)), DARK, collision=False),),
    (
        _box((0.008, 0, 0.03), (0.026, 0.036, 0.028), GREY),
        _pin((0.02, 0, 0.0402), 0.028, 0.04, DARK),
    ),
    (
        _box((-0.132, 0, 0), (0.132, 0.027, 0.025), BLACK),
        _pin((0, 0, 0), 0.03, 0.034, GREY),
        _pin((-0.264, 0, 0), 0.03, 0.036, GREY),
    ),
    (
        _box((0.12, 0, -0.045), (0.125, 0.03, 0.026), BLACK, 0.18, solid=True),
        _pin((0.245, 0, -0.056), 0.028, 0.036, GREY),
    ),
    (_box((0.045, 0, -0.035), (0.042, 0.028, 0.026), DARK, 0.7, solid=True),),
    (Shape(Cylinder(0.03, 0.052), Pose((0, 0, 0.056)), BLACK, collision=False),),
    (
        _box((0.03, 0, 0), (0.03, 0.045, 0.026), DARK, solid=True),
        _box((0.052, 0, 0), (0.013, 0.087, 0.018), GREY),
    ),
)
"""Base link and links 1 to 6."""

# Inner faces meet at the gripper's middle plane when the travel is 0; the tips reach 12 mm beyond
# the grasp centre.
_FINGER_HALF: Vec3 = (0.0475, 0.004, 0.010)
FINGER_SHAPES: tuple[tuple[Shape, ...], tuple[Shape, ...]] = (
    (Shape(Box(_FINGER_HALF), Pose((0.0355, -0.020629, 0.0)), BLACK),),
    (Shape(Box(_FINGER_HALF), Pose((0.0355, 0.020629, 0.0)), BLACK),),
)

STAND_SHAPES: tuple[Shape, ...] = (
    _box((0.0035, -0.45, 0.755), (0.36, 0.05, 0.0225), GREY),
    _box((0.0035, -0.60, 0.37), (0.25, 0.20, 0.37), DARK),
)
