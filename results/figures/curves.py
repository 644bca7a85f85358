"""Curves: success against latency and against demonstrations, and the losses of a training."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from robospa.results.comparison.latency_curve import LatencyCurve
from robospa.results.figures import series
from robospa.results.scoring.scores import Scores
from robospa.results.statistics.intervals import Estimate
from robospa.trial import METRIC_NAMES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_LETTERS = 28
"""Of a policy's name in the legend, beside which something stands."""


def draw_latency_curves(curves: Sequence[LatencyCurve]) -> Figure:
    """The figure: a line a curve; whiskers are 95 % intervals, a bar along the axis the interval of
    the latency at which half of the success is gone."""
    from matplotlib.lines import Line2D

    figure = series.new_figure(2.1)
    axis = figure.subplots()
    handles = []
    last = max(curve.points[-1].latency for curve in curves)
    for i, curve in enumerate(curves):
        style = series.look(i)
        handles.append(Line2D([], [], ms=3, label=_curve_name(curve), **style))
        series.whiskers(axis, [(point.latency, point.success) for point in curve.points], i)
        if curve.half is not None and math.isfinite(curve.half.value):
            colour, middle = style["color"], 50 * curve.points[0].success.value
            span = [curve.half.low, min(curve.half.high, last)]
            axis.plot(span, [2.0 - 3.0 * i] * 2, color=colour, lw=1.6, alpha=0.5)
            axis.plot([curve.half.value] * 2, [0, middle], color=colour, lw=0.8, ls=":")
    axis.set_ylim(min(-4, -1 - 3.0 * len(curves)), 104)
    axis.set_xlabel("declared latency of an answer [ms]")
    axis.set_ylabel("SR [%]")
    series.plain(axis)
    series.legend_below(figure, handles, 1)
    return figure


def _curve_name(curve: LatencyCurve) -> str:
    """The policy, how its chunks follow each other, and where half of its success is gone."""
    name = f"{series.label_of(curve.policy, MOST_LETTERS)}, {curve.clock}"
    if curve.half is None or not math.isfinite(curve.half.value):
        return name
    return f"{name}: half at {curve.half.value:.0f} ms"


NAMES = {metric: f"{name} [%]" for metric, name in METRIC_NAMES.items()}
MEAN = 0
"""The level that is the mean over levels, as in `Scores`."""


@dataclass(frozen=True)
class CurvePoint:
    """What a policy that was trained with so many demonstrations a variant came to."""

    demonstrations: int
    scores: Scores


def value_at(point: CurvePoint, level: int, metric: str) -> Estimate | None:
    """The mean over all tasks of a level, MEAN for all; None where there is none."""
    average = point.scores.overall.get(level)
    return None if average is None else average.values.get(metric)


def draw_learning_curve(points: Sequence[CurvePoint], metric: str = "sr") -> Figure:
    """The figure. Raises ValueError for a metric that none of the points has."""
    points = sorted(points, key=lambda point: point.demonstrations)
    levels = sorted({level for point in points for level in point.scores.levels})
    if not any(value_at(point, MEAN, metric) for point in points):
        raise ValueError(f"none of the runs has the metric {metric}: choose another")
    figure = series.new_figure(2.1)
    left, right = figure.subplots(1, 2, sharey=True)
    for i, level in enumerate((*levels, MEAN)):
        found = [(p.demonstrations, value_at(p, level, metric)) for p in points]
        name = "mean" if level == MEAN else f"L{level}"
        _line(left, i, name, [(x, e) for x, e in found if e])
    for i, point in enumerate(points):
        found = [(level, value_at(point, level, metric)) for level in levels]
        _line(right, i, f"{point.demonstrations:,}", [(x, e) for x, e in found if e])
    counts = [point.demonstrations for point in points]
    left.set_xscale("log")
    left.set_xticks(counts, [f"{count:,}" for count in counts])
    left.minorticks_off()
    left.set_xlabel("demonstrations a variant")
    left.set_ylabel(NAMES.get(metric, metric))
    right.set_xticks(levels, [f"L{level}" for level in levels])
    right.set_xlabel("level")
    left.set_ylim(-4, 104)
    for axis in (left, right):
        series.plain(axis)
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.28), ncols=2, columnspacing=1.0)
    return figure


def _line(axis: Axes, index: int, name: str, values: Sequence[tuple[int, Estimate]]) -> None:
    if not values:
        return
    series.whiskers(axis, values, index, name)


PANEL = 1.4
"""Height of a panel [inch]."""


def draw_losses(rows: Sequence[Mapping[str, float]], path: Path) -> None:
    """Write the picture of `rows`, of which each has a `step` and the same other numbers, as a
    PNG. Those whose names end alike (loss, held_out_loss) share a panel; shares are
    drawn from 0 to 1, all else on a logarithmic scale where it can be."""
    names = [name for name in rows[0] if name != "step"]
    panels: dict[str, list[str]] = {}
    for name in names:
        panels.setdefault(name.rpartition("_")[2], []).append(name)
    steps = [row["step"] for row in rows]
    with series.styled():
        figure = series.new_figure(PANEL * len(panels) + 0.25)
        figure.set_figwidth(2.0 * series.WIDTH)
        axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
        for axis, (ending, members) in zip(axes, panels.items(), strict=True):
            for i, name in enumerate(members):
                values = [row[name] for row in rows]
                axis.plot(
                    steps,
                    values,
                    color=series.COLOURS[i % len(series.COLOURS)],
                    marker="o",
                    ms=2.0,
                    label=name,
                )
            if ending == "share":
                axis.set_ylim(0.0, 1.05)
            elif min(row[name] for row in rows for name in members) > 0:
                axis.set_yscale("log")
            axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
            series.plain(axis)
        axes[-1].set_xlabel("step")
        figure.savefig(path, dpi=200, metadata={"Software": None})
