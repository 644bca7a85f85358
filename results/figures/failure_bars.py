"""Bars of failure types: for every task the share of each type among its failed trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from robospa.results.figures.series import INK, label_of, new_figure, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINE = 0.13
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
    figure = new_figure(LINE * len(tasks) + 0.6 + 0.14 * -(-len(present) // 2))
    axis = figure.subplots()
    left = [0.0] * len(tasks)
    for kind in present:
        colour, hatch = FILLS[list(kinds).index(kind) % len(FILLS)]
        shares = [100 * counts[t].get(kind, 0) / sum(counts[t].values()) for t in tasks]
        axis.barh(
            range(len(tasks)),
            shares,
            left=left,
            color=colour,
            hatch=hatch,
            edgecolor="#ffffff",
            lw=0.4,
            height=0.8,
        )
        left = [a + b for a, b in zip(left, shares, strict=True)]
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
    handles = []
    for kind in present:
        colour, hatch = FILLS[list(kinds).index(kind) % len(FILLS)]
        label = names.get(kind, kind)
        handles.append(Patch(fc=colour, hatch=hatch, ec="#ffffff", lw=0.4, label=label))
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=2, columnspacing=1.2)
    return figure
