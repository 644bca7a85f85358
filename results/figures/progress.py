"""Progress against success of every procedural variant: how far failed trials came."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from robospa.results.figures.series import (
    COLOURS,
    INK,
    MARKERS,
    Series,
    label_of,
    legend_below,
    new_figure,
    percent_of,
    plain,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PathCollection
    from matplotlib.figure import Figure


def draw_progress(all_series: Sequence[Series]) -> Figure:
    """The figure: a point a variant; of a single series coloured by level."""
    figure = new_figure(2.9)
    axis = figure.subplots()
    axis.plot([0, 100], [0, 100], color=INK, lw=0.7, ls=(0, (1, 2)))
    groups = _by_level(all_series[0]) if len(all_series) == 1 else _by_series(all_series)
    handles = [_scatter(axis, i, name, points) for i, (name, points) in enumerate(groups) if points]
    axis.set_xlim(-3, 103)
    axis.set_ylim(-3, 103)
    axis.set_xlabel("success rate [%]")
    axis.set_ylabel("progress score [%]")
    axis.text(84, 78, "PS = SR", ha="left", va="top", fontsize=6)
    plain(axis, "both")
    legend_below(figure, handles, 5 if len(all_series) == 1 else 3)
    return figure


def _points(series: Series, level: int = 0) -> list[tuple[float, float]]:
    found = []
    for cell in series.scores.cells.values():
        success, progress = percent_of(cell, "sr"), percent_of(cell, "ps")
        if success is not None and progress is not None and level in (0, cell.level):
            found.append((success, progress))
    return found


def _by_level(series: Series) -> list[tuple[str, list[tuple[float, float]]]]:
    return [(f"L{n}", _points(series, n)) for n in series.scores.levels]


def _by_series(all_series: Sequence[Series]) -> list[tuple[str, list[tuple[float, float]]]]:
    return [(label_of(s.name), _points(s)) for s in all_series]


def _scatter(
    axis: Axes, index: int, name: str, points: Sequence[tuple[float, float]]
) -> PathCollection:
    return axis.scatter(
        [success for success, _ in points],
        [progress for _, progress in points],
        s=11,
        marker=MARKERS[index % len(MARKERS)],
        facecolor=COLOURS[index % len(COLOURS)] + "99",
        edgecolor=COLOURS[index % len(COLOURS)],
        lw=0.5,
        label=name,
    )
