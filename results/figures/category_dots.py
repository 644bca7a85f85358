"""The success rate of every category as dots with intervals: a line a category, a panel a level."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from robospa.categories import CATEGORIES
from robospa.results.figures.series import (
    COLOURS,
    MARKERS,
    Series,
    legend_below,
    new_figure,
    plain,
    series_handles,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINE = 0.05
"""Height that a series takes of a category's line [inch]."""
LEAST = 1.1
"""Height of a figure whose few lines leave no room for its axes and legend [inch]."""


def draw_dots(all_series: Sequence[Series], levels: Sequence[int]) -> Figure:
    """The figure, with a panel for each of `levels`; categories that no series has get no line."""
    present = {c for s in all_series for (c, level) in s.scores.categories if level in levels}
    shown = [c for c in CATEGORIES if c in present] or list(CATEGORIES)
    figure = new_figure(max(LEAST, len(shown) * (LINE * len(all_series) + 0.04) + 0.6))
    axes = figure.subplots(1, len(levels), sharey=True, squeeze=False)[0]
    for axis, level in zip(axes, levels, strict=True):
        for index, series in enumerate(all_series):
            _dots(axis, series, index, len(all_series), shown, level)
        axis.set_title(f"L{level}", loc="left", weight="bold")
        axis.set_xlim(-3, 103)
        axis.set_xlabel("SR [%]")
        plain(axis, "x")
        axis.tick_params(axis="y", length=0)
        for line in range(1, len(shown)):
            axis.axhline(line - 0.5, color="#8888884d", lw=0.4)
    axes[0].set_ylim(len(shown) - 0.5, -0.5)
    axes[0].set_yticks(range(len(shown)), shown)
    legend_below(figure, series_handles(all_series))
    return figure


def _dots(
    axis: Axes, series: Series, index: int, count: int, shown: Sequence[str], level: int
) -> None:
    """The values of one series, which has its own height within every line."""
    height = (index + 0.5) / count * 0.8 - 0.4
    for line, category in enumerate(shown):
        average = series.scores.categories.get((category, level))
        estimate = None if average is None else average.values.get("sr")
        if estimate is None:
            continue
        value, low, high = (100 * x for x in (estimate.value, estimate.low, estimate.high))
        axis.errorbar(
            [value],
            [line + height],
            xerr=[[max(0.0, value - low)], [max(0.0, high - value)]],
            color=COLOURS[index % len(COLOURS)],
            marker=MARKERS[index % len(MARKERS)],
            ms=2.4,
            elinewidth=0.6,
            capsize=0,
        )
