"""Colours of blocks: those that tasks name, and those that are drawn."""

from __future__ import annotations

import numpy as np

from robospa.tasks.colors import NAMED, stands_out
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.shapes import Color

COLORS: dict[str, Color] = {
    word: NAMED[word]
    for word in (
        *("red", "green", "blue", "yellow", "cyan", "magenta"),
        *("orange", "purple", "white", "black", "brown", "pink"),
    )
}
"""Linear RGB by word; a task uses the first few (official order)."""

TRIES = 60


def first_colors(count: int) -> dict[str, Color]:
    """The first `count` of COLORS."""
    return dict(list(COLORS.items())[:count])


def drawn_color(rng: np.random.Generator, low: float = 0.0, high: float = 1.0) -> list[float]:
    """A random linear RGB that is not the table's, each part uniform in `low`..`high`.

    LayoutError if 60 draws are like the table, which happens to none of 10^60 scenes.
    """
    for _ in range(TRIES):
        r, g, b = (round(float(c), 4) for c in rng.uniform(low, high, 3))
        if stands_out((r, g, b)):
            return [r, g, b]
    raise LayoutError(f"{TRIES} random colours all looked like the table; skip this seed")
