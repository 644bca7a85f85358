"""Grids: rows and columns, with jitter of each object or of a whole row or column."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robospa.geometry import Array
from robospa.tasks.sampling.places import LayoutError, Range
from robospa.workcell import Workcell

Cell = tuple[int, int]
"""Column (to the right) and row (away from the robot), counted from 0."""


@dataclass(frozen=True)
class Grid:
    """A grid of a level [m]: pitch, range of its centre, half range of each object's jitter.

    Some official centres let the near row (and the outer columns of four) leave the head image;
    `y` and, with four columns, `pitch_x` are chosen so that every object is seen. `x` is the
    official range; the part of it in which all is in view is used. `radius` and `tall` bound the
    objects for that, `margin` is the part of the image's width that stays free on each side.
    """

    rows: int
    columns: int
    pitch_x: float
    pitch_y: float
    x: tuple[float, float]
    y: tuple[float, float]
    jitter: tuple[float, float]
    radius: float = 0.06
    tall: float = 0.12
    margin: float = 0.02

    def centre_x(self, y: float, workcell: Workcell) -> tuple[float, float]:
        """Where the centre may be when it is at `y`, so that the near row is in view."""
        near = y - (self.rows - 1) / 2 * self.pitch_y - self.jitter[1]
        half = (self.columns - 1) / 2 * self.pitch_x + self.jitter[0]
        footprint = workcell.view_span(near, self.radius, margin=self.margin)
        axis = workcell.view_span(near, 0.0, self.tall, self.margin)
        low = max(self.x[0], footprint[0] + half, axis[0] + half)
        high = min(self.x[1], footprint[1] - half, axis[1] - half)
        if low > high:
            raise ValueError(f"no room in view for {self.columns} columns at y = {y}")
        return low, high

    def places(
        self, rng: np.random.Generator, workcell: Workcell
    ) -> Callable[[int, int], tuple[float, float]]:
        """Centre and jitter of every object, uniform."""
        centre_y = rng.uniform(*self.y)
        centre_x = rng.uniform(*self.centre_x(centre_y, workcell))
        jitter = rng.uniform(-1, 1, (self.rows * self.columns, 2)) * self.jitter

        def place(k: int, cell: int) -> tuple[float, float]:
            row, column = divmod(cell, self.columns)
            x = centre_x + (column - (self.columns - 1) / 2) * self.pitch_x + float(jitter[k, 0])
            y = centre_y + (row - (self.rows - 1) / 2) * self.pitch_y + float(jitter[k, 1])
            return x, y

        return place


DRAWS = 96
"""Grids that are drawn at once; the first that fits is taken."""
BATCHES = 200


@dataclass(frozen=True)
class GapGrid:
    """A grid [m] with drawn pitches that is drawn again until its gaps do.

    `gaps`: least x distance of neighbours in a row and least distance of the means of
    neighbouring rows. `keep_out`: x, y and radius of a disc that holds no object's centre.
    """

    rows: int
    columns: int
    pitch_x: tuple[float, float]
    pitch_y: tuple[float, float]
    x: tuple[float, float]
    y: tuple[float, float]
    jitter_x: float
    jitter_y: tuple[float, float]
    gaps: tuple[float, float]
    keep_out: tuple[float, float, float]
    radius: float
    tall: float

    def places(
        self, rng: np.random.Generator, workcell: Workcell
    ) -> Callable[[int, int], tuple[float, float]]:
        """The first grid that keeps its gaps, uniform among those that do; LayoutError if none."""
        for _ in range(BATCHES):
            x, y = self._drawn(rng)
            good = np.flatnonzero(self._fits(x, y, workcell))
            if len(good):
                xs, ys = x[good[0]].ravel().tolist(), y[good[0]].ravel().tolist()
                return lambda k, cell: (xs[cell], ys[cell])
        raise LayoutError(f"no grid fits in {BATCHES * DRAWS} draws; skip this seed")

    def _drawn(self, rng: np.random.Generator) -> tuple[Array, Array]:
        shape = (DRAWS, self.rows, self.columns)
        pitch_x, pitch_y, centre_x, centre_y = (
            rng.uniform(low, high, (DRAWS, 1, 1))
            for low, high in (self.pitch_x, self.pitch_y, self.x, self.y)
        )
        column = np.arange(self.columns) - (self.columns - 1) / 2
        row = (np.arange(self.rows) - (self.rows - 1) / 2)[:, None]
        x = centre_x + column * pitch_x + rng.uniform(-self.jitter_x, self.jitter_x, shape)
        y = centre_y + row * pitch_y + rng.uniform(*self.jitter_y, shape)
        return x, y

    def _fits(self, x: Array, y: Array, workcell: Workcell) -> Array:
        free = np.hypot(x - self.keep_out[0], y - self.keep_out[1]) >= self.keep_out[2]
        seen = workcell.in_view(x, y, self.radius) & workcell.in_view(x, y, 0.0, self.tall)
        every = (free & seen & workcell.in_reach(x, y)).all(axis=(1, 2))
        columns = (np.diff(x, axis=2) >= self.gaps[0]).all(axis=(1, 2))
        rows = (np.diff(y.mean(axis=2), axis=1) >= self.gaps[1]).all(axis=1)
        return np.asarray(every & columns & rows)


LINE_DRAWS = 200


@dataclass(frozen=True)
class StraightLines:
    """Straight columns and rows [m], each with a jitter of its own, at a drawn pitch and place.

    `pitch` are ranges of the distances of columns and of rows, `gap` their least distances; all
    lie in the rectangle `x`, `y`.
    """

    pitch: tuple[Range, Range]
    jitter: tuple[float, float]
    gap: tuple[float, float]
    x: Range
    y: Range

    def places(
        self,
        rng: np.random.Generator,
        used: Sequence[Cell],
        least: Array,
        seen: Callable[[Array], bool],
    ) -> Array:
        """Where the used cells lie, (count, 2) [m]; LayoutError if nothing fits.

        `least[i, j]` is the least distance of two of them, `seen` may refuse a layout.
        """
        columns, rows = sorted({c for c, _ in used}), sorted({r for _, r in used})
        for _ in range(LINE_DRAWS):
            px, py = (rng.uniform(*pitch) for pitch in self.pitch)
            shift_x = rng.uniform(-self.jitter[0], self.jitter[0], len(columns))
            shift_y = rng.uniform(-self.jitter[1], self.jitter[1], len(rows))
            cx = {c: c * px + float(s) for c, s in zip(columns, shift_x, strict=True)}
            cy = {r: r * py + float(s) for r, s in zip(rows, shift_y, strict=True)}
            xs, ys = sorted(cx.values()), sorted(cy.values())
            room_x, room_y = self.x[1] - self.x[0], self.y[1] - self.y[0]
            if xs[-1] - xs[0] > room_x or ys[-1] - ys[0] > room_y:
                continue
            anchor_x = rng.uniform(self.x[0] - xs[0], self.x[1] - xs[-1])
            anchor_y = rng.uniform(self.y[0] - ys[0], self.y[1] - ys[-1])
            if any(
                b - a < gap
                for values, gap in zip((xs, ys), self.gap, strict=True)
                for a, b in pairwise(values)
            ):
                continue
            points = np.array([(cx[c] + anchor_x, cy[r] + anchor_y) for c, r in used])
            if (np.hypot(*(points[:, None] - points).T) >= least).all() and seen(points):
                return points
        raise LayoutError(
            f"no grid of {len(used)} objects fits in {LINE_DRAWS} draws; skip this seed"
        )
