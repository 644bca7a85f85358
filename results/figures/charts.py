"""The figures of runs and published models, one function each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from robospa.results.comparison.latency_curve import LatencyCurve
from robospa.results.figures.series import (
    COLOURS,
    GRID,
    INK,
    MARKERS,
    Series,
    label_of,
    legend_below,
    look,
    new_figure,
    percent_of,
    plain,
    series_handles,
    spread,
    whiskers,
)
from robospa.results.paper.rounding import shown
from robospa.results.scoring.scores import Scores
from robospa.results.statistics.intervals import Estimate
from robospa.trial import CATEGORY_NAMES, PROCEDURAL, SPATIAL

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def chance_levels(scores: Scores) -> dict[tuple[str, int], float]:
    """Success rate of guessing among the candidates, per spatial category and level [%]."""
    found: dict[tuple[str, int], list[float]] = {}
    for cell in scores.cells.values():
        if cell.candidates > 1:
            found.setdefault((cell.category, cell.level), []).append(100 / cell.candidates)
    return {place: sum(v) / len(v) for place, v in found.items()}


FIRST = (0, (4, 2))
"""The dashes of the first choice; its line is thin and has no marks."""


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
            _level_panel(axis, all_series, group[line], levels, guessed)
            if line == len(group) - 1:
                axis.tick_params(labelbottom=True)
            if column == 0:
                axis.set_ylabel("SR [%]")
    handles = series_handles(all_series)
    from matplotlib.lines import Line2D

    averages = [a for s in all_series for a in s.scores.categories.values()]
    if any(percent_of(average, "sr1") is not None for average in averages):
        handles.append(Line2D([], [], color=INK, lw=0.7, ls=FIRST, label="SR@1"))
    if guessed:
        handles.append(Line2D([], [], color=INK, lw=0.8, ls=(0, (1, 2)), label="chance"))
    legend_below(figure, handles)
    return figure


def _level_panel(
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
        parts = [(n, a) for n in levels if (a := series.scores.categories.get((category, n)))]
        points = [
            (n, e if spread(series.scores, category, n) else Estimate(e.value, e.value, e.value))
            for n, a in parts
            if (e := a.values.get("sr"))
        ]
        if not points:
            continue
        aside = (index - (len(all_series) - 1) / 2) * min(0.09, 0.4 / len(all_series))
        whiskers(axis, [(n + aside, e) for n, e in points], index)
        first = [(n + aside, y) for n, a in parts if (y := percent_of(a, "sr1")) is not None]
        colour = COLOURS[index % len(COLOURS)]
        axis.plot([x for x, _ in first], [y for _, y in first], color=colour, lw=0.7, ls=FIRST)
    axis.set_title(CATEGORY_NAMES[category], fontsize=6.2, pad=3)
    axis.text(0.99, 0.98, category, transform=axis.transAxes, ha="right", va="top", weight="bold")
    axis.set_ylim(-6, 132)  # room for the code
    axis.set_yticks((0, 50, 100))
    axis.set_xlim(min(levels) - 0.4, max(levels) + 0.4)
    axis.set_xticks(list(levels), [f"L{n}" for n in levels])
    plain(axis)


def draw_progress(all_series: Sequence[Series]) -> Figure:
    """The figure: a point a variant; of a single series coloured by level."""
    figure = new_figure(2.9)
    axis = figure.subplots()
    axis.plot([0, 100], [0, 100], color=INK, lw=0.7, ls=(0, (1, 2)))
    one = len(all_series) == 1
    groups = {label_of(series.name): _points(series) for series in all_series}
    if one:
        groups = {f"L{n}": _points(all_series[0], n) for n in all_series[0].scores.levels}
    handles = []
    for index, (name, points) in enumerate(groups.items()):
        colour, marker = COLOURS[index % len(COLOURS)], MARKERS[index % len(MARKERS)]
        if points:
            x, y = zip(*points, strict=True)
            dots = axis.scatter(x, y, s=11, marker=marker, facecolor=colour + "99", label=name)
            dots.set(edgecolor=colour, linewidth=0.5)
            handles.append(dots)
    axis.set_xlim(-3, 103)
    axis.set_ylim(-3, 103)
    axis.set_xlabel("success rate [%]")
    axis.set_ylabel("progress score [%]")
    axis.text(84, 78, "PS = SR", ha="left", va="top", fontsize=6)
    plain(axis, "both")
    legend_below(figure, handles, 5 if one else 3)
    return figure


def _points(series: Series, level: int = 0) -> list[tuple[float, float]]:
    cells = [cell for cell in series.scores.cells.values() if level in (0, cell.level)]
    pairs = [(percent_of(cell, "sr"), percent_of(cell, "ps")) for cell in cells]
    return [(sr, ps) for sr, ps in pairs if sr is not None and ps is not None]


HEAT_LINE = 0.125
"""Height of a task's line [inch]."""
BAR_GAP = 0.06
"""Between the last line and the colour bar [inch]."""


def draw_heat(series: Series) -> Figure:
    """The figure; a hatched cell has no result."""
    import numpy as np

    scores = series.scores
    tasks = scores.tasks_by_category
    levels = list(scores.levels)
    values = np.full((len(tasks), len(levels)), np.nan)
    for line, task in enumerate(tasks):
        for column, level in enumerate(levels):
            found = percent_of(scores.cells.get((task, level)), "sr")
            values[line, column] = np.nan if found is None else found
    height = HEAT_LINE * len(tasks)
    figure = new_figure(height + 0.85)
    axis = figure.subplots()
    image = axis.imshow(values, cmap="cividis", vmin=0, vmax=100, aspect="auto")
    axis.set_facecolor("none")
    for line in range(len(tasks)):
        for column in range(len(levels)):
            _heat_number(axis, line, column, float(values[line, column]))
    axis.set_yticks(
        range(len(tasks)), [label_of(t.replace("_", " "), 40) for t in tasks], fontsize=5.5
    )
    axis.set_xticks(range(len(levels)), [f"L{n}" for n in levels])
    # thin lines between the cells, so that equal ones do not run together
    axis.set_yticks([n + 0.5 for n in range(len(tasks) - 1)], minor=True)
    axis.set_xticks([n + 0.5 for n in range(len(levels) - 1)], minor=True)
    axis.grid(which="minor", color=GRID, lw=0.5)
    axis.tick_params(which="both", length=0)
    axis.xaxis.tick_top()
    axis.spines[:].set_visible(False)
    _categories(axis, [scores.category_of[t] for t in tasks])
    bar = figure.colorbar(
        image, ax=axis, location="bottom", aspect=40, shrink=0.9, pad=BAR_GAP / height
    )
    bar.set_label("SR [%]")
    bar.outline.set_visible(False)
    return figure


def _heat_number(axis: Axes, line: int, column: int, value: float) -> None:
    if value != value:  # no result: not a number
        from matplotlib.patches import Rectangle

        corner = (column - 0.5, line - 0.5)
        axis.add_patch(Rectangle(corner, 1, 1, fill=False, hatch="////", lw=0, ec="#9aa0a8"))
        return
    text = f"{value:.0f}" if abs(value - round(value)) < 0.05 else f"{shown(value):.1f}"
    colour = "#ffffff" if value < 55 else "#101010"
    axis.text(column, line, text, ha="center", va="center", fontsize=5, color=colour)


def _categories(axis: Axes, of_line: list[str]) -> None:
    start = 0
    for line in range(1, len(of_line) + 1):
        if line == len(of_line) or of_line[line] != of_line[start]:
            if line < len(of_line):
                axis.axhline(line - 0.5, color="#ffffff", lw=1.4)
            middle = (start + line - 1) / 2
            place = axis.get_yaxis_transform()
            axis.text(1.02, middle, of_line[start], transform=place, va="center", fontsize=6)
            start = line


BAR_FILLS = ((COLOURS[0], ""), (COLOURS[4], "////"), (COLOURS[6], "...."), (COLOURS[2], "xxxx"))
"""Colour and hatching of the bars of a category."""


def draw_bars(bars: Mapping[str, Mapping[str, Estimate]], label: str) -> Figure:
    """The figure of `bars` (name -> category -> estimate), side by side in each category, with
    intervals; one that is not known is left out."""
    from matplotlib.patches import Patch

    known = [c for c in CATEGORY_NAMES if any(c in values for values in bars.values())]
    figure = new_figure(1.9)
    axis = figure.subplots()
    wide = 0.84 / len(bars)
    handles, lowest = [], 0.0
    for number, (name, values) in enumerate(bars.items()):
        colour, hatch = BAR_FILLS[number % len(BAR_FILLS)]
        handles.append(Patch(fc=colour, hatch=hatch, ec="#ffffff", lw=0.3, label=label_of(name)))
        for place, category in enumerate(known):
            if (found := values.get(category)) is not None:
                at = place + (number - (len(bars) - 1) / 2) * wide
                value, low, high = (100 * x for x in (found.value, found.low, found.high))
                axis.bar(at, value, wide, color=colour, hatch=hatch, edgecolor="#ffffff", lw=0.3)
                axis.plot([at, at], [low, high], color=INK, lw=0.6)
                lowest = min(lowest, low)
    axis.set_xticks(range(len(known)), known, fontsize=6)
    axis.set_xlim(-0.55, len(known) - 0.45)
    axis.set_ylim(lowest and max(-40.0, lowest - 2), 102)
    axis.axhline(0, color=INK, lw=0.6)
    axis.set_ylabel(label)
    plain(axis)
    axis.tick_params(axis="x", length=0)
    legend_below(figure, handles)
    return figure


def draw_costs(costs: Mapping[str, tuple[Estimate, bool]]) -> Figure:
    """The figure of differences of success by axis, the costliest first: filled where it is found
    to be no chance."""
    ranked = sorted(costs.items(), key=lambda item: -item[1][0].value)
    figure = new_figure(0.13 * len(ranked) + 0.45)
    axis = figure.subplots()
    axis.axvline(0, color=INK, lw=0.6)
    for place, (_, (found, sure)) in enumerate(ranked):
        value, low, high = (100 * x for x in (found.value, found.low, found.high))
        colour = COLOURS[1] if sure else COLOURS[0]
        axis.plot([low, high], [place, place], color=colour, lw=0.9)
        face = colour if sure else "#ffffff"
        axis.plot([value], [place], "o", ms=3.4, color=colour, mfc=face, mew=0.9, clip_on=False)
    axis.set_yticks(range(len(ranked)), [label_of(name) for name, _ in ranked])
    axis.set_ylim(-0.6, len(ranked) - 0.4)
    axis.set_xlabel("success under the axis minus clean [points]")
    plain(axis, "x")
    axis.tick_params(axis="y", length=0)
    return figure


FAILURE_LINE = 0.13
"""Height of a task's bar [inch]."""
FILLS = (
    ("#332288", ""),
    ("#88ccee", ""),
    ("#117733", ""),
    ("#ddcc77", ""),
    ("#cc6677", ""),
    ("#aa4499", "////"),
    ("#44aa99", "...."),
    ("#d0d4da", ""),
    ("#7f7f7f", "xxxx"),
)
"""Colour (Tol's muted palette) and hatching of every type, in the order of the types."""


def draw_failures(
    counts: Mapping[str, Mapping[str, int]], kinds: Sequence[str], names: Mapping[str, str]
) -> Figure:
    """The figure of `counts` (task -> type -> failed trials), types in the order of `kinds`."""
    from matplotlib.patches import Patch

    tasks = [task for task in counts if sum(counts[task].values())]
    present = [k for k in kinds if any(counts[t].get(k) for t in tasks)]
    figure = new_figure(FAILURE_LINE * len(tasks) + 0.6 + 0.14 * -(-len(present) // 2))
    axis = figure.subplots()
    left, handles = [0.0] * len(tasks), []
    for kind in present:
        colour, hatch = FILLS[list(kinds).index(kind) % len(FILLS)]
        shares = [100 * counts[t].get(kind, 0) / sum(counts[t].values()) for t in tasks]
        axis.barh(
            range(len(tasks)), shares, left=left, color=colour, hatch=hatch, edgecolor="#ffffff",
            lw=0.4, height=0.8,
        )  # fmt: skip
        left = [a + b for a, b in zip(left, shares, strict=True)]
        label = names.get(kind, kind)
        handles.append(Patch(fc=colour, hatch=hatch, ec="#ffffff", lw=0.4, label=label))
    for line, task in enumerate(tasks):
        text = str(sum(counts[task].values()))
        axis.text(101.5, line, text, va="center", fontsize=5.5, color=INK)
    axis.text(101.5, -1.0, "failed", va="center", fontsize=5.5, color=INK)
    axis.set_yticks(
        range(len(tasks)), [label_of(t.replace("_", " "), 40) for t in tasks], fontsize=5.5
    )
    axis.set_ylim(len(tasks) - 0.4, -1.4)
    axis.set_xlim(0, 100)
    axis.set_xlabel("share of failed trials [%]")
    plain(axis, "x")
    axis.tick_params(axis="y", length=0)
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=2, columnspacing=1.2)
    return figure


MEASURES = (("p50", "-"), ("p95", "--"), ("p99", ":"))


def draw_latency(all_series: Sequence[Series]) -> Figure:
    """The figure: for every run the distribution over trials of their p50, p95 and p99."""
    from matplotlib.lines import Line2D

    figure = new_figure(2.1)
    axis = figure.subplots()
    handles = [Line2D([], [], color=INK, ls=dash, label=name) for name, dash in MEASURES]
    for index, series in enumerate(all_series):
        colour = COLOURS[index % len(COLOURS)]
        handles.append(Line2D([], [], color=colour, lw=2.4, label=label_of(series.name)))
        for name, dash in MEASURES:
            values = sorted(r.latency[name] for r in series.records if r.latency.get(name, 0) > 0)
            if values:
                shares = [100 * (i + 1) / len(values) for i in range(len(values))]
                axis.step([values[0], *values], [0.0, *shares], where="post", color=colour, ls=dash)
    axis.set_xscale("log")
    axis.xaxis.set_major_formatter(_milliseconds)
    low, high = axis.get_xlim()
    if high < 10 * low:  # no two powers of ten: the ticks between need numbers
        axis.xaxis.set_minor_formatter(_milliseconds)
    axis.set_ylim(0, 102)
    axis.set_xlabel("latency of an answer [ms]")
    axis.set_ylabel("share of trials [%]")
    plain(axis, "both")
    legend_below(figure, handles, 4)
    return figure


def _milliseconds(value: float, _: object) -> str:
    return f"{value:g}"


MOST_LETTERS = 28
"""Of a policy's name in the legend, beside which something stands."""


def draw_latency_curves(curves: Sequence[LatencyCurve]) -> Figure:
    """The figure: a line a curve; whiskers are 95 % intervals, a bar along the axis the interval of
    the latency at which half of the success is gone."""
    from matplotlib.lines import Line2D

    figure = new_figure(2.1)
    axis = figure.subplots()
    handles = []
    last = max(curve.points[-1].latency for curve in curves)
    for i, curve in enumerate(curves):
        style = look(i)
        handles.append(Line2D([], [], ms=3, label=_curve_name(curve), **style))
        whiskers(axis, [(point.latency, point.success) for point in curve.points], i)
        if curve.half is not None and math.isfinite(curve.half.value):
            colour, middle = style["color"], 50 * curve.points[0].success.value
            span = [curve.half.low, min(curve.half.high, last)]
            axis.plot(span, [2.0 - 3.0 * i] * 2, color=colour, lw=1.6, alpha=0.5)
            axis.plot([curve.half.value] * 2, [0, middle], color=colour, lw=0.8, ls=":")
    axis.set_ylim(min(-4, -1 - 3.0 * len(curves)), 104)
    axis.set_xlabel("declared latency of an answer [ms]")
    axis.set_ylabel("SR [%]")
    plain(axis)
    legend_below(figure, handles, 1)
    return figure


def _curve_name(curve: LatencyCurve) -> str:
    """The policy, how its chunks follow each other, and where half of its success is gone."""
    name = f"{label_of(curve.policy, MOST_LETTERS)}, {curve.clock}"
    if curve.half is None or not math.isfinite(curve.half.value):
        return name
    return f"{name}: half at {curve.half.value:.0f} ms"
