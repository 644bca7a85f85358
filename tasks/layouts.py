"""Where things may lie: the head camera's view, the arms' reach, free scatter and grids.

Everything is closed form or bounded in work: a draw looks at a fixed number of candidate
positions and raises `LayoutError` when none will do, so building a scene always takes
milliseconds. Positions are metres in the world frame. Nothing here knows a simulator or a task.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Array
from robospa.workcell import TABLE_TOP

Mask = NDArray[np.bool_]

EYE = (-0.032, -0.45, 1.35)
"""Position of the head camera [m]; it looks along (0, 0.6, -0.8), its left is -x."""
FOCAL = 120 / math.tan(math.radians(37) / 2)
"""Focal length of the head camera [px] at 320x240 with a vertical field of view of 37 deg."""
WIDTH, HEIGHT = 320, 240

BASES = ((-0.3, -0.417), (0.3, -0.417))
"""Where the left and right arm stand on the plan [m]."""
MAX_REACH = 0.69
"""Farthest planar distance [m] from an arm's base at which a tilted grasp still gets there."""


class LayoutError(RuntimeError):
    """No layout was found within the allowed work: this seed is not valid."""


def head_pixel(x: Array, y: Array, z: Array | float) -> tuple[Array, Array]:
    """Pixel (u to the right, v down) of points [m] in the head camera's 320x240 image."""
    return _column(x, y, z), _row(y, z)


def _column(x: Array, y: Array, z: Array | float) -> Array:
    return WIDTH / 2 + FOCAL * (x - EYE[0]) / (0.6 * (y - EYE[1]) - 0.8 * (z - EYE[2]))


def _row(y: Array, z: Array | float) -> Array:
    dy, dz = y - EYE[1], z - EYE[2]
    return HEIGHT / 2 - FOCAL * (0.8 * dy + 0.6 * dz) / (0.6 * dy - 0.8 * dz)


def in_head_view(
    x: Array,
    y: Array,
    radius: Array | float = 0.0,
    height: Array | float = 0.0,
    margin: tuple[float, float] = (0.02, 0.02),
) -> Mask:
    """Whether upright cylinders on the table lie inside the head image, as a boolean array.

    `radius` and `height` [m] bound each object; `margin` is the part of the image's width and
    height that stays free on each side.
    """
    low, high = TABLE_TOP, TABLE_TOP + height
    left, right = _column(x - radius, y, high), _column(x + radius, y, high)
    top, bottom = _row(y + radius, high), _row(y - radius, low)
    free_x, free_y = margin[0] * WIDTH, margin[1] * HEIGHT
    inside: Mask = (
        (left >= free_x) & (right <= WIDTH - free_x) & (top >= free_y) & (bottom <= HEIGHT - free_y)
    )
    return inside


def view_span(
    y: float, radius: float = 0.0, height: float = 0.0, margin: float = 0.02
) -> tuple[float, float]:
    """The x range [m] in which a cylinder of this `radius` and `height` at `y` is in view."""
    depth = 0.6 * (y - EYE[1]) + 0.8 * (EYE[2] - TABLE_TOP - height)
    half = (0.5 - margin) * WIDTH / FOCAL * depth - radius
    return EYE[0] - half, EYE[0] + half


def in_reach(x: Array, y: Array) -> Mask:
    """Whether the nearer arm can grasp at these places, as a boolean array."""
    near = [np.hypot(x - bx, y - by) for bx, by in BASES]
    reached: Mask = np.minimum(near[0], near[1]) <= MAX_REACH
    return reached


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
