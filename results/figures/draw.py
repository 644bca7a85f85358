"""Draws all figures that the given models and runs have data for, as SVG, PNG and PDF."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from robospa.results.comparison.profile import NO_COST, Profile
from robospa.results.failures.labels import KINDS, NAMES
from robospa.results.figures import charts
from robospa.results.figures.series import FORMATS, DrawnFigure, Series, percent_of, save, styled
from robospa.results.records.manifest import JOINTS, TRACKS
from robospa.results.scoring.grounding import MEASURES
from robospa.results.scoring.scores import Scores
from robospa.results.statistics.intervals import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CAPTIONS = {
    "success": "Success rate by level for every category, with 95 % intervals; "
    "thin dashes are SR@1, success by the first choice; dots are guessing among the candidates.",
    "progress": "Progress score against success rate, one point per procedural variant: the higher "
    "above the line, the further failed trials came.",
    "grounding": "Share of right choices (0 is guessing in spatial and basic tasks), of right "
    "choices that were carried out, and of steps for which nothing was chosen.",
    "tracks": "Success at the first choice: a pixel pointed at, skills called at pixels, joints "
    "moved. From points to skills to joints the hand has more to do, in the same scenes.",
    "profile": "Success under each axis minus that of clean scenes on equal seeds, with 95 % "
    "intervals, the costliest first; filled dots are below p 0.05 after Holm's correction.",
    "latency": "Share of trials whose median, 95th or 99th percentile latency is below a value.",
    "failures": "Share of each failure type among a task's failed trials, and their number.",
    "heat": "Success rate [%] of every task at every level; a hatched cell has no result.",
}


TRACK_ORDER = (JOINTS, *TRACKS.values())


def draw(
    all_series: Sequence[Series],
    folder: Path,
    formats: Sequence[str] = FORMATS,
    beside: Sequence[Series] = (),
) -> list[DrawnFigure]:
    """Write the figures of `all_series` into `folder`; a figure without data is left out.

    Published models get heat maps only where no run is. `beside` are the same series, cut to what
    all of them have, for the figures that hold one against another.
    """
    mapped = [s for s in all_series if not s.published] or all_series
    made: list[DrawnFigure] = []
    with styled():
        found = [_common_figures(all_series, beside or all_series)]
        for number, series in enumerate(all_series, 1):
            found.append(_own_figures(series, number * (len(all_series) > 1), series in mapped))
        for drawn, figure in chain(*found):
            save(figure, folder, drawn.name, formats)
            made.append(drawn)
    return made


Figures = Iterator[tuple[DrawnFigure, "Figure"]]


def _common_figures(all_series: Sequence[Series], beside: Sequence[Series]) -> Figures:
    tracks = {track: [s for s in all_series if s.track == track] for track in TRACK_ORDER}
    compared = next((found for found in tracks.values() if found), [])
    together = [s for s in beside if s.track == compared[0].track] if compared else []
    sizes = [len(s.scores.cells) for s in together]
    cut = sizes != [len(s.scores.cells) for s in compared]
    over = f" Over the {sizes[0]} variants that all have." if cut else ""
    if any(s.scores.categories for s in together):
        drawn = DrawnFigure("success", "Success against level", CAPTIONS["success"] + over)
        yield drawn, charts.draw_levels(together)
    if any(percent_of(c, "ps") is not None for s in together for c in s.scores.cells.values()):
        drawn = DrawnFigure("progress", "Progress against success", CAPTIONS["progress"] + over)
        yield drawn, charts.draw_progress(together)
    if sum(map(bool, tracks.values())) > 1:
        bars = {
            f"{t}: {s.name}": _rates(s.scores) for t in reversed(TRACK_ORDER) for s in tracks[t]
        }
        drawn = DrawnFigure("tracks", "Points, skills and joints", CAPTIONS["tracks"])
        yield drawn, charts.draw_bars(bars, "SR@1 [%]")
    if runs := [s for s in all_series if any(r.latency.get("p50", 0) > 0 for r in s.records)]:
        yield DrawnFigure("latency", "Latency", CAPTIONS["latency"]), charts.draw_latency(runs)


def draw_profile(found: Profile, folder: Path, number: int) -> list[DrawnFigure]:
    """Write the figure of what axes cost; none of a profile without any result."""
    costs = {c.axis: (c.difference, c.found) for c in found.costs if c.axis not in NO_COST}
    if not costs:
        return []
    name = f"profile-{number}"
    with styled():
        save(charts.draw_costs(costs), folder, name)
    return [DrawnFigure(name, "What each axis costs", CAPTIONS["profile"])]


def _rates(scores: Scores) -> dict[str, Estimate]:
    """SR@1 of every category over its levels."""
    return {c: e for (c, n), a in scores.categories.items() if not n and (e := a.values.get("sr1"))}


def _own_figures(series: Series, number: int, mapped: bool) -> Figures:
    ending = f"-{number}" if number else ""
    of = f": {series.name}" if number else ""
    found = series.failures
    if any(one.chosen for one in series.grounding.values()):
        bars = {
            head: {c: e for c, one in series.grounding.items() if (e := getattr(one, measure))}
            for measure, head in MEASURES.items()
        }
        title = f"Grounding and execution{of}"
        drawn = DrawnFigure(f"grounding{ending}", title, CAPTIONS["grounding"])
        yield drawn, charts.draw_bars(bars, "share [%]")
    counts = {
        t: found[t] for t in series.scores.tasks_by_category if any(found.get(t, {}).values())
    }
    if counts:
        drawn = DrawnFigure(f"failures{ending}", f"Failure types{of}", CAPTIONS["failures"])
        yield drawn, charts.draw_failures(counts, KINDS, NAMES)
    if series.scores.cells and mapped:
        drawn = DrawnFigure(f"heat{ending}", f"Tasks and levels{of}", CAPTIONS["heat"])
        yield drawn, charts.draw_heat(series)
