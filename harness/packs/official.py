"""The pack of the official archive: models made of a user's own copy of the official assets.

What tasks ask of an object beyond its shape (which way it faces, where it is pressed, what it is
called) is taken from its built-in likeness and from the archive's points.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from robospa.harness.packs.archive import Archive, ArchiveError, open_archive
from robospa.harness.packs.assembly import Parts, Piece, parts_of
from robospa.harness.packs.holding import grasps
from robospa.harness.packs.index import digest_of, task_faults
from robospa.harness.packs.model_data import read_model_data
from robospa.harness.packs.objaverse import ASSET as THING
from robospa.harness.packs.objaverse import kinds, make_thing
from robospa.harness.packs.placing import Likeness, Placing, frames, place
from robospa.harness.packs.solids import solids, vector
from robospa.tasks.colors import NAMED
from robospa.tasks.modes.clutter import ClutterKind, own_kinds
from robospa.tasks.objects import object_model
from robospa.tasks.official import OfficialModel, official_model
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Color, Hinge, ObjectModel, Params, Skin

Floats = NDArray[np.float64]


class OfficialPack:
    """A `robospa.tasks.packs.Pack` of the archive in one folder."""

    name = "official"

    def __init__(self, archive: Archive) -> None:
        self.archive = archive
        self._made = lru_cache(maxsize=1024)(self._make)

    def has(self, asset: str, params: Params) -> bool:
        """Whether the official benchmark takes it from the archive."""
        return asset == THING or official_model(asset, params.get("look", 0)) is not None

    def model(self, asset: str, params: Params) -> ObjectModel:
        """The archive's model of that look. ArchiveError, in one sentence, if it is not there or
        cannot be used; ValueError for an asset that the archive does not have."""
        return self._made(asset, json.dumps(dict(params), sort_keys=True))

    def digest(self) -> str:
        """Hash of names and sizes of all files that models are made of, and of their points."""
        return digest_of(self.archive)

    def faults(self, tasks: Collection[str]) -> dict[str, str]:
        """For each of `tasks` that cannot run with the archive a sentence that says why."""
        return task_faults(self.archive, tasks)

    def clutter(self, scene: Scene) -> tuple[ClutterKind, ...]:
        """What may lie about in `scene`: our kinds, as the archive's models where it has those, and
        its things of Objaverse; none if it has no such things."""
        theirs = kinds(self.archive, self.name, scene)
        return (*map(self._packed, own_kinds(scene)), *theirs) if theirs else ()

    def _packed(self, kind: ClutterKind) -> ClutterKind:
        looks = [
            {**params, "pack": self.name} if self._there(kind.asset, params) else params
            for params in kind.looks
        ]
        return ClutterKind(kind.asset, looks)

    def _there(self, asset: str, params: Params) -> bool:
        """Whether the archive has the model's files."""
        model = official_model(asset, params["look"])
        try:
            return model is not None and bool(self.archive.files(model))
        except ArchiveError:
            return False

    def _make(self, asset: str, text: str) -> ObjectModel:
        params = json.loads(text)
        if asset == THING:
            return make_thing(self.archive, params.get("thing"))
        builtin = object_model(asset, params)
        chosen = official_model(asset, params.get("look", 0))
        if chosen is None:
            raise ValueError(f"the official archive has no {asset!r}; it is always built in")
        tint = NAMED[params["tint"]] if "tint" in params else None
        return make_model(self.archive, chosen, builtin, tint)


def open_pack() -> OfficialPack:
    """The pack of the folder that `open_archive` finds."""
    return OfficialPack(open_archive())


def make_model(
    archive: Archive, chosen: OfficialModel, builtin: ObjectModel, tint: Color | None = None
) -> ObjectModel:
    """The archive's `chosen` model with all that its `builtin` likeness has."""
    what = f"the official model {chosen.name}"
    files = archive.files(chosen)
    data = read_model_data(files.data)
    parts = parts_of(archive, files, chosen.hinge, what)
    data = data.in_root(parts.links)
    pieces = [*parts.body.pieces, *(parts.door.pieces if parts.door else ())]
    points = np.concatenate([corners for corners, _ in pieces])
    placing = place(points, _box(parts), data, chosen, builtin, what)
    likeness = Likeness.of(builtin, placing)
    placed = _placed(parts.body.pieces, placing)
    low, high = placing.low, placing.high
    size = (high - low).tolist()
    placed_points = placing.points(points)
    held = grasps(placed, builtin, likeness, placing, data, chosen)
    return ObjectModel(
        asset=builtin.asset,
        shapes=solids(placed),
        size=(size[0], size[1], size[2]),
        radius=float(np.hypot(placed_points[:, 0], placed_points[:, 1]).max()),
        noun=builtin.noun,
        phrases=builtin.phrases,
        bottom=0.0,
        mass=data.mass or builtin.mass,
        friction=builtin.friction,
        grasps=held,
        frames=frames(builtin, likeness, placing, data, chosen, what),
        hinge=_hinge(parts, placing, builtin, what, tint),
        skin=Skin(str(parts.body.skin), placing.scale, placing.pose, tint),
    )


def _box(parts: Parts) -> Floats:
    """Corners (2, 3) of the box around all that is drawn."""
    boxes = [parts.body.box, *([parts.door.box] if parts.door else [])]
    corners = np.concatenate(boxes)
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def _placed(pieces: Sequence[Piece], placing: Placing) -> list[Piece]:
    """The pieces in the body frame [m]."""
    return [(placing.points(corners), triangles) for corners, triangles in pieces]


def _hinge(
    parts: Parts, placing: Placing, builtin: ObjectModel, what: str, tint: Color | None
) -> Hinge | None:
    """The door: it turns from 0 as drawn to its joint's limit, whichever way that is."""
    if parts.door is None or parts.joint is None:
        return None
    frame = parts.links[parts.joint.child]
    assert builtin.hinge is not None
    lower, upper = parts.joint.limits
    way = 1.0 if upper >= -lower else -1.0
    axis = placing.turn @ frame[:3, :3] @ np.asarray(parts.joint.axis) * way
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise ArchiveError(f"{what} has a door that turns about no axis")
    axis = axis / length
    at = placing.points(frame[None, :3, 3])[0]
    return Hinge(
        shapes=solids(_placed(parts.door.pieces, placing)),
        point=vector(at),
        axis=vector(axis),
        upper=max(upper, -lower),
        friction=builtin.hinge.friction,
        damping=builtin.hinge.damping,
        mass=builtin.hinge.mass,
        skin=Skin(str(parts.door.skin), placing.scale, placing.pose, tint),
    )
