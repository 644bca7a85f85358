"""Success rate against level, one panel a category: spatial left, procedural right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from robospa.categories import CATEGORY_NAMES, PROCEDURAL, SPATIAL
from robospa.results.figures.series import (
    COLOURS,
    DASHES,
    INK,
    MARKERS,
    Series,
    legend_below,
    new_figure,
    plain,
    series_handles,
)
from robospa.results.scoring.scores import Scores

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def chance_levels(scores: Scores) -> dict[tuple[str, int], float]:
    """Success rate of guessing among the candidates, per spatial category and level [%].

    A cell's ONTA is its success rate rescaled so that chance is 0, which gives chance back.
    """
    found: dict[tuple[str, int], list[float]] = {}
    for cell in scores.cells.values():
        sr, onta = cell.values.get("sr"), cell.values.get("onta")
        if sr is not None and onta is not None and onta.value < 1:
            chance = (sr.value - onta.value) / (1 - onta.value)
            found.setdefault((cell.category, cell.level), []).append(100 * chance)
    return {place: sum(v) / len(v) for place, v in found.items()}


def draw_levels(all_series: Sequence[Series]) -> Figure:
    """The figure; categories that no series has get no panel."""
    present = {c for s in all_series for (c, _) in s.scores.categories}
    columns = [[c for c in group if c in present] for group in (SPATIAL, PROCEDURAL)]
    columns = [group for group in columns if group] or [[]]
    lines = max(1, *(len(group) for group in columns))
    figure = new_figure(1.06 * lines + 0.45)
    axes = figure.subplots(lines, len(columns), squeeze=False, sharex=True, sharey=True)
    levels = sorted({n for s in all_series for n in s.scores.levels}) or [1]
    guessed: dict[tuple[str, int], float] = {}
    for series in all_series:
        guessed |= chance_levels(series.scores)
    for column, group in enumerate(columns):
        for line in range(lines):
            axis = axes[line][column]
            if line >= len(group):
                axis.set_axis_off()
                continue
            _panel(axis, all_series, group[line], levels, guessed)
            if line == len(group) - 1:
                axis.tick_params(labelbottom=True)
            if column == 0:
                axis.set_ylabel("SR [%]")
    handles = series_handles(all_series)
    if guessed:
        from matplotlib.lines import Line2D

        handles.append(Line2D([], [], color=INK, lw=0.8, ls=(0, (1, 2)), label="chance"))
    legend_below(figure, handles)
    return figure


def _panel(
    axis: Axes,
    all_series: Sequence[Series],
    category: str,
    levels: Sequence[int],
    guessed: dict[tuple[str, int], float],
) -> None:
    chance = [(n, guessed[category, n]) for n in levels if (category, n) in guessed]
    if chance:
        axis.plot(*zip(*chance, strict=True), ls=(0, (1, 2)), color=INK, lw=0.8)
    for index, series in enumerate(all_series):
        points = [
            (n, e)
            for n in levels
            if (a := series.scores.categories.get((category, n))) and (e := a.values.get("sr"))
        ]
        if not points:
            continue
        aside = (index - (len(all_series) - 1) / 2) * min(0.09, 0.4 / len(all_series))
        down = [max(0.0, 100 * (e.value - e.low)) for _, e in points]
        up = [max(0.0, 100 * (e.high - e.value)) for _, e in points]
        axis.errorbar(
            [n + aside for n, _ in points],
            [100 * e.value for _, e in points],
            yerr=[down, up],
            color=COLOURS[index % len(COLOURS)],
            marker=MARKERS[index % len(MARKERS)],
            ls=DASHES[index % len(DASHES)],
            ms=2.6,
            elinewidth=0.6,
            capsize=1.2,
        )
    axis.set_title(CATEGORY_NAMES[category], fontsize=6.2, pad=3)
    axis.text(0.99, 0.98, category, transform=axis.transAxes, ha="right", va="top", weight="bold")
    axis.set_ylim(-6, 132)  # room for the code
    axis.set_yticks((0, 50, 100))
    axis.set_xlim(min(levels) - 0.4, max(levels) + 0.4)
    axis.set_xticks(list(levels), [f"L{n}" for n in levels])
    plain(axis)
