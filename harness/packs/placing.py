"""From a model's frame in the archive to ours: z up, standing on z = 0, the front towards -y.

Official models have y up and their origin near the middle of the underside; those with joints have
z up. Which way one looks differs from model to model: `robospa/tasks/official/models.toml` says how
each is turned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, Vec3, from_matrix
from robospa.harness.packs.archive import ArchiveError
from robospa.harness.packs.model_data import ModelData
from robospa.tasks.objects.build import points_of
from robospa.tasks.official import OfficialModel, official_size
from robospa.tasks.shapes import ObjectModel

Floats = NDArray[np.float64]

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
        placed: Floats = (points * self.scale) @ self.turn.T + self.shift
        return placed

    def scaled_points(self, points: Floats) -> Floats:
        """The same of points that are scaled already."""
        placed: Floats = points @ self.turn.T + self.shift
        return placed

    @property
    def pose(self) -> Pose:
        """Turn and shift as a pose."""
        x, y, z = self.shift.tolist()
        return Pose((x, y, z), from_matrix(self.turn))


def place(
    points: Floats,
    drawn: Floats,
    data: ModelData,
    model: OfficialModel,
    builtin: ObjectModel,
    what: str,
) -> Placing:
    """How a model is placed in our frame: `points` (n, 3) are of what collides, `drawn` (2, 3) the
    corners of the box of what is drawn, both unscaled.

    ArchiveError, naming `what` it is, for a model of the wrong size or without a point it needs.
    """
    scaled = points * data.scale
    turn = np.eye(3) if model.lies or model.jointed else Y_UP
    turn = _about_z(model.turns * math.pi / 2) @ turn
    if model.faces:
        turn = _about_z(_bearing_off(scaled @ turn.T, turn, data, model, builtin, what)) @ turn
    turned = scaled @ turn.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    shift = np.array([0.0, 0.0, -low[2]])
    if model.jointed or model.lies:  # our own origins: the archive's are in the middle of the mesh
        shift[:2] = (_box(builtin).sum(axis=0) - (low + high))[:2] / 2
    _check_size(drawn * data.scale, model, what)
    return Placing(data.scale, turn, shift, low + shift, high + shift)


def _about_z(angle: float) -> Floats:
    c, s = round(math.cos(angle), 12), round(math.sin(angle), 12)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _bearing_off(
    turned: Floats,
    turn: Floats,
    data: ModelData,
    model: OfficialModel,
    builtin: ObjectModel,
    what: str,
) -> float:
    """By how much [rad] the model must be turned about z to look where the built-in one does."""
    point, _, frame = model.faces.partition(" = ")
    if point == "outermost":
        x, y, _ = turned[np.hypot(turned[:, 0], turned[:, 1]).argmax()].tolist()
    else:
        found = data.point(point)
        if found is None:
            raise ArchiveError(f"{what} has no {point} point, by which it is turned")
        x, y, _ = (turn @ np.asarray(found)).tolist()
    ours = builtin.frames[frame].position
    return math.atan2(ours[1], ours[0]) - math.atan2(y, x)


def _check_size(corners: Floats, model: OfficialModel, what: str) -> None:
    """ArchiveError if the model is not as large as the archive's, which says so in its own axes."""
    listed = official_size(model)
    if listed is None:
        return
    across, up, deep = np.ptp(corners, axis=0).tolist()
    wide = across / listed.size[0], deep / listed.size[2]
    fits = SHORTER <= up / listed.size[1] <= TALLER
    if not fits or not all(NARROWER <= share <= WIDER for share in wide):
        raise ArchiveError(
            f"{what} is {across:.3g} x {up:.3g} x {deep:.3g} m large where the official one is "
            f"{' x '.join(f'{size:.3g}' for size in listed.size)} m: its scale or its file is wrong"
        )


def _box(builtin: ObjectModel) -> Floats:
    """Corners (2, 3) [m] of the box around what collides, doors included."""
    shapes = (*builtin.shapes, *(builtin.hinge.shapes if builtin.hinge else ()))
    points = np.concatenate([points_of(shape) for shape in shapes if shape.collision])
    return np.stack([points.min(axis=0), points.max(axis=0)])


@dataclass(frozen=True)
class Likeness:
    """Takes points of the built-in model to the like places of the archive's: from the box of what
    collides of one to that of the other, axis by axis."""

    factors: Floats
    low: Floats
    origin: Floats

    @staticmethod
    def of(builtin: ObjectModel, placing: Placing) -> Likeness:
        """Between the two models' boxes."""
        low, high = _box(builtin)
        factors = (placing.high - placing.low) / np.maximum(high - low, 1e-9)
        return Likeness(factors, placing.low, low)

    def point(self, point: Vec3) -> Vec3:
        """Where `point` of the built-in model has gone."""
        x, y, z = (self.low + self.factors * (np.asarray(point) - self.origin)).tolist()
        return (x, y, z)


def frames(
    builtin: ObjectModel,
    likeness: Likeness,
    placing: Placing,
    data: ModelData,
    model: OfficialModel,
    what: str,
) -> dict[str, Pose]:
    """The frames that tasks and skills need: at the archive's points where the table names one,
    else at the like place. They are turned as the built-in ones.

    ArchiveError if the archive has no such point.
    """
    found = {
        name: replace(frame, position=likeness.point(frame.position))
        for name, frame in builtin.frames.items()
    }
    for name, point in model.points.items():
        place = data.point(point)
        if place is None:
            raise ArchiveError(f"{what} has no {point} point, where its {name} is")
        x, y, z = placing.scaled_points(np.array([place]))[0].tolist()
        found[name] = replace(builtin.frames[name], position=(x, y, z))
    return found
