"""Curves: success against latency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from robospa.results.comparison.latency_curve import LatencyCurve
from robospa.results.figures import series

if TYPE_CHECKING:
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
