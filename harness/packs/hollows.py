"""Whether what should be hollow is: bins, baskets, bowls and cups whose pieces leave their mouth
open.

A collision file that holds one in a single node is filled by its hull, here as in SAPIEN: nothing
can be put into it then, and no finger reaches into it to take it at its rim.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robospa.harness.packs.archive import Archive
from robospa.harness.packs.assembly import Piece, solid_pieces
from robospa.harness.packs.mesh_files import reads_meshes
from robospa.harness.packs.urdf import MeshUse
from robospa.tasks.official import OfficialModel

Floats = NDArray[np.float64]

SHALLOW = 0.25
"""A hollow no deeper than this share of the height is filled; those of our bowls have 0.6."""
MIDDLE = (0.4, 0.5, 0.6)
"""Shares of the footprint, along each side, at which depth is measured: inside a mug, whichever
side its handle is on."""
Y = 1
"""The archive's axis that points up (not of models that lie)."""


def is_filled(archive: Archive, model: OfficialModel) -> bool:
    """Whether `model` should be hollow and its collision pieces, which are read or taken from the
    cache, close its mouth; False where meshes cannot be read, because trimesh is not installed.

    ArchiveError, in one sentence, for a file that cannot be used.
    """
    if not model.hollow or not reads_meshes():
        return False
    collision = archive.files(model).collision
    if collision is None:
        return False
    return depth(solid_pieces(archive, [MeshUse(collision, np.eye(4))])) <= SHALLOW


def depth(pieces: Sequence[Piece]) -> float:
    """How far the deepest place of the middle lies below the top, as a share of the height."""
    points = np.concatenate([corners for corners, _ in pieces])
    low, high = points.min(axis=0), points.max(axis=0)
    height = max(float(high[Y] - low[Y]), 1e-12)
    places = low + (high - low) * np.array([[a, 0.0, b] for a in MIDDLE for b in MIDDLE])
    tops = np.full(len(places), float(low[Y]))
    for corners, triangles in pieces:
        tops = np.maximum(tops, _tops(corners, triangles, places))
    return (float(high[Y]) - float(tops.min())) / height


def _tops(corners: Floats, triangles: NDArray[np.int64], places: Floats) -> Floats:
    """(P,) height at which vertical lines through `places` (P, 3) leave a convex piece whose
    triangles face outwards; minus infinity where they miss it."""
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    rise = normals[:, Y]
    room = (normals * a).sum(axis=1) - places @ normals.T + np.outer(places[:, Y], rise)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = room / rise
    tiny = 1e-9 * np.abs(normals).max(initial=1e-300)
    upper = np.where(rise > tiny, at, np.inf).min(axis=1)
    lower = np.where(rise < -tiny, at, -np.inf).max(axis=1)
    beside = ((np.abs(rise) <= tiny) & (room < 0)).any(axis=1)
    return np.where(beside | (lower >= upper) | np.isinf(upper), -np.inf, upper)
