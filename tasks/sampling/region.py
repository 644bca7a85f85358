"""What all samplers share: areas, points, distances, and the error of a seed that has no layout."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Array

Mask = NDArray[np.bool_]
Point = tuple[float, float]
Points = list[Point]
Range = tuple[float, float]
Drawn = TypeVar("Drawn")


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


def apart(point: Point, others: Iterable[Point], distance: float) -> bool:
    """Whether `point` is at least `distance` [m] from all `others`."""
    x, y = point
    for ox, oy in others:  # noqa: SIM110 - crowded layouts ask thousands of times
        if math.hypot(x - ox, y - oy) < distance:
            return False
    return True


def spread(values: Sequence[float]) -> float:
    """Largest minus smallest value."""
    return max(values) - min(values)


def shuffled(rng: np.random.Generator, items: Sequence[Drawn]) -> list[Drawn]:
    """The items in random order: who was placed first had more places to choose from."""
    return [items[int(i)] for i in rng.permutation(len(items))]
