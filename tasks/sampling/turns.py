"""Turns of objects whose places are fixed: drawn so that no two touch and all is in view.

Footprints are convex outlines, not circles: long things lie close beside others at the official
distances, as long as they do not point at them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from robospa.geometry import Array
from robospa.tasks.objects import object_model
from robospa.tasks.objects.build import points_of
from robospa.tasks.sampling.places import LAYOUTS, Drawn, LayoutError, Mask
from robospa.tasks.scene import SceneObject
from robospa.tasks.shapes import Params
from robospa.workcell import Workcell

FINE = 720
"""Directions in which an outline's reach is tabulated."""
COARSE = 36
"""Directions in which two outlines are looked at for a gap between them."""
_ANGLES = 2 * math.pi * np.arange(COARSE) / COARSE
AHEAD = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
CLEAR = 0.002
"""Outlines stay this far apart [m]."""
MARGIN = (0.02, 0.02)
"""Shares of the head image's width and height within which spatial scenes have nothing."""
TURNS, ROUNDS = 24, 4
"""Turns that are looked at for an object, and how often all are drawn anew."""


@dataclass(frozen=True)
class Turnable:
    """An object at a place [m] that may be turned by up to `half_range` [rad] either way."""

    asset: str
    params: Params
    place: tuple[float, float]
    half_range: float = math.pi


@dataclass(frozen=True)
class Outline:
    """A footprint seen from the object's origin, and the directions in which fingers close.

    `reach` (FINE,) [m] is how far it extends in each direction; `corners` (n, 2) [m] are points of
    its hull, `closings` (g, 2) the level part of the grasps' closing directions.
    """

    reach: Array
    corners: Array
    closings: Array
    radius: float
    height: float


def outline(asset: str, params: Params) -> Outline:
    """The outline of an asset. Its size must not depend on other parameters than the look."""
    if asset == "block":
        return _outline(asset, half=tuple(params["half"]))
    return _outline(asset, look=params.get("look", 0))


@cache
def _outline(asset: str, **params: int | tuple[float, ...]) -> Outline:
    model = object_model(asset, params)
    points = np.concatenate([points_of(shape)[:, :2] for shape in model.shapes])
    angles = 2 * math.pi * np.arange(FINE) / FINE
    along = points @ np.stack([np.cos(angles), np.sin(angles)])
    farthest = along.argmax(axis=0)
    closings = np.array([g.closing[:2] for g in model.grasps]).reshape(-1, 2)
    corners = points[np.unique(farthest[:: FINE // COARSE])]
    return Outline(along.max(axis=0), corners, closings, model.radius, model.size[2])


def free_turns(
    rng: np.random.Generator,
    workcell: Workcell,
    items: Sequence[Turnable],
    margin: tuple[float, float] = (0.0, 0.0),
) -> list[float]:
    """Yaws [rad] of `items`: uniform among those that leave all clear, seen and graspable.

    Whole objects are in the head image, `margin` (shares of its width and height) inside. Far from
    the robot one of an object's grasps closes sideways, as near to the x axis as the robot needs it
    there; the rule holds for every object, so it tells nothing about a target. LayoutError if some
    object finds no turn.
    """
    outlines = [outline(i.asset, i.params) for i in items]
    order = sorted(range(len(items)), key=lambda k: -outlines[k].radius)
    for _ in range(ROUNDS):
        found = _round(rng, workcell, items, outlines, order, margin)
        if found is not None:
            return found
    raise LayoutError(f"{len(items)} objects find no turns side by side; skip this seed")


def turned(
    rng: np.random.Generator,
    workcell: Workcell,
    draw: Callable[[], tuple[Drawn, Sequence[Turnable]]],
    margin: tuple[float, float] = (0.0, 0.0),
    tries: int = LAYOUTS,
) -> tuple[Drawn, Sequence[Turnable], list[float]]:
    """What `draw` gives, its things, and their `free_turns`, in the first of `tries` draws.

    LayoutError if there are turns for none.
    """
    for _ in range(tries):
        found, items = draw()
        try:
            return found, items, free_turns(rng, workcell, items, margin)
        except LayoutError:
            continue
    raise LayoutError(f"no free layout of {len(items)} objects in {tries} draws; skip this seed")


def _round(
    rng: np.random.Generator,
    workcell: Workcell,
    items: Sequence[Turnable],
    outlines: Sequence[Outline],
    order: Sequence[int],
    margin: tuple[float, float],
) -> list[float] | None:
    """One try: object by object, the first turn that is free; None if one has none."""
    yaws = [0.0] * len(items)
    done: list[int] = []
    steps = np.arange(COARSE) * (FINE // COARSE)
    for k in order:
        item, shape = items[k], outlines[k]
        turns = rng.uniform(-item.half_range, item.half_range, TURNS)
        good = _graspable(workcell, shape, turns, item.place[1])
        good &= _seen(workcell, shape, turns, item.place, margin)
        shift = np.round(turns * FINE / (2 * math.pi)).astype(int)
        own = shape.reach[(steps - shift[:, None]) % FINE]
        for j in done:
            apart = np.subtract(item.place, items[j].place)
            if apart @ apart > (shape.radius + outlines[j].radius + CLEAR) ** 2:
                continue
            theirs = _reaches(outlines[j], yaws[j])
            facing = np.roll(own, COARSE // 2, axis=1)  # how far this one reaches back
            good &= (apart @ AHEAD - theirs - facing).max(axis=1) >= CLEAR
        if not good.any():
            return None
        yaws[k] = float(turns[int(good.argmax())])
        done.append(k)
    return yaws


def free_beside(
    workcell: Workcell,
    item: Turnable,
    yaw: float,
    others: Sequence[tuple[Turnable, float]],
    gap: float = CLEAR,
) -> bool:
    """Whether `item`, turned by `yaw` [rad], is whole in view and `gap` [m] from the others."""
    shape = outline(item.asset, item.params)
    if not _seen(workcell, shape, np.array([yaw]), item.place, (0.0, 0.0))[0]:
        return False
    return all(between((item, yaw), other) >= gap for other in others)


def usable(workcell: Workcell, item: SceneObject) -> bool:
    """Whether an upright object is whole in view, in reach, and graspable where it is."""
    shape = outline(item.asset, item.params)
    (x, y, _), (w, *_, z) = item.pose.position, item.pose.rotation
    turn = np.array([2 * math.atan2(z, w)])
    well = _seen(workcell, shape, turn, (x, y), MARGIN) & _graspable(workcell, shape, turn, y)
    return bool((well & workcell.in_reach(np.array(x), np.array(y)))[0])


def between(one: tuple[Turnable, float], other: tuple[Turnable, float]) -> float:
    """Width [m] of the gap between two turned objects, negative if they overlap."""
    (a, yaw_a), (b, yaw_b) = one, other
    away = np.subtract(a.place, b.place) @ AHEAD
    theirs = _reaches(outline(b.asset, b.params), yaw_b)
    back = np.roll(_reaches(outline(a.asset, a.params), yaw_a), COARSE // 2)
    return float((away - theirs - back).max())


def _reaches(shape: Outline, yaw: float) -> Array:
    """How far an outline turned by `yaw` [rad] extends along AHEAD [m], (COARSE,)."""
    shift = round(yaw * FINE / (2 * math.pi))
    return shape.reach[(np.arange(COARSE) * (FINE // COARSE) - shift) % FINE]


def _graspable(workcell: Workcell, shape: Outline, turns: Array, y: float) -> Mask:
    """Whether some grasp closes as the robot needs it at `y`, for each of `turns` [rad]."""
    if y <= workcell.sideways_from or not len(shape.closings):
        return np.ones(len(turns), dtype=bool)
    x_part = np.abs(np.outer(np.cos(turns), shape.closings[:, 0])
                    - np.outer(np.sin(turns), shape.closings[:, 1]))  # fmt: skip
    fits: Mask = (x_part >= math.cos(workcell.sideways_within)).any(axis=1)
    return fits


def _seen(
    workcell: Workcell,
    shape: Outline,
    turns: Array,
    place: tuple[float, float],
    margin: tuple[float, float],
) -> Mask:
    """Whether the head image holds all corners of the underside, and the axis at the top."""
    top_x, top_y = (np.array(c) for c in place)
    if not workcell.in_view(top_x, top_y, 0.0, shape.height, margin):
        return np.zeros(len(turns), dtype=bool)
    cos, sin = np.cos(turns)[:, None], np.sin(turns)[:, None]
    x = place[0] + cos * shape.corners[:, 0] - sin * shape.corners[:, 1]
    y = place[1] + sin * shape.corners[:, 0] + cos * shape.corners[:, 1]
    seen: Mask = workcell.in_view(x, y, 0.0, 0.0, margin)
    return np.asarray(seen.all(axis=1))
