"""Smooth edges of pictures, as with four samples a pixel, from the pixels alone.

Morphological antialiasing (A. Reshetov, HPG 2009): an edge that is not along rows or columns comes
out as a staircase. Where a step of one pixel begins and ends a run of edge pixels, a straight line
joins the middles of both steps; each pixel on it takes so much of its neighbour's colour as lies
beyond the line. Corners have longer steps and stay sharp. In whole numbers and only where there are
edges: the same on every machine, and a tenth of what four samples a pixel cost a CPU.
"""

import numpy as np
from numpy.typing import NDArray

CONTRAST = 32
"""Levels of 255 by which a colour must differ from its neighbour's to be an edge."""
WHOLE, ALONE = 256, 16
"""Shares are of WHOLE; a run of one pixel gives ALONE, less than the line would: its neighbour of
the other direction gives as much again."""

Bytes = NDArray[np.uint8]
Edges = NDArray[np.bool_]
Places = NDArray[np.intp]


class Smoother:
    """For pictures (height, width, 4) that are `count` of equal width beside each other."""

    def __init__(self, height: int, width: int, count: int) -> None:
        self._height, self._width, self._single = height, width, width // count
        pixels = height * width
        self._larger, self._smaller, self._after = np.empty((3, 4 * pixels), dtype=np.uint8)
        self._far = np.empty(4 * pixels, dtype=bool)
        # Edges to the right of and below each pixel; two more rows, because runs look around.
        self._right, self._below = np.zeros((2, pixels + 2 * width), dtype=bool)

    def __call__(self, picture: Bytes) -> Bytes:
        """The picture smoothed, in memory that the next one takes again."""
        flat, width = picture.reshape(-1), self._width
        self._find(flat, 1, self._right)
        self._find(flat, width, self._below)
        right, below = (
            edges[: -2 * width].reshape(self._height, width) for edges in (self._right, self._below)
        )
        right[[0, -1]] = below[-1] = False
        for left in range(0, width, self._single):
            right[:, left + self._single - 1] = False
            below[:, [left, left + self._single - 1]] = False
        self._after[:] = flat
        self._blend(flat.view(np.uint32), self._below, self._right, 1, width)
        self._blend(flat.view(np.uint32), self._right, self._below, width, 1)
        return self._after.reshape(picture.shape)

    def _find(self, flat: Bytes, step: int, edges: Edges) -> None:
        here, there = flat[: -4 * step], flat[4 * step :]
        larger, smaller, far = (
            kept[: len(here)] for kept in (self._larger, self._smaller, self._far)
        )
        np.maximum(here, there, out=larger)
        np.minimum(here, there, out=smaller)
        np.subtract(larger, smaller, out=larger)
        np.greater(larger, CONTRAST, out=far)
        self._far[len(here) :] = False
        np.not_equal(self._far.view(np.uint32), 0, out=edges[: len(flat) // 4])

    def _blend(
        self, colors: NDArray[np.uint32], edges: Edges, steps: Edges, along: int, over: int
    ) -> None:
        """Draw the lines of runs of edges, whose pixels are `along` apart, to those `over`."""
        first = np.flatnonzero(edges[along:] > edges[:-along]) + along
        last = np.flatnonzero(edges[:-along] > edges[along:])
        if along > 1:
            first, last = self._by_column(first), self._by_column(last)

        def step(at: Places, outside: Places) -> NDArray[np.int8]:
            """1 if the edge goes on a pixel further on this side, -1 if beyond, else 0."""
            near = steps[at] & ~steps[at - over] & edges[outside - over]
            beyond = steps[at + over] & ~steps[at + 2 * over] & edges[outside + over]
            return near.view(np.int8) - beyond.view(np.int8)

        after = self._after.reshape(-1, 4)
        begins, ends = step(first - along, first - along), step(last, last + along)
        length = (last - first) // along + 1
        wanted = np.flatnonzero((begins | ends) & ~((length == 1) & (begins == ends)))
        begins, ends = begins[wanted], ends[wanted]
        first, length = first[wanted], length[wanted]
        run = np.repeat(np.arange(len(length)), length)
        whole, index = length[run], np.arange(len(run)) - (np.cumsum(length) - length)[run]
        here = first[run] + index * along
        rest = whole - 1 - 2 * index  # twice as far as the middle of the run
        side = np.where(rest > 0, begins[run], ends[run])
        share = np.where(whole == 1, ALONE, np.abs(rest) * (WHOLE // 2) // whole)
        for way, to, of in ((1, here, here + over), (-1, here + over, here)):
            taken = np.flatnonzero(
                ((side == way) | (whole == 1) & (begins[run] == way)) & (share > 0)
            )
            to, of = to[taken], of[taken]
            old, new = (
                colors[at].view(np.uint8).reshape(-1, 4).astype(np.int32) for at in (to, of)
            )
            after[to] += ((new - old) * share[taken, None] // WHOLE).astype(np.uint8)

    def _by_column(self, at: Places) -> Places:
        """Ends of runs in the order of columns, in which first and last belong together."""
        order: Places = np.sort(at % self._width * self._height + at // self._width)
        rows: Places = order % self._height
        return rows * self._width + order // self._height
