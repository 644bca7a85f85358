"""The data of figures, and their common size, colours and files.

Every figure is as wide as one column of a two-column paper and is read without colour too: series
differ by marker and dash, stacked parts by hatching.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypedDict

from robospa.results.records.manifest import JOINTS
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.grounding import Grounding
from robospa.results.scoring.scores import AverageScore, Scores, VariantScore
from robospa.results.statistics.intervals import Estimate

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

WIDTH = 3.4
"""Width of a column [inch]."""
INK = "#1c2430"
"""Text and axes; the report's page puts its own text colour in its place."""
GRID = "#d9dde3"
"""Grid lines; replaced by the page likewise."""
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f")
"""Okabe and Ito's palette, told apart with every common colour vision deficiency."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
Dash = str | tuple[int, tuple[int, ...]]
DASHES: tuple[Dash, ...] = ("-", "--", "-.", ":", (0, (5, 1)), (0, (1, 1)), (0, (3, 1, 1, 1)))
FORMATS = ("svg", "png", "pdf")
LEGEND_HANDLE = 0.42
"""Width of a legend's line with the space around it [inch]."""
LEGEND_LINE = 0.135
"""Height of a line of names [inch]."""
LEGEND_LETTER = 0.05
"""Mean width of a letter in a legend [inch]."""


@dataclass(frozen=True)
class Series:
    """One run or published model. Published models have no `records`."""

    name: str
    scores: Scores
    records: Sequence[TrialRecord] = ()
    published: bool = False
    failures: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    """How often each type of failure occurs, by task."""
    grounding: Mapping[str, Grounding] = field(default_factory=dict)
    """What was chosen and what came of it, by category."""
    track: str = JOINTS


@dataclass(frozen=True)
class DrawnFigure:
    """A figure on disk: `name` without ending, its title, and what it shows in a sentence."""

    name: str
    title: str
    caption: str


def percent_of(part: VariantScore | AverageScore | None, metric: str) -> float | None:
    """The value of `metric` in percent, None where there is no result."""
    estimate = None if part is None else part.values.get(metric)
    return None if estimate is None else 100 * estimate.value


def spread(scores: Scores, category: str, level: int) -> bool:
    """Whether any variant of `category` at `level` has more than one trial: of one trial each, an
    interval says nothing that is worth a whisker."""
    cells = scores.cells.values()
    return any(c.trials > 1 for c in cells if (c.category, c.level) == (category, level))


def label_of(name: str, most: int = 44) -> str:
    """`name` as Matplotlib is to print it: one line, no longer than `most`, no mathematics."""
    text = "".join(c if c.isprintable() else " " for c in name)
    text = text if len(text) <= most else text[: most - 1] + "…"
    return text.replace("$", r"\$")


@contextmanager
def styled() -> Iterator[None]:
    """Settings that every figure is drawn with; they make its files repeatable."""
    import matplotlib

    with matplotlib.rc_context(
        {
            **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize"), 7),
            **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), 6.5),
            **dict.fromkeys(("text.color", "axes.edgecolor", "axes.labelcolor"), INK),
            **dict.fromkeys(("xtick.color", "ytick.color"), INK),
            **dict.fromkeys(("axes.linewidth", "xtick.major.width", "ytick.major.width"), 0.6),
            **dict.fromkeys(("grid.linewidth", "hatch.linewidth"), 0.5),
            "grid.color": GRID,
            "legend.frameon": False,
            "lines.linewidth": 1.1,
            "svg.hashsalt": "robospa",
            "svg.fonttype": "path",
            "pdf.fonttype": 42,
        }
    ):
        yield


def new_figure(height: float) -> Figure:
    """An empty figure of one column's width, `height` [inch] high."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, folder: Path, name: str, formats: Sequence[str] = FORMATS) -> None:
    """Write `figure` in all `formats`; the bytes depend on nothing but what it shows."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # one layout serves all formats
    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    for ending in formats:
        path = folder / f"{name}.{ending}"
        figure.savefig(path, dpi=300, metadata=undated.get(ending), transparent=ending == "svg")


def plain(axis: Axes, grid: Literal["x", "y", "both"] = "y") -> None:
    """Frame on two sides only, and a grid behind the data."""
    axis.grid(axis=grid)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)


def legend_below(figure: Figure, handles: Sequence[Artist], columns: int = 3) -> None:
    """The series' names under the panels, in at most `columns` that fit beside each other.

    The figure grows by every line of names after the first.
    """
    if handles:
        longest = max(len(str(handle.get_label())) for handle in handles)
        fitting = int(WIDTH / (LEGEND_HANDLE + LEGEND_LETTER * longest))
        columns = max(1, min(columns, len(handles), fitting))
        lines = -(-len(handles) // columns)
        figure.set_figheight(figure.get_figheight() + LEGEND_LINE * (lines - 1))
        figure.legend(
            handles=handles,
            loc="outside lower center",
            ncols=columns,
            handlelength=2.6,
            columnspacing=1.2,
        )


class Look(TypedDict):
    """How a series is told from others."""

    color: str
    marker: str
    ls: Dash


def look(index: int) -> Look:
    """The look of the series number `index`."""
    places = (index % len(COLOURS), index % len(MARKERS), index % len(DASHES))
    return {"color": COLOURS[places[0]], "marker": MARKERS[places[1]], "ls": DASHES[places[2]]}


def whiskers(axis: Axes, points: Sequence[tuple[float, Estimate]], index: int) -> None:
    """A line through the estimates (in percent) at some places, with their intervals."""
    axis.errorbar(
        [x for x, _ in points],
        [100 * e.value for _, e in points],
        yerr=[
            [max(0.0, 100 * (e.value - e.low)) for _, e in points],
            [max(0.0, 100 * (e.high - e.value)) for _, e in points],
        ],
        ms=2.6,
        elinewidth=0.6,
        capsize=1.2,
        **look(index),
    )


def series_handles(all_series: Sequence[Series]) -> list[Line2D]:
    """A legend entry for every series."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], ms=3.2, label=label_of(series.name), **look(i))
        for i, series in enumerate(all_series)
    ]
