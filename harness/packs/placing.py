"""From a model's frame in the archive to ours: its file of points, where it stands and how it is
held.

Official models have y up and their origin near the middle of the underside; those with joints have
z up. Ours have z up, stand on z = 0 and look towards -y. Which way an official one looks differs
from model to model: `robospa/tasks/official/models.toml` says how each is turned. At a contact
point the z axis is the direction in which the gripper advances, the x axis that in which the
fingers close; how wide a part is there is measured on the convex pieces.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from robospa.geometry import Pose, Vec3, from_matrix, vec3
from robospa.harness.packs.archive import ArchiveError, read_json
from robospa.harness.packs.convex import planes
from robospa.harness.packs.mesh_files import Floats, Piece
from robospa.schema import read
from robospa.tasks.objects.build import MAX_WIDTH, points_of
from robospa.tasks.official import OfficialModel, official_size
from robospa.tasks.shapes import Grasp, ObjectModel

LARGEST_DATA = 4 << 20
"""Bytes that such a file may have; the largest official one has some tens of kilobytes."""
Points = Annotated[list[Any], Meta(max_length=256)]
KEYS = {
    "contact": ("contact_points_pose", "contact_points", "contact_pose"),
    "functional": ("functional_matrix", "functional_points"),
}
"""Names of the lists of points, newest first: 48 official files have older ones."""
SCALES, SIZES = (1e-4, 1e4), (-1e12, 1e12)
LARGEST = 1e6
"""What no place of such a file reaches."""


Three = float | tuple[float, float, float]
"""One number counts for all three axes."""


class _File(msgspec.Struct):
    """Such a file. A mass that is given link by link counts as none."""

    scale: Three = 1.0
    extents: Three | None = None
    mass: float | dict[str, Any] | list[Any] | None = None
    contact_points_pose: Points | None = None
    contact_points: Points | None = None
    contact_pose: Points | None = None
    functional_matrix: Points | None = None
    functional_points: Points | None = None

    def points(self, kind: str) -> list[Any]:
        """The list of points of a kind."""
        return next((rows for key in KEYS[kind] if (rows := getattr(self, key))), [])


@dataclass(frozen=True)
class ModelData:
    """`scale` of mesh and points along the model's axes; (n, 4, 4) frames of its points of each of
    KEYS, in the model's frame before scaling; extents before scaling; mass [kg], None if not given.
    """

    scale: Vec3
    points: Mapping[str, Floats]
    extents: Vec3 | None = None
    mass: float | None = None
    links: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """For models with joints, the link in whose frame each point of a kind is; "" if not said."""

    def in_root(self, frames: Mapping[str, Floats]) -> ModelData:
        """The same with all points in the root's frame; `frames` (4, 4) are the links' there,
        unscaled."""

        def moved(kind: str, points: Floats) -> Floats:
            named = self.links.get(kind, ("",) * len(points))
            rows = [frames.get(n, np.eye(4)) @ p for n, p in zip(named, points, strict=True)]
            return np.array(rows).reshape(-1, 4, 4)

        return replace(self, points={kind: moved(kind, of) for kind, of in self.points.items()})

    def point(self, name: str) -> Vec3 | None:
        """Where "contact 2" or "functional 0" lies in the model's frame, scaled; None if the model
        has no such point."""
        kind, _, number = name.partition(" ")
        frames = self.points[kind]
        return vec3(frames[int(number), :3, 3] * self.scale) if int(number) < len(frames) else None


def read_model_data(path: Path) -> ModelData:
    """What `path` says. ArchiveError, in one sentence, if it is not such a file."""
    what = repr(str(path))
    said = read(_File, read_json(path, LARGEST_DATA), what, ArchiveError)
    mass = said.mass if isinstance(said.mass, float) else None
    if mass is not None and not 0 < mass < 1e3:
        raise ArchiveError(f"{what} gives the mass {mass}, which no object can have")
    return ModelData(
        _three(said.scale, SCALES, f"{what} has the scale"),
        {kind: _frames(said, kind, what) for kind in KEYS},
        None if said.extents is None else _three(said.extents, SIZES, f"{what} has the extents"),
        mass,
        {kind: tuple(_part(row, str, "") for row in said.points(kind)) for kind in KEYS},
    )


def _three(value: Three, bounds: tuple[float, float], what: str) -> Vec3:
    found = vec3(value if isinstance(value, tuple) else (value,) * 3)
    if not all(bounds[0] <= number <= bounds[1] for number in found):
        raise ArchiveError(f"{what} {list(found)}, which no model can have")
    return found


def _frames(said: _File, kind: str, what: str) -> Floats:
    """(n, 4, 4) frames of a kind of points, (0, 4, 4) if there are none."""
    try:
        rows = [_part(row, list, row) for row in said.points(kind)]
        found = np.array(rows, dtype=float).reshape(-1, 4, 4)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArchiveError(f"{what} has {kind} points that are no 4x4 frames") from error
    if not np.isfinite(found).all() or np.abs(found).max(initial=0.0) > LARGEST:
        raise ArchiveError(f"{what} has {kind} points at places that no object can have")
    return found


def _part(row: object, kind: type, default: Any) -> Any:
    """Of a point of a model with joints its frame, a list, or the link in which that is, a text;
    the points of others are frames alone."""
    values = row.values() if isinstance(row, dict) else ()
    return next((value for value in values if isinstance(value, kind)), default)


Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Turns the archive's y axis up; its z axis, the front, goes to -y."""
TALLER, SHORTER = 1.2, 1 / 1.2
WIDER, NARROWER = 1.2, 0.5
"""By how much a model may differ from its listed height and widths: files from the wrong unit or
of another model do so by more. Listed widths are up to 1.41 times, rarely 1.7 times, too large."""


@dataclass(frozen=True)
class Placing:
    """Points p of the model are at `turn` @ (`scale` * p) + `shift` [m] in our body frame; there
    `low` and `high` [m] are the corners of the box of what collides."""

    scale: Vec3
    turn: Floats
    shift: Floats
    low: Floats
    high: Floats

    def points(self, points: Floats) -> Floats:
        """Where points (n, 3) of the archive's model are in the body frame."""
        return self.scaled_points(points * self.scale)

    def scaled_points(self, points: Floats) -> Floats:
        """The same of points that are scaled already."""
        placed: Floats = points @ self.turn.T + self.shift
        return placed

    @property
    def pose(self) -> Pose:
        """Turn and shift as a pose."""
        return Pose(vec3(self.shift), from_matrix(self.turn))


def place(
    points: Floats, drawn: Floats, data: ModelData, model: OfficialModel, builtin: ObjectModel
) -> Placing:
    """How a model is placed in our frame: `points` (n, 3) are of what collides, `drawn` (2, 3) the
    corners of the box of what is drawn, both unscaled. ArchiveError for a model of the wrong size
    or without a point that it needs."""
    scaled = points * data.scale
    turn = np.eye(3) if model.lies or model.jointed else Y_UP
    turn = _about_z(model.turns * math.pi / 2) @ turn
    if model.faces:
        turn = _about_z(_bearing_off(scaled @ turn.T, turn, data, model, builtin)) @ turn
    turned = scaled @ turn.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    shift = np.array([0.0, 0.0, -low[2]])
    if model.jointed or model.lies:  # our own origins: the archive's are in the middle of the mesh
        shift[:2] = (_box(builtin).sum(axis=0) - (low + high))[:2] / 2
    _check_size(drawn * data.scale, model)
    return Placing(data.scale, turn, shift, low + shift, high + shift)


def _about_z(angle: float) -> Floats:
    c, s = round(math.cos(angle), 12), round(math.sin(angle), 12)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _bearing_off(
    turned: Floats, turn: Floats, data: ModelData, model: OfficialModel, builtin: ObjectModel
) -> float:
    """By how much [rad] the model must be turned about z to look where the built-in one does."""
    point, _, frame = model.faces.partition(" = ")
    if point == "outermost":
        x, y, _ = turned[np.hypot(turned[:, 0], turned[:, 1]).argmax()].tolist()
    else:
        found = data.point(point)
        if found is None:
            raise ArchiveError(f"{model} has no {point} point, by which it is turned")
        x, y, _ = (turn @ np.asarray(found)).tolist()
    ours = builtin.frames[frame].position
    return math.atan2(ours[1], ours[0]) - math.atan2(y, x)


def _check_size(corners: Floats, model: OfficialModel) -> None:
    """ArchiveError if the model is not as large as the archive's, which says so in its own axes."""
    listed = official_size(model)
    if listed is None:
        return
    across, up, deep = np.ptp(corners, axis=0).tolist()
    wide = across / listed.size[0], deep / listed.size[2]
    fits = SHORTER <= up / listed.size[1] <= TALLER
    if not fits or not all(NARROWER <= share <= WIDER for share in wide):
        raise ArchiveError(
            f"{model} is {across:.3g} x {up:.3g} x {deep:.3g} m large where the official one is "
            f"{' x '.join(f'{size:.3g}' for size in listed.size)} m: its scale or its file is wrong"
        )


def _box(builtin: ObjectModel) -> Floats:
    """Corners (2, 3) [m] of the box around what collides, doors included."""
    shapes = (*builtin.shapes, *(builtin.hinge.shapes if builtin.hinge else ()))
    points = np.concatenate([points_of(shape) for shape in shapes if shape.collision])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def likeness(builtin: ObjectModel, placing: Placing) -> Callable[[Vec3], Vec3]:
    """Takes points of the built-in model to the like places of the archive's: from the box of what
    collides of one to that of the other, axis by axis."""
    low, high = _box(builtin)
    factors = (placing.high - placing.low) / np.maximum(high - low, 1e-9)
    return lambda point: vec3(placing.low + factors * (np.asarray(point) - low))


def frames(
    builtin: ObjectModel, placing: Placing, data: ModelData, model: OfficialModel
) -> dict[str, Pose]:
    """The frames that tasks and skills need: at the archive's points where the table names one,
    else at the like place. They are turned as the built-in ones. ArchiveError if the archive has no
    such point."""
    like = likeness(builtin, placing)
    found = {
        name: replace(frame, position=like(frame.position))
        for name, frame in builtin.frames.items()
    }
    for name, point in model.points.items():
        place = data.point(point)
        if place is None:
            raise ArchiveError(f"{model} has no {point} point, where its {name} is")
        at = vec3(placing.scaled_points(np.array([place]))[0])
        found[name] = replace(builtin.frames[name], position=at)
    return found


UPWARDS = -0.2
"""A gripper comes from above: its approach's z is no larger."""
DEPTHS = (-0.004, 0.0, 0.004)
"""Along the approach, where a width is measured [m]."""
REACH = 0.012
"""How far from the line between the fingertips a part may begin [m]."""
TILT = 0.4
"""How far an approach at a contact point may be turned about the closing direction [rad]."""


def grasp_points(
    pieces: Sequence[Piece],
    builtin: ObjectModel,
    placing: Placing,
    data: ModelData,
    model: OfficialModel,
) -> tuple[Grasp, ...]:
    """All that fingers fit around; `pieces` are in the body frame [m]."""
    faces = [planes(*piece) for piece in pieces]
    like = likeness(builtin, placing)
    found = [(like(g.point), g.approach, g.closing, g.tilt) for g in builtin.grasps]
    used = {point for point in model.points.values() if point.startswith("contact")}
    for number, frame in enumerate(data.points["contact"]):
        if f"contact {number}" in used:
            continue
        closing, approach = (_unit(placing.turn @ frame[:3, k]) for k in (0, 2))
        if approach[2] <= UPWARDS:
            at = vec3(placing.points(frame[None, :3, 3])[0])
            found.append((at, approach, closing, TILT))
    made = []
    for point, approach, closing, tilt in found:
        held = _between(faces, np.array(point), np.array(approach), np.array(closing))
        if held is None or not 1e-3 < held[1] <= MAX_WIDTH:
            continue
        middle = vec3(np.array(point) + held[0] * np.array(closing))
        made.append(Grasp(middle, approach, closing, held[1], tilt))
    return tuple(dict.fromkeys(made))


def _unit(vector: Floats) -> Vec3:
    return vec3(vector / max(float(np.linalg.norm(vector)), 1e-9))


def _between(
    faces: Sequence[tuple[Floats, Floats]], point: Floats, approach: Floats, closing: Floats
) -> tuple[float, float] | None:
    """Middle and width [m], along `closing` from `point`, of the part between the fingertips. None
    if there is nothing. Parts that touch or overlap along the line are one."""
    spans = []
    for depth in DEPTHS:
        start = point + depth * approach
        for normals, offsets in faces:
            slope = normals @ closing
            room = offsets - normals @ start
            if (room[np.abs(slope) < 1e-9] < 0).any():
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                at = room / slope
            low = at[slope < -1e-9].max(initial=-np.inf)
            high = at[slope > 1e-9].min(initial=np.inf)
            if low < high:
                spans.append((float(low), float(high)))
    near = sorted(span for span in spans if span[0] < REACH and span[1] > -REACH)
    if not near:
        return None
    low, high = min(near, key=lambda span: max(span[0], -span[1], 0.0))
    grown = True
    while grown:
        grown = False
        for a, b in near:
            if a <= high + 1e-4 and b >= low - 1e-4 and (a < low or b > high):
                low, high, grown = min(a, low), max(b, high), True
    return (low + high) / 2, high - low
