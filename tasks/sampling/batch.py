"""Whole layouts: thousands are drawn at once from a pool of places, the first good one is taken."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robospa.tasks.sampling.region import Area, LayoutError, Point, Points
from robospa.workcell import Workcell

POOL, LAYOUTS, POOLS = 256, 2048, 40
"""Places drawn at once, layouts made of them, and how often at most."""


@dataclass(frozen=True)
class Ground:
    """Where blocks may lie: in `area`, |x| at least `off_middle` [m].

    And at least `free` [m] from the point `middle` [m] of the near edge.
    """

    area: Area
    off_middle: float
    middle: Point
    free: float


def scatter_blocks(
    rng: np.random.Generator,
    workcell: Workcell,
    ground: Ground,
    halves: Sequence[Sequence[float]],
    gaps: Callable[[int, int], float],
    accept: Callable[[Points], bool] = lambda points: True,
) -> list[Point]:
    """A place [m] for a block of each half sizes [m], seen whole by the head camera.

    `gaps(i, j)` is the least distance [m] of two blocks. Many layouts are drawn at once from a pool
    of usable places, and the first that keeps the distances and that `accept` takes is used, so
    every such layout is equally likely. LayoutError if there is none in a bounded number.
    """
    count = len(halves)
    reach = max(math.hypot(*half[:2]) for half in halves)  # the same for all: places tell nothing
    height = 2 * max(half[2] for half in halves)
    pairs = list(itertools.combinations(range(count), 2))
    for _ in range(POOLS):
        x, y = ground.area.draw(rng, (POOL,))
        mx, my = ground.middle
        usable = (np.abs(x) >= ground.off_middle) & (np.hypot(x - mx, y - my) >= ground.free)
        usable &= workcell.in_view(x, y, reach, height, (0.0, 0.0))
        x, y = x[usable], y[usable]
        drawn = rng.integers(len(x), size=(LAYOUTS, count)).T
        xs, ys = x[drawn], y[drawn]  # a row a block, a column a layout
        for i, j in pairs:
            free = (xs[i] - xs[j]) ** 2 + (ys[i] - ys[j]) ** 2 >= gaps(i, j) ** 2
            xs, ys = xs[:, free], ys[:, free]
        for px, py in zip(xs.T.tolist(), ys.T.tolist(), strict=True):
            points = list(zip(px, py, strict=True))
            if accept(points):
                return points
    raise LayoutError(f"no free layout of {count} blocks in {POOLS * LAYOUTS} draws; skip the seed")
