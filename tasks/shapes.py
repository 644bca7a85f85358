"""Models of objects: shapes to draw and to collide with, and the frames that skills use.

All values are in the object's body frame: z up when the object stands on the table as placed.
The origin is the centre of the underside for modelled objects and the centre for box primitives
(asset `block`), as in the official assets, because official height thresholds are on origins.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from robospa.geometry import Pose, Vec3, axis_rotation

Color = tuple[float, float, float]
"""Linear RGB, each 0..1."""
Params = Mapping[str, Any]
"""What an asset is made with (half sizes, colour, which look...): JSON values by name."""


@dataclass(frozen=True)
class Box:
    """`half` sizes [m] along x, y, z."""

    half: Vec3


@dataclass(frozen=True)
class Sphere:
    """`radius` [m]."""

    radius: float


@dataclass(frozen=True)
class Cylinder:
    """Along z: `radius` and `half_length` [m]."""

    radius: float
    half_length: float


@dataclass(frozen=True)
class Mesh:
    """Triangles: `vertices` [m], `faces` as index triples, counter-clockwise seen from outside.

    As a collision shape its convex hull is used.
    """

    vertices: tuple[Vec3, ...]
    faces: tuple[tuple[int, int, int], ...]


Geometry = Box | Sphere | Cylinder | Mesh


@dataclass(frozen=True)
class Shape:
    """One piece of a body: drawn if `visual`, colliding if `collision`."""

    geometry: Geometry
    pose: Pose = Pose()
    color: Color = (0.8, 0.8, 0.8)
    visual: bool = True
    collision: bool = True
    roughness: float = 0.5
    metallic: float = 0.0


@dataclass(frozen=True)
class Grasp:
    """A way to take an object between two parallel fingers.

    `point` [m] lies between the fingertips; `approach` is the unit direction in which the gripper
    advances; `closing` the unit direction in which the fingers close (either sign is the same
    grasp); `width` [m] is the object's size along it. `tilt` [rad] is how far the approach may be
    turned about `closing`, either way, without spoiling the grasp.
    """

    point: Vec3
    approach: Vec3
    closing: Vec3
    width: float
    tilt: float = 0.7


@dataclass(frozen=True)
class Skin:
    """What is drawn of a body that is not built in: triangles with a picture, kept in a file.

    `file` is a .npz of `vertices` (V, 3), unit `normals` (V, 3), `triangles` (F, 3) and `uvs`
    (V, 2) from the upper left corner of `picture` (S, S, 4), sRGB uint8. Vertices are scaled by
    `scale` along their axes, then moved by `pose` into the body frame [m]. `tint`, if any, replaces
    the picture's colours, not their brightness.
    """

    file: str
    scale: Vec3 = (1.0, 1.0, 1.0)
    pose: Pose = Pose()
    tint: Color | None = None


@dataclass(frozen=True)
class Hinge:
    """A part that turns about an axis fixed in the body, from 0 (as drawn) to `upper` [rad].

    `shapes` are in the body frame at angle 0; `point` [m] lies on the axis, `axis` is its unit
    direction, positive angles turn right-handed about it. `friction` is the bearing's coefficient,
    `damping` [N m s/rad] slows a motion, so that a part stays where it is left; `mass` [kg] is the
    part's own.
    """

    shapes: tuple[Shape, ...]
    point: Vec3
    axis: Vec3
    upper: float
    friction: float = 0.05
    damping: float = 0.05
    mass: float = 0.1
    skin: Skin | None = None

    def turned(self, angle: float) -> Pose:
        """Pose of the part in the body frame when it has turned by `angle` [rad]."""
        turn = Pose(self.point, axis_rotation(self.axis, angle))
        x, y, z = self.point
        return turn * Pose((-x, -y, -z))


@dataclass(frozen=True)
class ObjectModel:
    """A body: shapes, mass, and the frames that scenes, goals and skills need.

    `radius` [m] bounds the footprint around the origin, `size` [m] is the bounding box (x, y, z),
    `bottom` [m] is the lowest z of the body frame (0 for modelled objects, -half for boxes), so
    an object at rest on the table has origin height TABLE_TOP - bottom.
    `frames` holds named frames: "press" (z axis out of the surface to be pressed), "touched" (about
    which a gripper's contacts count as a press; the official contact point), "support" (where
    something is put on it, z up)...
    `noun` is the plain English noun; `phrases` are noun phrases without article that describe
    this very look ("red stapler"), at least four, the last third kept for held-out instructions.
    """

    asset: str
    shapes: tuple[Shape, ...]
    size: Vec3
    radius: float
    noun: str
    phrases: tuple[str, ...] = ()
    bottom: float = 0.0
    mass: float = 0.05
    friction: float = 0.5
    grasps: tuple[Grasp, ...] = ()
    frames: Mapping[str, Pose] = field(default_factory=dict)
    hinge: Hinge | None = None
    """A door or lid; frames and grasps are given with it closed. Its frame "handle", if it has
    one, has x into the handle (the approach) and y across it (where fingers close)."""
    skin: Skin | None = None
    """Drawn besides the visual ones of `shapes`, for models of asset packs."""
