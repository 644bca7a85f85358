"""Of what robots are made: shapes of links, joints as descriptions write them, fixed cameras."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from robospa.geometry import Pose, Quat, Vec3, axis_rotation, look_rotation, multiply, yaw_rotation
from robospa.harness.robots.embodiment import Arm, Embodiment, Joint
from robospa.tasks.objects.meshes import lathe
from robospa.tasks.shapes import Box, Color, Cylinder, Mesh, Shape
from robospa.workcell import WORKCELL, FixedCamera

ALONG_Y = axis_rotation((1, 0, 0), math.pi / 2)
ALONG_X = axis_rotation((0, 1, 0), math.pi / 2)
"""Rotations that bring a cylinder's axis, z, along y and along x."""
HERE, LEVEL = Pose(), Pose().rotation
ARC = 7
"""Corners of a drawn half circle."""
ROUND, EDGE = 16, 2
"""Sides of a shell, and steps of its rounded edge."""
AXES: tuple[Vec3, Vec3, Vec3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def drawn(shape: Shape) -> Shape:
    """`shape`, drawn and without collision."""
    return replace(shape, collision=False, roughness=0.45)


def box(centre: Vec3, half: Vec3, color: Color, pitch: float = 0.0) -> Shape:
    """A drawn box, turned by `pitch` [rad] about y."""
    return drawn(Shape(Box(half), Pose(centre, axis_rotation((0, 1, 0), pitch)), color))


def pin(centre: Vec3, radius: float, half: float, color: Color) -> Shape:
    """A drawn cylinder along y."""
    return drawn(Shape(Cylinder(radius, half), Pose(centre, ALONG_Y), color))


def bar(
    start: tuple[float, float],
    end: tuple[float, float],
    radii: tuple[float, float],
    half: float,
    color: Color,
) -> Shape:
    """A bar with round ends from `start` to `end` (x, z), `half` thick to either side along y."""
    heading = math.atan2(end[1] - start[1], end[0] - start[0])
    outline: list[tuple[float, float]] = []
    for (x, z), radius, first in ((end, radii[1], -math.pi / 2), (start, radii[0], math.pi / 2)):
        for i in range(ARC):
            angle = heading + first + math.pi * i / (ARC - 1)
            outline.append((x + radius * math.cos(angle), z + radius * math.sin(angle)))
    count = len(outline)
    vertices = tuple((x, side * half, z) for side in (-1.0, 1.0) for x, z in outline)
    # x to z is clockwise seen from +y: the -y cap is listed in outline order
    caps = [(0, i, i + 1) for i in range(1, count - 1)]
    caps += [(count, count + i + 1, count + i) for i in range(1, count - 1)]
    sides = []
    for i in range(count):
        j = (i + 1) % count
        sides += [(i, count + i, count + j), (i, count + j, j)]
    return drawn(Shape(Mesh(vertices, (*caps, *sides)), color=color))


def rod(start: Vec3, end: Vec3, radius: float, color: Color) -> Shape:
    """A drawn cylinder from `start` to `end` [m]."""
    turn, half = _along(start, end)
    return drawn(Shape(Cylinder(radius, half), turn, color))


def shell(start: Vec3, end: Vec3, radius: float, color: Color, soft: float = 0.35) -> Shape:
    """A drawn cylinder from `start` to `end` [m] with rounded edges.

    `soft` is the rounding's radius as a share of `radius`; at 1 the ends are half spheres, which
    reach as far as the cylinder's ends.
    """
    turn, half = _along(start, end)
    edge = min(soft * radius, half)
    turns = [i * math.pi / 2 / EDGE for i in range(EDGE + 1)]
    upper = [(radius - edge + edge * math.cos(a), half - edge + edge * math.sin(a)) for a in turns]
    profile = [*((r, -z) for r, z in reversed(upper)), *upper]
    return drawn(Shape(lathe([(max(r, 0.0), z) for r, z in profile], ROUND), turn, color))


def capped(
    start: Vec3, end: Vec3, radius: float, color: Color, cap: Color, ring: Color
) -> tuple[Shape, ...]:
    """A shell whose ends carry a disc of another colour in a darker ring: a joint's housing."""
    way = [b - a for a, b in zip(start, end, strict=True)]
    length = math.sqrt(sum(v * v for v in way))
    out = [v / length for v in way]

    def past(point: Vec3, by: float) -> Vec3:
        x, y, z = (p + by * v for p, v in zip(point, out, strict=True))
        return (x, y, z)

    return (
        shell(start, end, radius, color, 0.15),
        rod(past(start, -0.001), past(end, 0.001), 0.80 * radius, ring),
        rod(past(start, -0.003), past(end, 0.003), 0.68 * radius, cap),
    )


def _along(start: Vec3, end: Vec3) -> tuple[Pose, float]:
    """Pose that brings the z axis along the way from `start` to `end`, and half its length."""
    along = tuple(b - a for a, b in zip(start, end, strict=True))
    middle = tuple((a + b) / 2 for a, b in zip(start, end, strict=True))
    side = min(range(3), key=lambda i: abs(along[i]))
    # x to `along`, and from there the cylinder's z
    turn = Pose((middle[0], middle[1], middle[2]), look_rotation(along, AXES[side]))
    return turn * Pose(rotation=ALONG_X), math.sqrt(sum(v * v for v in along)) / 2


def block(centre: Vec3, half: Vec3, rotation: Quat = LEVEL) -> Shape:
    """A box that collides and is not drawn."""
    return Shape(Box(half), Pose(centre, rotation), visual=False)


Row = tuple[str, Vec3, Vec3, Vec3, tuple[float, float]]
"""Name, origin xyz [m] and rpy [rad] in the link before, axis, lower and upper limit [rad]."""


def rpy_rotation(roll: float, pitch: float, yaw: float) -> Quat:
    """The rotation by `roll` about x, then `pitch` about y, then `yaw` about z, all fixed [rad]."""
    about_y = axis_rotation((0, 1, 0), pitch)
    return multiply(yaw_rotation(yaw), multiply(about_y, axis_rotation((1, 0, 0), roll)))


def serial_arm(
    rows: Sequence[Row],
    fingers: Sequence[tuple[str, Vec3, float]],
    limits: tuple[float, float],
    shapes: Sequence[tuple[Shape, ...]],
    tool: Pose = HERE,
    names: Sequence[str] = (),
    **more: Any,
) -> Arm:
    """An arm whose links are called `names`, those of fingers last, or link0, the base, to link6 or
    link7, finger1 and finger2; `more` is the rest of it.

    `fingers` are name, origin [m] in the last link and side: they slide away from the middle, by
    `limits` [m], and their frames are turned like the end-effector frame, `tool` in the last link:
    x approaches; a finger of side 1.0 slides along y, one of -1.0 against it.
    """
    link = names or [*(f"link{i}" for i in range(len(rows) + 1)), "finger1", "finger2"]
    joints = tuple(
        Joint(name, link[i], link[i + 1], Pose(xyz, rpy_rotation(*rpy)), axis, low, high)
        for i, (name, xyz, rpy, axis, (low, high)) in enumerate(rows)
    )
    sliding = []
    for child, (name, origin, side) in zip(link[-2:], fingers, strict=True):
        frame, axis = Pose(origin, tool.rotation), (0.0, side, 0.0)
        sliding.append(Joint(name, joints[-1].child, child, frame, axis, *limits, "prismatic"))
    named = dict(zip(link, shapes, strict=True))
    return Arm(
        base_link=link[0], joints=joints, fingers=tuple(sliding), tool=tool, shapes=named, **more
    )


FRONT = FixedCamera((0.0, -0.45, 0.85), (0, 1, -0.1), (-1, 0, 0), math.radians(37))
"""Low above the table's near edge; officially only a robot with both arms in one model has it."""
THIRD = FixedCamera((0.0, 0.23, 1.33), (0, -1, -1.02), (1, 0, 0), math.radians(93))
"""Looks back at the robot, for films: no camera of the official benchmark."""

DARK: Color = (0.05, 0.05, 0.055)
STEEL: Color = (0.36, 0.37, 0.39)


def two_arms(name: str, distance: float, arm: Callable[[str, float], Arm]) -> Embodiment:
    """A robot made of two single arms: `arm` makes the one of that name with its base at x [m]."""
    return Embodiment(
        name=name,
        arms=(arm("left", -distance / 2), arm("right", distance / 2)),
        cameras={"head": WORKCELL.head, "third": THIRD},
        distance=distance,
    )
