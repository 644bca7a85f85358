"""Putting shapes together into an `ObjectModel`: colours, pieces, bounds and the usual grasps.

Everything here works in the object's body frame (metres, z up, origin at the centre of the
underside, front towards -y).
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from robospa.geometry import Array, Pose, Quat, Vec3, to_matrix
from robospa.tasks.objects import meshes as m
from robospa.tasks.shapes import (
    Box,
    Color,
    Cylinder,
    Geometry,
    Grasp,
    Hinge,
    Mesh,
    ObjectModel,
    Params,
    Shape,
    Sphere,
)

UPRIGHT: Quat = (1.0, 0.0, 0.0, 0.0)
ALONG_X: Quat = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
"""Turns a cylinder's axis from z to x."""
ALONG_Y: Quat = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
"""Turns a cylinder's axis from z to -y."""

DOWN: Vec3 = (0.0, 0.0, -1.0)
MAX_WIDTH = 0.083
"""Widest object [m] that a grasp across it is offered for: grippers open 8 to 9 cm."""


@dataclass(frozen=True)
class Asset:
    """An asset: how many looks it has, and `build(look, params)`, which makes its model.

    `params` are the allowed names of further parameters.
    """

    look_count: int
    build: Callable[[int, Params], ObjectModel]
    params: frozenset[str] = frozenset()


def library(
    *assets: tuple[Callable[[int, Params], ObjectModel], Sized], **params: set[str]
) -> dict[str, Asset]:
    """Assets, named as what makes them: that and their looks; further parameters by asset."""
    found = {made.__name__: Asset(len(looks), made) for made, looks in assets}
    return found | {k: replace(found[k], params=frozenset(v)) for k, v in params.items()}


def srgb(code: str) -> Color:
    """Linear RGB of a colour written as on a screen, `#rrggbb`."""
    values = (int(code[i : i + 2], 16) / 255 for i in (1, 3, 5))
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in values)
    return (round(r, 4), round(g, 4), round(b, 4))


PALETTE: Mapping[str, Color] = {
    name: srgb(code)
    for name, code in {
        "red": "#cf1f27", "green": "#2c9a3f", "blue": "#1f55c4", "yellow": "#f5c816",
        "orange": "#f07818", "purple": "#7232a8", "pink": "#ee7fae", "white": "#f2f2ee",
        "black": "#1c1c20", "grey": "#85898f", "silver": "#b9bec4", "brown": "#7a4a26",
        "teal": "#158f8c", "cream": "#f2e3bd", "gold": "#d6a52c", "light blue": "#7fbde8",
        "dark green": "#1c5a34", "navy": "#1a2a5c", "beige": "#d9c29a", "tan": "#c79a62",
    }.items()
}  # fmt: skip
"""Colours by the word that an instruction would use."""

STEEL: Color = srgb("#c3c7cc")
DARK: Color = srgb("#26282c")
PAPER: Color = srgb("#f6f4ec")


def colour(name: str) -> Color:
    """The palette's colour called `name`."""
    return PALETTE[name]


def three_numbers(value: object, what: str) -> Vec3:
    """Three floats of a parameter's JSON value; ValueError, naming `what`, for anything else."""
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ValueError(f"{what} must be three numbers, not {value!r}")
    return (float(value[0]), float(value[1]), float(value[2]))


def collision(geometry: Geometry, at: Vec3 = (0.0, 0.0, 0.0), rotation: Quat = UPRIGHT) -> Shape:
    """A shape that only collides: it is not drawn."""
    return Shape(geometry, Pose(at, rotation), visual=False)


def outline(geometry: Geometry, at: Vec3 = (0.0, 0.0, 0.0), rotation: Quat = UPRIGHT) -> Shape:
    """A shape that is neither drawn nor felt, but measured: sizes and samplers take the object to
    reach as far, so that a scene outlives a new drawing."""
    return Shape(geometry, Pose(at, rotation), visual=False, collision=False)


def solid(
    geometry: Geometry,
    color: Color,
    at: Vec3 = (0.0, 0.0, 0.0),
    rotation: Quat = UPRIGHT,
    roughness: float = 0.5,
    metallic: float = 0.0,
    collision: bool = True,
) -> Shape:
    """A shape that is drawn and collides."""
    return Shape(geometry, Pose(at, rotation), color, True, collision, roughness, metallic)


visual = partial(solid, collision=False)
"""A shape that is only drawn: nothing collides with it."""


def points_of(shape: Shape) -> Array:
    """Points [m] (n, 3) in the body frame whose hull contains `shape`, and hardly more."""
    geometry = shape.geometry
    if isinstance(geometry, Mesh):
        local = np.asarray(geometry.vertices, dtype=float)
    elif isinstance(geometry, Box):
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        local = signs * np.asarray(geometry.half)
    elif isinstance(geometry, Cylinder):
        angles = np.arange(64) * (2 * math.pi / 64)
        circle = geometry.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        ends = [np.full((64, 1), s * geometry.half_length) for s in (-1, 1)]
        local = np.concatenate([np.concatenate([circle, z], axis=1) for z in ends])
    else:
        local = _ball(geometry)
    placed: Array = local @ to_matrix(shape.pose.rotation).T + np.asarray(shape.pose.position)
    return placed


def _ball(sphere: Sphere) -> Array:
    rows = []
    for polar in np.arange(17) * (math.pi / 16):
        for turn in np.arange(32) * (2 * math.pi / 32):
            s = math.sin(polar)
            rows.append([s * math.cos(turn), s * math.sin(turn), math.cos(polar)])
    return np.asarray(rows) * sphere.radius


def _round_up(value: float) -> float:
    """`value` rounded up to four digits, so that a bound stays a bound."""
    return math.ceil(value * 10.0**4 - 1e-6) / 10.0**4


def model(
    asset: str,
    parts: Sequence[Shape],
    noun: str,
    phrases: Iterable[str],
    grasps: Iterable[Grasp] = (),
    mass: float = 0.05,
    press: Vec3 | None = None,
    support: Vec3 | None = None,
    hinge: Hinge | None = None,
) -> ObjectModel:
    """The finished object; its size, radius and bottom are measured from its shapes, closed."""
    points = np.concatenate([points_of(p) for p in (*parts, *(hinge.shapes if hinge else ()))])
    span = points.max(axis=0) - points.min(axis=0)
    top = Pose(support or (0.0, 0.0, float(points[:, 2].max())))
    pressed = Pose(press) if press else top
    return ObjectModel(
        asset=asset,
        shapes=tuple(parts),
        size=(_round_up(float(span[0])), _round_up(float(span[1])), _round_up(float(span[2]))),
        radius=_round_up(float(np.hypot(points[:, 0], points[:, 1]).max())),
        noun=noun,
        phrases=tuple(phrases),
        bottom=round(float(points[:, 2].min()), 6),
        mass=mass,
        grasps=tuple(grasps),
        frames={"support": top, "press": pressed, "touched": pressed},
        hinge=hinge,
    )


def with_frames(made: ObjectModel, **frames: Pose) -> ObjectModel:
    """`made` with further named frames, or other ones in place of "press" and "support"."""
    return replace(made, frames={**made.frames, **frames})


def top_grasp(
    point: Vec3, width: float, angle: float = 0.0, tilt: float = 0.7, approach: Vec3 = DOWN
) -> Grasp:
    """A grasp from above whose fingers close along the direction `angle` [rad] about z."""
    closing = (round(math.cos(angle), 9), round(math.sin(angle), 9), 0.0)
    return Grasp(point, approach, closing, width, tilt)


def box_grasps(hx: float, hy: float, z: float, tilt: float = 0.7) -> tuple[Grasp, ...]:
    """Grasps of an upright box of half sizes `hx`, `hy` with the fingertips at height `z`."""
    ways = ((2 * hx, 0.0), (2 * hy, math.pi / 2))
    return tuple(top_grasp((0.0, 0.0, z), w, a, tilt) for w, a in ways if w <= MAX_WIDTH)


def round_grasps(width: float, z: float, tilt: float = 0.7, count: int = 4) -> tuple[Grasp, ...]:
    """Grasps of something round, `width` thick at height `z`, closing every pi / `count`."""
    return tuple(top_grasp((0.0, 0.0, z), width, math.pi * i / count, tilt) for i in range(count))


RIM = 0.0064
"""Thickness of a wall that is held at its rim [m]: closed fingers may stay 5.4 mm apart."""
SIDE_SLOPE = 1.05
"""How far a grasp from the side leans away from straight down [rad]."""


def side_grasps(width: float, z: float) -> tuple[Grasp, ...]:
    """Grasps of something round and tall, `width` thick at height `z`, from twelve sides."""
    found = []
    for i in range(12):
        a = 2 * math.pi * i / 12
        c, s = round(math.cos(a), 9), round(math.sin(a), 9)
        out, down = math.sin(SIDE_SLOPE), math.cos(SIDE_SLOPE)
        found.append(top_grasp((0.0, 0.0, z), width, a, 0.4, (s * out, -c * out, -down)))
    return tuple(found)


def rim_grasps(
    radius: float, thickness: float, z: float, count: int = 8, lean: float = 0.0
) -> tuple[Grasp, ...]:
    """Grasps astride a round wall whose middle is `radius` from the axis at height `z`.

    Where the wall leans outwards by `lean` [rad], so does the gripper.
    """
    found = []
    for i in range(count):
        a = 2 * math.pi * i / count
        c, s = math.cos(a), math.sin(a)
        point = (round(radius * c, 6), round(radius * s, 6), z)
        sink, rise = math.sin(lean), math.cos(lean)
        approach = (-sink * c, -sink * s, -rise)
        found.append(Grasp(point, approach, (rise * c, rise * s, -sink), thickness, tilt=0.5))
    return tuple(found)


def wall_ring(
    inner: float, thickness: float, low: float, high: float, count: int = 8, lean: float = 0.0
) -> list[Shape]:
    """Collision boxes of a round wall: `count` around `inner`, leaning by `lean` [rad]."""
    pieces = []
    middle = inner + thickness / 2
    half_width = (inner + thickness) * math.tan(math.pi / count)
    for i in range(count):
        a = 2 * math.pi * i / count
        turn = (math.cos(a / 2), 0.0, 0.0, math.sin(a / 2))
        tip = (math.cos(lean / 2), 0.0, math.sin(lean / 2), 0.0)
        rotation = (Pose((0.0, 0.0, 0.0), turn) * Pose((0.0, 0.0, 0.0), tip)).rotation
        at = (middle * math.cos(a), middle * math.sin(a), (low + high) / 2)
        box = Box((thickness / 2, half_width, (high - low) / 2 / math.cos(lean)))
        pieces.append(collision(box, at, rotation))
    return pieces


def fill_phrases(adjective: str, *patterns: str) -> tuple[str, ...]:
    """The noun phrases `patterns` with `{}` replaced by `adjective`."""
    return tuple(p.format(adjective) for p in patterns)


SIDES = 20
"""Sides of a cylinder that is no longer round."""
AXIS = {UPRIGHT: 2, ALONG_X: 0, ALONG_Y: 1}
"""The body axis along which a cylinder with this rotation lies."""


@dataclass(frozen=True)
class Fitted:
    """`shapes` of the wanted size, and the `factors` along x, y, z that made them so."""

    shapes: tuple[Shape, ...]
    factors: Vec3

    def at(self, x: float, y: float, z: float) -> Vec3:
        """Where a point of the shapes as designed has gone."""
        a, b, c = self.factors
        return (a * x, b * y, c * z)


def fitted(shapes: Sequence[Shape], size: Vec3) -> Fitted:
    """`shapes`, designed around the z axis on z = 0, with the outer `size` (x, y, z) [m]."""
    points = np.concatenate([points_of(s) for s in shapes])
    span = points.max(axis=0) - points.min(axis=0)
    x, y, z = (float(f) for f in np.asarray(size) / span)
    return Fitted(tuple(_stretched(s, (x, y, z)) for s in shapes), (x, y, z))


def stretched(parts: Iterable[Shape], x: float, y: float, z: float) -> list[Shape]:
    """`parts`, whose meshes stand where they are drawn, scaled along the axes."""
    return [
        replace(part, geometry=m.stretched(part.geometry, x, y, z))
        if isinstance(part.geometry, Mesh)
        else _stretched(part, (x, y, z))
        for part in parts
    ]


def _stretched(shape: Shape, factors: Vec3) -> Shape:
    geometry, turn = shape.geometry, shape.pose.rotation
    x, y, z = (f * c for f, c in zip(factors, shape.pose.position, strict=True))
    if isinstance(geometry, Box) and turn == UPRIGHT:
        half = tuple(f * h for f, h in zip(factors, geometry.half, strict=True))
        return replace(shape, geometry=Box((half[0], half[1], half[2])), pose=Pose((x, y, z)))
    if isinstance(geometry, Cylinder) and turn in AXIS:
        along = AXIS[turn]
        first, second = (f for k, f in enumerate(factors) if k != along)
        if abs(first / second - 1) < 1e-6:
            round_one = Cylinder(geometry.radius * first, geometry.half_length * factors[along])
            return replace(shape, geometry=round_one, pose=Pose((x, y, z), turn))
    return replace(shape, geometry=_baked(shape, factors), pose=Pose())


def _baked(shape: Shape, factors: Vec3) -> Mesh:
    geometry = shape.geometry
    if isinstance(geometry, Mesh):
        mesh = geometry
    elif isinstance(geometry, Box):
        mesh = m.box_mesh(geometry.half)
    elif isinstance(geometry, Cylinder):
        ends = ((geometry.radius, -geometry.half_length), (geometry.radius, geometry.half_length))
        mesh = m.lathe(ends, SIDES)
    else:
        raise ValueError(f"a {type(geometry).__name__} cannot be stretched; make it a mesh")
    at, turn = shape.pose.position, shape.pose.rotation
    return m.stretched(m.moved(mesh, at, turn), *factors)
