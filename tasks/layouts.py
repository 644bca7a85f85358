"""Where things may lie: areas of the table and free scatter.

Everything is closed form or bounded in work: a draw looks at a fixed number of candidate
positions and raises `LayoutError` when none will do, so building a scene always takes
milliseconds. Positions are metres in the world frame. Nothing here knows a simulator or a task.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Array

Mask = NDArray[np.bool_]


class LayoutError(RuntimeError):
    """No layout was found within the allowed work: this seed is not valid."""


@dataclass(frozen=True)
class Area:
    """A rectangle on the table: `x` and `y` ranges [m].

    `clear_middle` keeps y <= 0 where |x| < 0.15, as the official scenes do.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    clear_middle: bool = False

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> tuple[Array, Array]:
        """Uniform positions of this shape; y is uniform on what is allowed at its x."""
        x = rng.uniform(self.x[0], self.x[1], shape)
        top: Array | float = self.y[1]
        if self.clear_middle:
            top = np.where(np.abs(x) < 0.15, min(0.0, self.y[1]), self.y[1])
        y = self.y[0] + (top - self.y[0]) * rng.random(shape)
        return x, y


Points = list[tuple[float, float]]
Propose = Callable[[np.random.Generator], tuple[Array, Array, Mask]]
"""Draws candidate positions: x, y and whether each may be used, all of shape (objects, tries)."""


def scatter(
    rng: np.random.Generator,
    propose: Propose,
    apart: Sequence[Sequence[float]],
    accept: Callable[[Points], bool] = lambda points: True,
    restarts: int = 80,
) -> Points:
    """Free positions, object by object: each takes its first candidate that keeps its distance.

    `apart[i][j]` is the least centre distance [m] of objects i and j. A layout that `accept`
    refuses is drawn afresh, at most `restarts` times; then LayoutError.
    """
    for _ in range(restarts):
        x, y, usable = propose(rng)
        points = _place(x, y, usable, apart)
        if points is not None and accept(points):
            return points
    raise LayoutError(f"no free layout of {len(apart)} objects in {restarts} draws; skip this seed")


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


def spread(values: Sequence[float]) -> float:
    """Largest minus smallest value."""
    return max(values) - min(values)
