"""Pick Mixed Objects Distance B (SDE): pick the k-th farthest object from a named reference.

One object each of the first n categories lies on the table. The reference is named, the target
is not: it is the k-th farthest from the reference, clearly so (its distance differs from the
neighbouring ranks' by at least 58 mm), with k uniform over the n - 1 ranks.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from robospa.tasks.geometry import Array
from robospa.tasks.goals.pick import Lift
from robospa.tasks.instructions import words_spatial
from robospa.tasks.instructions.words import Slots
from robospa.tasks.layouts import Mask, in_head_view
from robospa.tasks.objects import object_model
from robospa.tasks.packing import Fits, apart, pool, walk
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import Draft, Level, Task
from robospa.tasks.variants.picking import drawn_yaw, lifted, pick_target
from robospa.tasks.variants.tabletop import draw_look, look_phrasings, standing

ASSETS = ("tea_box", "sauce_can", "bowl", "toycar", "fan", "tissue_box", "french_fries")
"""Level k uses the first k + 2."""
REGION = ((-0.22, 0.22), (-0.18, 0.08))
"""x and y range [m] of the origins."""
APART = {1: 0.158, 2: 0.158, 3: 0.158, 4: 0.158, 5: 0.161}
"""Least distance of two origins [m]."""
RANK_GAP = 0.058
"""The target's distance differs from those of the ranks beside it by at least this [m]."""
RADIUS, TALL = 0.065, 0.12
"""Bounds of the objects' footprint and height [m], for the view."""
PACKED = (
    (-0.218, -0.174), (-0.018, -0.174), (0.182, -0.174), (-0.118, -0.047),
    (0.082, -0.047), (-0.218, 0.08), (-0.018, 0.08), (0.182, 0.08),
)  # fmt: skip
"""Eight places of the region that keep every level's distance: where the layout pool starts."""
CHAINS = 256
"""Random walks that make up the pool; each gives eight layouts."""
SHIFT = 0.02
"""A layout's places are moved once more by up to this [m] in each trial, where there is room."""


@dataclass(frozen=True)
class Choices:
    """Layouts (count, n, 2) and, per rank, which (layout, reference place) make it a clear one."""

    layouts: Array
    by_rank: tuple[NDArray[np.intp], ...]


def allowed(x: Array, y: Array) -> Mask:
    """Whether origins are in the region, with the footprint and the object's axis in view."""
    (left, right), (near, far) = REGION
    inside = (x >= left) & (x <= right) & (y >= near) & (y <= far)
    return inside & in_head_view(x, y, RADIUS, 0.0) & in_head_view(x, y, 0.0, TALL)


def fits(level: int) -> Fits:
    """The rule of the level's layouts."""
    return lambda points, wanted, i: (
        allowed(wanted[:, 0], wanted[:, 1]) & apart(points, wanted, i, APART[level])
    )


@cache
def choices(level: int) -> Choices:
    """The level's layout pool, sorted by the ranks it can ask for."""
    count = LEVELS[level].candidates
    rng = np.random.Generator(np.random.PCG64(level))
    subsets = np.argsort(rng.random((CHAINS, len(PACKED))), axis=1)[:, :count]
    layouts = np.concatenate(pool(np.array(PACKED)[subsets], fits(level)))
    delta = layouts[:, :, None] - layouts[:, None]
    # The reference itself is last, at distance 0.
    ranked = -np.sort(-np.sqrt((delta**2).sum(axis=-1)), axis=2)[:, :, :-1]
    clear = ranked[:, :, :-1] - ranked[:, :, 1:] >= RANK_GAP
    edge = np.ones((*clear.shape[:2], 1), dtype=bool)
    eligible = np.concatenate([edge, clear], axis=2) & np.concatenate([clear, edge], axis=2)
    pairs = (np.stack(np.nonzero(eligible[:, :, k]), axis=1) for k in range(count - 1))
    return Choices(layouts, tuple(pairs))


def by_distance(points: Array, reference: int) -> list[tuple[float, int]]:
    """(distance [m], place) of all places but `reference`, farthest first."""
    x, y = points[reference].tolist()
    found = [
        (math.sqrt((px - x) ** 2 + (py - y) ** 2), i)
        for i, (px, py) in enumerate(points.tolist())
        if i != reference
    ]
    return sorted(found, reverse=True)


def is_clear(points: Array, reference: int, rank: int) -> bool:
    """Whether the distance of rank `rank` (from 1) is clear of its neighbours'."""
    ranked = [d for d, _ in by_distance(points, reference)]
    around = ranked[max(0, rank - 2) : rank + 1]
    return all(a - b >= RANK_GAP for a, b in itertools.pairwise(around))


def draw(level: int, rng: np.random.Generator) -> Draft:
    """A uniform rank, a layout and reference place at which it is clear, then what lies where."""
    count = LEVELS[level].candidates
    rank = int(rng.integers(count - 1)) + 1
    found = choices(level)
    pairs = found.by_rank[rank - 1]
    layout, reference = (int(v) for v in pairs[int(rng.integers(len(pairs)))])
    points = found.layouts[layout]
    shifted = points[None].copy()
    walk(rng, shifted, fits(level), SHIFT)
    if is_clear(shifted[0], reference, rank):
        points = shifted[0]
    target = by_distance(points, reference)[rank - 1][1]
    assets = [ASSETS[int(i)] for i in rng.permutation(count)]
    order = [int(i) for i in rng.permutation(count)]
    objects = []
    for k, i in enumerate(order):
        x, y = points[i].tolist()
        look = draw_look(rng, assets[i])
        yaw = drawn_yaw(rng, assets[i], look, y, math.pi / 2)
        objects.append(SceneObject(f"object_{k}", assets[i], standing((x, y), yaw), look))
    facts = {
        "target": f"object_{order.index(target)}",
        "reference": f"object_{order.index(reference)}",
        "distance_rank": rank,
    }
    return Draft(tuple(objects), facts)


def slots(scene: Scene) -> Slots:
    """What the instruction says: the rank and the reference."""
    reference = scene.object(str(scene.facts["reference"]))
    names = look_phrasings(object_model(reference.asset, reference.params))
    return words_spatial.distance(int(scene.facts["distance_rank"]), reference.asset, names)


LEVELS: Mapping[int, Level] = {k: Level(k + 2, 1, 150) for k in range(1, 6)}

TASK = Task(
    name="Pick_Mixed_Objects_Distance_B",
    category="SDE",
    levels=LEVELS,
    draw=draw,
    goal=lifted(Lift(above=0.82)),
    plan=pick_target,
    slots=slots,
    summary="Pick the k-th farthest of 3 to 7 different objects from a named one.",
    success="the target's origin is higher than 0.82 m while a gripper carries it",
)
