"""Scatter: object by object, each at its first candidate that keeps its distance to the others.

All candidates of a layout are drawn at once; a layout that cannot be completed is drawn anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from robospa.geometry import Array
from robospa.tasks.sampling.region import Area, LayoutError, Mask, Points
from robospa.workcell import Workcell

Propose = Callable[[np.random.Generator], tuple[Array, Array, Mask]]
"""Draws candidate positions: x, y and whether each may be used, all of shape (objects, tries)."""


def candidates(
    workcell: Workcell,
    area: Area,
    shape: tuple[int, int],
    radius: Array | float,
    height: Array | float,
    off_middle: float = 0.0,
    also: Callable[[Array, Array], Mask] | None = None,
) -> Propose:
    """Candidates in `area` where the head camera sees whole objects of `radius`, `height` [m].

    `shape` is (objects, tries); |x| is at least `off_middle` [m], and `also` may refuse further.
    """

    def propose(rng: np.random.Generator) -> tuple[Array, Array, Mask]:
        x, y = area.draw(rng, shape)
        usable = (np.abs(x) >= off_middle) & workcell.in_view(x, y, radius, height, (0.0, 0.0))
        return x, y, usable if also is None else usable & also(x, y)

    return propose


def scatter(
    rng: np.random.Generator,
    propose: Propose,
    apart: float | Sequence[Sequence[float]],
    accept: Callable[[Points], bool] = lambda points: True,
    restarts: int = 80,
) -> Points:
    """Free positions, object by object: each takes its first candidate that keeps its distance.

    `apart[i][j]` is the least centre distance [m] of objects i and j, or `apart` that of any two. A
    layout that `accept` refuses is drawn afresh, at most `restarts` times; then LayoutError.
    """
    for _ in range(restarts):
        x, y, usable = propose(rng)
        least = [[apart] * len(x)] * len(x) if isinstance(apart, float) else apart
        points = _place(x, y, usable, least)
        if points is not None and accept(points):
            return points
    raise LayoutError(f"no free layout of {len(x)} objects in {restarts} draws; skip this seed")


def _place(x: Array, y: Array, usable: Mask, apart: Sequence[Sequence[float]]) -> Points | None:
    points: Points = []
    for i, limits in enumerate(apart):
        free = usable[i]
        if points:
            taken, least = np.array(points), np.array(limits[:i])
            dx, dy = x[i] - taken[:, :1], y[i] - taken[:, 1:]
            free = free & (dx * dx + dy * dy >= (least * least)[:, None]).all(axis=0)
        first = int(free.argmax())
        if not free[first]:
            return None
        points.append((float(x[i, first]), float(y[i, first])))
    return points
