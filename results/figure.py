"""The figure of a run: success rate by level, one panel a category, with 95 % intervals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from robospa.results.metrics import CATEGORIES, CATEGORY_NAMES, SPATIAL, Scores
from robospa.results.records import TrialRecord

COLOURS = {"spatial": "#2563a8", "procedural": "#b45309"}
CHANCE = "#6b7280"


def chance_levels(records: list[TrialRecord]) -> dict[tuple[str, int], float]:
    """Chance of naming the target by guessing, per spatial category and level [%].

    The mean of 1/n over the category's tasks.
    """
    per_task: dict[tuple[str, int], dict[str, int]] = {}
    for record in records:
        if record.category in SPATIAL and record.candidates > 1:
            place = per_task.setdefault((record.category, record.key.level), {})
            place[record.key.task] = record.candidates
    return {k: 100 * sum(1 / n for n in v.values()) / len(v) for k, v in per_task.items()}


def draw(scores: Scores, records: list[TrialRecord], folder: Path) -> list[str]:
    """Write `success.png` and `success.svg` into `folder`; returns their names."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = [c for c in CATEGORIES if (c, 0) in scores.categories]
    columns = min(5, max(1, len(shown)))
    lines = -(-len(shown) // columns) or 1
    with matplotlib.rc_context({"font.size": 9, "svg.hashsalt": "robospa", "svg.fonttype": "none"}):
        figure = Figure(figsize=(2.5 * columns + 0.6, 2.4 * lines + 0.3), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(lines, columns, squeeze=False, sharey=True)
        chance = chance_levels(records)
        for index, axis in enumerate(axes.flat):
            if index < len(shown):
                _panel(axis, scores, shown[index], chance)
            else:
                axis.set_axis_off()
        for line in axes:
            line[0].set_ylabel("success rate [%]")
        figure.savefig(folder / "success.png", dpi=160)
        figure.savefig(folder / "success.svg", metadata={"Date": None})
    return ["success.png", "success.svg"]


def _panel(axis: Any, scores: Scores, category: str, chance: dict[tuple[str, int], float]) -> None:
    found = [
        (n, e)
        for n in scores.levels
        if (a := scores.categories.get((category, n))) and (e := a.values["sr"])
    ]
    colour = COLOURS["spatial" if category in SPATIAL else "procedural"]
    levels = [n for n, _ in found]
    values = [100 * e.value for _, e in found]
    down = [100 * (e.value - e.low) for _, e in found]
    up = [100 * (e.high - e.value) for _, e in found]
    guesses = [(n, chance[category, n]) for n in scores.levels if (category, n) in chance]
    if guesses:
        axis.plot(*zip(*guesses, strict=True), ls=":", color=CHANCE, lw=1.2, label="chance")
        axis.legend(frameon=False, fontsize=7.5, loc="best", handlelength=1.6)
    if found:
        axis.errorbar(
            levels,
            values,
            yerr=[down, up],
            color=colour,
            marker="o",
            ms=4,
            lw=1.6,
            elinewidth=0.9,
            capsize=2.5,
        )
    axis.set_title(f"{category}  {CATEGORY_NAMES[category]}", fontsize=8)
    axis.set_ylim(-4, 104)
    axis.set_yticks(range(0, 101, 25))
    axis.set_xlim(min(scores.levels) - 0.4, max(scores.levels) + 0.4)
    axis.set_xticks(list(scores.levels), [f"L{n}" for n in scores.levels])
    axis.grid(axis="y", color="#e5e7eb", lw=0.7)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)
