"""The JSON of a model of the archive: its scale, and the points where it is held and used."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Vec3
from robospa.harness.packs.archive import ArchiveError

Array = NDArray[np.float64]

LARGEST_FILE = 4 << 20
"""Bytes that such a file may have; the largest official one has some tens of kilobytes."""
MOST_POINTS = 256
KEYS = {
    "contact": ("contact_points_pose", "contact_points", "contact_pose"),
    "functional": ("functional_matrix", "functional_points"),
}
"""Names of the lists of points, newest first: 48 official files have older ones."""
SCALES = (1e-4, 1e4)
LARGEST, LONGEST = 1e6, 1e12
"""What no place of such a file reaches, and no other number: JSON may hold NaN, and whole numbers
of any length."""


@dataclass(frozen=True)
class ModelData:
    """`scale` of mesh and points along the model's axes; (n, 4, 4) frames of its points, in the
    model's frame before scaling; extents before scaling; mass [kg], None if not given."""

    scale: Vec3
    contact: Array
    functional: Array
    extents: Vec3 | None = None
    mass: float | None = None
    links: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """For models with joints, the link in whose frame each point of a kind is; "" if not said."""

    def in_root(self, frames: Mapping[str, Array]) -> ModelData:
        """The same with all points in the root's frame; `frames` (4, 4) are the links' there,
        unscaled."""

        def moved(kind: str, points: Array) -> Array:
            named = self.links.get(kind, ("",) * len(points))
            rows = [frames.get(n, np.eye(4)) @ p for n, p in zip(named, points, strict=True)]
            return np.array(rows).reshape(-1, 4, 4)

        return replace(
            self,
            contact=moved("contact", self.contact),
            functional=moved("functional", self.functional),
        )

    def point(self, name: str) -> Vec3 | None:
        """Where "contact 2" or "functional 0" lies in the model's frame, scaled; None if the model
        has no such point."""
        kind, _, number = name.partition(" ")
        frames = self.contact if kind == "contact" else self.functional
        if int(number) >= len(frames):
            return None
        x, y, z = (frames[int(number), :3, 3] * self.scale).tolist()
        return (x, y, z)


def read_model_data(path: Path) -> ModelData:
    """What `path` says. ArchiveError, in one sentence, if it is not such a file."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ArchiveError(f"{str(path)!r} is larger than {LARGEST_FILE >> 20} MB")
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        if isinstance(error, ArchiveError):
            raise
        raise ArchiveError(f"{str(path)!r} is no readable JSON file: {error}") from error
    if not isinstance(data, dict):
        raise ArchiveError(f"{str(path)!r} must hold a JSON object with a scale and points")
    scale = _three(data.get("scale", (1.0, 1.0, 1.0)), path, "scale")
    if not all(SCALES[0] <= s <= SCALES[1] for s in scale):
        raise ArchiveError(f"{str(path)!r} has the scale {list(scale)}, which no model can have")
    extents = data.get("extents")
    return ModelData(
        scale,
        _frames(data, "contact", path),
        _frames(data, "functional", path),
        None if extents is None else _three(extents, path, "extents"),
        _mass(data.get("mass"), path),
        {kind: tuple(_link(row) for row in _listed(data, kind)) for kind in KEYS},
    )


def _mass(value: object, path: Path) -> float | None:
    """A body's mass [kg]; None where it is not given, or given link by link."""
    if value is None or isinstance(value, dict | list):
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 1e3:
        raise ArchiveError(
            f"{str(path)!r} gives the mass {repr(value)[:80]}, which no object can have"
        )
    return float(value)


def _three(value: object, path: Path, what: str) -> Vec3:
    """Three numbers; one number counts for all three axes."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        value = [value] * 3
    if (
        not isinstance(value, list | tuple)
        or len(value) != 3
        or not all(isinstance(v, int | float) and abs(v) < LONGEST for v in value)
    ):
        raise ArchiveError(
            f"{str(path)!r} must give three numbers as {what}, not {repr(value)[:80]}"
        )
    return (float(value[0]), float(value[1]), float(value[2]))


def _frames(data: dict[str, Any], kind: str, path: Path) -> Array:
    """(n, 4, 4) frames of a list of points, (0, 4, 4) if there is none."""
    listed = _listed(data, kind)
    if not isinstance(listed, list) or len(listed) > MOST_POINTS:
        raise ArchiveError(
            f"{str(path)!r} must list its {kind} points, {MOST_POINTS} of them at most"
        )
    rows = [_matrix(row) for row in listed]
    try:
        found = np.array(rows, dtype=float).reshape(-1, 4, 4)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArchiveError(f"{str(path)!r} has {kind} points that are no 4x4 frames") from error
    if not np.isfinite(found).all() or np.abs(found).max(initial=0.0) > LARGEST:
        raise ArchiveError(f"{str(path)!r} has {kind} points at places that no object can have")
    return found


def _listed(data: dict[str, Any], kind: str) -> Any:
    return next((data[key] for key in KEYS[kind] if data.get(key)), [])


def _link(row: object) -> str:
    """The link in whose frame a point is; "" if that is not said."""
    values = row.values() if isinstance(row, dict) else ()
    return next((value for value in values if isinstance(value, str)), "")


def _matrix(row: object) -> object:
    """The frame of a point; models with joints also name the link that it belongs to."""
    if isinstance(row, dict):
        return next((value for value in row.values() if isinstance(value, list)), row)
    return row
