"""The success rate of every category at the first and at the last level with results, side by side.

Up to three series are radars, as in the paper; more outlines cover each other, and fewer than three
categories have none, so these are dots with their intervals, a line a category.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from robospa.categories import CATEGORIES
from robospa.results.figures.category_dots import draw_dots
from robospa.results.figures.series import (
    COLOURS,
    DASHES,
    GRID,
    MARKERS,
    Series,
    legend_below,
    new_figure,
    percent_of,
    series_handles,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

MOST_OUTLINES = 3
FEWEST_SPOKES = 3


def draw_radar(all_series: Sequence[Series]) -> Figure:
    """The figure; a category without a result leaves a gap in its series' outline."""
    present = {place for series in all_series for place in series.scores.categories}
    there = sorted({level for _, level in present if level})  # 0 is all of them together
    levels = sorted({there[0], there[-1]}) if there else [1]
    if len(all_series) > MOST_OUTLINES or len({c for c, _ in present}) < FEWEST_SPOKES:
        return draw_dots(all_series, levels)
    figure = new_figure(2.2)
    kind = {"projection": "polar"}
    axes = figure.subplots(1, len(levels), subplot_kw=kind, squeeze=False)[0]
    top = _top(all_series, levels)
    for axis, level in zip(axes, levels, strict=True):
        _radar(axis, all_series, level, top)
    legend_below(figure, series_handles(all_series))
    return figure


def _top(all_series: Sequence[Series], levels: Sequence[int]) -> float:
    """The outer ring [%]: the next 20 above the largest value, the same for all radars."""
    values = [
        percent_of(s.scores.categories.get((c, n)), "sr")
        for s in all_series
        for c in CATEGORIES
        for n in levels
    ]
    largest = max((v for v in values if v is not None), default=100.0)
    return float(min(100, max(20, 20 * math.ceil(largest / 20))))


def _radar(axis: PolarAxes, all_series: Sequence[Series], level: int, top: float) -> None:
    angles = [2 * math.pi * i / len(CATEGORIES) for i in range(len(CATEGORIES))]
    for index, series in enumerate(all_series):
        values = [percent_of(series.scores.categories.get((c, level)), "sr") for c in CATEGORIES]
        known = [math.nan if v is None else v for v in values]
        colour = COLOURS[index % len(COLOURS)]
        axis.plot(
            [*angles, 0.0],
            [*known, known[0]],
            color=colour,
            ls=DASHES[index % len(DASHES)],
            marker=MARKERS[index % len(MARKERS)],
            ms=2.4,
            lw=1.0,
            clip_on=False,
        )
        if None not in values:
            axis.fill(angles, known, color=colour, alpha=0.07, lw=0)
    axis.set_theta_zero_location("N")
    axis.set_theta_direction(-1)
    axis.set_xticks(angles, CATEGORIES)
    axis.tick_params(axis="x", pad=-2)
    axis.set_ylim(0, top)
    rings = [top * k / 4 for k in (1, 2, 3, 4)] if top > 20 else [10.0, 20.0]
    axis.set_yticks(rings, [*(f"{r:g}" for r in rings[:-1]), ""], fontsize=5)
    axis.set_rlabel_position(18)
    axis.spines["polar"].set_color(GRID)
    axis.set_title(f"L{level}", loc="left", x=-0.12, y=1.06, weight="bold")
    axis.set_xlabel(f"SR, outer ring {top:g} %", fontsize=6)
