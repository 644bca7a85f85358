"""Where a model of the archive can be held: at its contact points and as its built-in likeness.

A contact point's z axis is the direction in which the gripper advances, its x axis that in which
the fingers close. How wide a part is there is measured on the convex pieces.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Vec3
from robospa.harness.packs.model_data import ModelData
from robospa.harness.packs.placing import Likeness, Placing
from robospa.tasks.objects.build import MAX_WIDTH
from robospa.tasks.official import OfficialModel
from robospa.tasks.shapes import Grasp, ObjectModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Piece = tuple[Floats, Ints]

UPWARDS = -0.2
"""A gripper comes from above: its approach's z is no larger."""
DEPTHS = (-0.004, 0.0, 0.004)
"""Along the approach, where a width is measured [m]."""
REACH = 0.012
"""How far from the line between the fingertips a part may begin [m]."""
TILT = 0.4
"""How far an approach at a contact point may be turned about the closing direction [rad]."""


def grasps(
    pieces: Sequence[Piece],
    builtin: ObjectModel,
    likeness: Likeness,
    placing: Placing,
    data: ModelData,
    model: OfficialModel,
) -> tuple[Grasp, ...]:
    """All that fingers fit around; `pieces` are in the body frame [m]."""
    planes = [_planes(*piece) for piece in pieces]
    found = []
    for grasp in builtin.grasps:
        found.append((likeness.point(grasp.point), grasp.approach, grasp.closing, grasp.tilt))
    used = {point for point in model.points.values() if point.startswith("contact")}
    for number, frame in enumerate(data.contact):
        if f"contact {number}" in used:
            continue
        x, y, z = placing.points(frame[None, :3, 3])[0].tolist()
        closing, approach = (_unit(placing.turn @ frame[:3, k]) for k in (0, 2))
        if approach[2] <= UPWARDS:
            found.append(((x, y, z), approach, closing, TILT))
    made = []
    for point, approach, closing, tilt in found:
        held = _between(planes, np.array(point), np.array(approach), np.array(closing))
        if held is None or not 1e-3 < held[1] <= MAX_WIDTH:
            continue
        x, y, z = (np.array(point) + held[0] * np.array(closing)).tolist()
        made.append(Grasp((x, y, z), approach, closing, held[1], tilt))
    return tuple(dict.fromkeys(made))


def _unit(vector: Floats) -> Vec3:
    x, y, z = (vector / max(float(np.linalg.norm(vector)), 1e-9)).tolist()
    return (x, y, z)


def _planes(corners: Floats, triangles: Ints) -> tuple[Floats, Floats]:
    """Unit normals (T, 3) outwards and offsets (T,) [m] of a convex piece's faces."""
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-15)[:, None]
    return normals, (normals * a).sum(axis=1)


def _between(
    planes: Sequence[tuple[Floats, Floats]], point: Floats, approach: Floats, closing: Floats
) -> tuple[float, float] | None:
    """Middle and width [m], along `closing` from `point`, of the part between the fingertips.

    None if there is nothing. Parts that touch or overlap along the line are one.
    """
    spans = []
    for depth in DEPTHS:
        start = point + depth * approach
        for normals, offsets in planes:
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
    low, high = 0.0, 0.0
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
