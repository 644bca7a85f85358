"""Colours of blocks that tasks name; a task uses the first few (official tables)."""

from __future__ import annotations

from robospa.tasks.shapes import Color

COLORS: dict[str, Color] = {
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
    "yellow": (1.0, 1.0, 0.0),
    "cyan": (0.0, 1.0, 1.0),
    "magenta": (1.0, 0.0, 1.0),
    "orange": (1.0, 0.5, 0.0),
    "purple": (0.5, 0.0, 0.5),
    "white": (1.0, 1.0, 1.0),
    "black": (0.1, 0.1, 0.1),
    "brown": (0.6, 0.3, 0.1),
    "pink": (1.0, 0.75, 0.8),
}
"""Linear RGB by word."""


def first_colors(count: int) -> dict[str, Color]:
    """The first `count` of COLORS."""
    return dict(list(COLORS.items())[:count])
