"""The content of a report of runs: scores, tables, figures, failures and notes.

Runs that cannot stand in one table (other embodiments, scenes, suites) still get their trials and
cards, and one sentence that says why there is no table. Rows of tasks that no run of the report has
are left out, so that a run of ten tasks is no page of dashes; the notes below a table say how much
was not run. Averages over tasks that were not run stay open and are shown as dashes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from robospa.results.comparison.compare import by_axis
from robospa.results.comparison.profile import CLEAN, Pair, Profile, flipped, profile_of
from robospa.results.failures.labels import Failure, distribution, failures_of
from robospa.results.figures.draw import draw
from robospa.results.figures.series import FORMATS, DrawnFigure, Series
from robospa.results.lint import lint_run, lint_runs
from robospa.results.paper.columns import (
    Column,
    check_columns,
    column_of,
    idle_column,
    results_beside_runs,
)
from robospa.results.paper.origin import banner, origin_of
from robospa.results.paper.result_tables import summary_table, task_table
from robospa.results.paper.tables import basic_table
from robospa.results.records.manifest import JOINTS
from robospa.results.records.runs import Run, by_setting, finished
from robospa.results.report.run_card import BESIDE, loss_lines, missing_lines, names_of
from robospa.results.scoring.grounding import ROWS, groundings
from robospa.results.scoring.models import (
    IncomparableError,
    ModelResults,
    by_track,
    restricted,
    results_of_run,
)
from robospa.results.scoring.safety import RunSafety, known_safety
from robospa.results.scoring.scores import Variant
from robospa.results.tables import ShownAsTables, Table, TableRow, html_fragment
from robospa.text import some
from robospa.trial import BASIC, METRIC_CATEGORIES, METRICS, TrialKey


@dataclass(frozen=True)
class Report:
    """The content of a report.

    `models` are the runs, then published models, over the variants that the runs have; `shared` are
    the same over the variants that all have. `banner` is what to know before they are compared.
    Of a run of axes `runs` has the clean trials alone, `profiles` what the axes cost, and `flipped`
    pairs whose outcome they changed.
    `failures` has the type of every failed trial of each run, `findings` is the output of `robospa
    lint`. `columns` and `tables` are empty where the runs cannot stand in one table.
    """

    runs: Sequence[Run]
    models: Sequence[ModelResults]
    shared: Sequence[ModelResults]
    banner: Sequence[str]
    columns: Sequence[Column]
    tables: Sequence[ReportTable]
    failures: Sequence[Mapping[TrialKey, Failure]]
    missing: Sequence[str]
    findings: Sequence[str]
    method: Sequence[str]
    profiles: Sequence[Profile] = ()
    flipped: Sequence[tuple[Run, str, Pair]] = ()

    @property
    def named_runs(self) -> list[tuple[str, Run]]:
        """Every run with its name."""
        return [(model.name, run) for model, run in zip(self.models, self.runs, strict=False)]


def make_report(
    runs: Run | Sequence[Run], published: Sequence[str] = (), ci: str = "wilson"
) -> Report:
    """The report of one or several runs.

    One of several robots or scene modes counts as one for each. `published` names published models
    to stand beside them, `ci` is one of `intervals.METHODS`.
    """
    whole = [runs] if isinstance(runs, Run) else list(runs)
    profiles = [profile_of(run) for run in whole if run.manifest.settings.profile]
    measured = [RunSafety(run, known) for run in whole if (known := known_safety(run))]
    parts = [part for run in whole for part in by_setting(run)]
    runs = [p for p in parts if not p.manifest.settings.profile or p.keys[0].mode == CLEAN]
    own = [results_of_run(run, name, ci) for run, name in zip(runs, names_of(runs), strict=True)]
    has_results = set().union(*map(with_results, own))
    others = [restricted(results_beside_runs(model, ci), has_results) for model in published]
    models = [*own, *others]
    lost = [(model.name, missing_lines(model.scores)) for model in own]
    lost += [(model.name, loss_lines(run)) for model, run in zip(own, runs, strict=True)]
    columns, refused = columns_of(models)
    return Report(
        runs,
        models,
        over_shared(models),
        banners(models),
        columns,
        [*_of_runs(profiles), *_tables(own, columns), *_of_runs(measured)],
        [failures_of(run.records.values()) for run in runs],
        [f"{name}: {line}" if len(runs) > 1 else line for name, lines in lost for line in lines],
        [*refused, *findings(whole)],
        [origin_of(own), *method_notes(columns)],
        profiles,
        [(run, *one) for run in whole if run.manifest.settings.profile for one in flipped(run)],
    )


def _of_runs(found: Sequence[ShownAsTables]) -> list[ReportTable]:
    """The tables of what was `found` of each run; those of several have names of their own."""
    ends = [f"-{number}" for number, _ in enumerate(found, 1)] if len(found) > 1 else [""]
    return [
        ReportTable(replace(table, name=table.name + end), False)
        for end, one in zip(ends, found, strict=False)
        for table in one.tables
    ]


def _tables(own: Sequence[ModelResults], columns: Sequence[Column]) -> list[ReportTable]:
    """The paper's tables, after those of one policy's robots, scene modes or splits, of grounding
    and execution, and of the trials that compare; of several tracks, one after the other."""
    tracks = by_track([column.results for column in columns])
    made = []
    for track, members in tracks.items():
        mine = [column for column in columns if column.results in members]
        runs = [model for model in own if model in members]
        axes = [table for metric in ("sr", "sr1") if (table := by_axis(runs, metric))]
        beside = [table for make in BESIDE if (table := make(runs))]
        ours = [ReportTable(table, table.name == "comparable") for table in beside]
        first = [ReportTable(table, False) for table in axes]
        for one in (*first, *report_tables(mine), *ours):
            table = one.table
            if len(tracks) > 1:
                title = f"{table.title}, track {track}"
                table = replace(table, name=f"{track}-{table.name}", title=title)
            made.append(ReportTable(table, one.folded))
    return made


def banners(models: Sequence[ModelResults]) -> list[str]:
    """What to know before `models` are compared."""
    found = []
    if others := [model.name for model in models if model.published]:
        found.append(banner(others, [one for one in by_track(models)[JOINTS] if not one.published]))
    if len(clocks := sorted({m.setting.clock for m in models if not m.published})) > 1:
        names = " and ".join(", ".join(clock) for clock in clocks)
        found.append(f"Latency comparison: the runs had the clocks {names}; none is ranked.")
    tracks = by_track(models)
    if any(len(alike) > 1 and not shared_variants(alike) for alike in tracks.values()):
        found.append("No variant has results from all of them: each mean covers other variants.")
    if len(tracks) > 1:
        found.append(
            f"Tracks {some([*tracks])} are of one benchmark and have tables of their own: what one "
            "answers in points or skills is never compared or ranked with what moves joints itself."
        )
    return found


def columns_of(models: Sequence[ModelResults]) -> tuple[list[Column], list[str]]:
    """A column for every model, or none and the reason in a sentence if it is a single run."""
    if all(m.to_run and not m.scores.cells for m in models):
        return [], []  # nothing has finished yet
    try:
        columns = [Column(m) if m.published else column_of(m) for m in models]
        for alike in by_track(models).values():
            check_columns([column for column in columns if column.results in alike])
    except IncomparableError as error:
        if len(models) > 1:
            raise
        return [], [f"No tables: {error}."]
    return columns, []


def draw_figures(
    runs: Sequence[Run],
    columns: Sequence[Column],
    folder: Path,
    formats: Sequence[str] = FORMATS,
    failures: Sequence[Mapping[TrialKey, Failure]] | None = None,
) -> list[DrawnFigure]:
    """The figures of `columns`, of which the first belong to `runs` with these `failures`."""
    series = []
    together = over_shared([column.results for column in columns])
    for number, column in enumerate(columns):
        if number >= len(runs):
            series.append(Series(column.title, column.scores, (), bool(column.published)))
            continue
        run = runs[number]
        records = tuple(r for r in run.records.values() if finished(r))
        known = None if failures is None else failures[number]
        name = column.title
        name += f" ({len(run.missing)} of {len(run.keys)} missing)" * bool(run.missing)
        by_task = distribution(records, failures=known)
        chosen = {c: one for (c, n), one in groundings(records).items() if not n and c in ROWS}
        track = ", ".join(column.results.setting.track)
        series.append(Series(name, column.scores, records, False, by_task, chosen, track))
    beside = [replace(s, scores=m.scores) for s, m in zip(series, together, strict=True)]
    return draw(series, folder, formats, beside) if series else []


def findings(runs: Sequence[Run]) -> list[str]:
    """Findings of `robospa report --lint` in the runs."""
    found = [f for run in runs for f in lint_run(run)]
    found += lint_runs(runs) if len(runs) > 1 else []
    return [str(f) for f in found]


def shared_variants(models: Sequence[ModelResults]) -> set[Variant]:
    """The variants that all `models` have results of; published ones do not restrict the basic
    grounding tasks, of which the paper prints no model's results."""
    basic = {v for m in models for v, cell in m.scores.cells.items() if cell.category in BASIC}
    found = [with_results(m) | (basic if m.published else set()) for m in models]
    return set.intersection(*found) if found else set()


def with_results(model: ModelResults) -> set[Variant]:
    """The variants that `model` has any result of."""
    return {variant for variant, cell in model.scores.cells.items() if cell.trials}


def over_shared(models: Sequence[ModelResults]) -> list[ModelResults]:
    """`models` as if each had run the variants only that its track shares; as they are if there is
    one alone, or if they share nothing. Runs in progress have only what they have results of."""
    begun = [restricted(m, with_results(m)) if m.to_run else m for m in models]
    tracks = by_track(models)
    shared = {t: shared_variants(found) for t, found in tracks.items() if len(found) > 1}
    return [
        restricted(model, variants)
        if (variants := shared.get(", ".join(model.setting.track)))
        else model
        for model in begun
    ]


FEW = 2
"""So many columns are shown with all their levels; more of them as in the paper."""
MOST_OPEN_ROWS = 8
"""Of a table of tasks; a longer one is opened by hand."""
LONG = 250
"""Characters of a note; longer ones are opened by hand."""


@dataclass(frozen=True)
class ReportTable:
    """A table of the report; a `folded` one is opened by hand."""

    table: Table
    folded: bool


def report_tables(columns: Sequence[Column]) -> list[ReportTable]:
    """The tables of `columns`; the ones that are published models come last in them."""
    runs = [c for c in columns if not c.published] or list(columns)
    levels = sorted({level for c in runs for _, level in c.scores.cells})
    made = []
    cells = [cell for column in runs for cell in column.scores.cells.values()]
    shown = {
        m: _beside(columns, runs, m)
        for m in METRICS
        if any(c.category in METRIC_CATEGORIES[m] and m in c.samples for c in cells)
    }
    for metric, beside in shown.items():
        heads, name = _heads(beside, levels, metric), "main" if metric == "sr" else metric
        table = summary_table(beside, name, metric, heads, covering=runs)
        made.append(ReportTable(table, metric not in ("sr", "sr1")))
    if any(c.covers_basic for c in runs):
        made.append(ReportTable(basic_table(columns, ("sr", "sr1")), False))
    for metric, beside in shown.items():
        table = task_table(beside, f"{metric}-tasks", metric, covering=runs)
        made.append(ReportTable(table, len(table.rows) > MOST_OPEN_ROWS))
    return [one for one in made if any(line.cells for line in one.table.rows)]


def _beside(columns: Sequence[Column], runs: Sequence[Column], metric: str) -> Sequence[Column]:
    """The columns of a table: what is not published of a model is no column, and progress stands
    beside that of doing nothing."""
    if metric in ("sr1", "onta1"):
        return runs
    idle = idle_column(runs) if metric == "ps" else None
    return [*columns, idle] if idle else columns


def _heads(columns: Sequence[Column], levels: Sequence[int], metric: str) -> tuple[str, ...]:
    if len(columns) <= FEW or not {1, 5} <= set(levels):
        return tuple(f"L{level}" for level in levels)
    return ("L1", "L3", "L5") if metric != "sr" else ("L1", "L5", "Drop")


def for_page(tables: Sequence[ReportTable]) -> list[dict[str, object]]:
    """Title and `html` of the tables for a page; a note stands below the first of the open tables
    that has it, and those too long for that are its `notes`."""
    from markupsafe import Markup

    made: list[dict[str, object]] = []
    said: set[str] = set()
    for table in tables:
        new = tuple(note for note in table.table.notes if table.folded or note not in said)
        if not table.folded:
            said.update(new)
        long, short = ([n for n in new if (len(n) > LONG) == is_long] for is_long in (True, False))
        rows = tuple(map(_short, table.table.rows))
        html = Markup(html_fragment(replace(table.table, notes=tuple(short), rows=rows)))
        title, folded = table.table.title, table.folded
        made.append({"title": title, "html": html, "folded": folded, "notes": long})
    return made


def _short(row: TableRow) -> TableRow:
    """`row` with its intervals beside the values' text, which the page shows if asked."""
    cells = (c if c.low is None else replace(c, text=c.text.split(" [")[0]) for c in row.cells)
    return replace(row, cells=tuple(cells))


AVERAGES = (
    "Values in percent. A category is the mean of its tasks; dimensions and the overall value are "
    "means of categories. ONTA is 0 for guessing among the candidates."
)
SINGLE = {"wilson": "Wilson's", "exact": "Clopper and Pearson's exact"}
"""Methods for the success rate of one variant, by the name of `intervals.METHODS`."""
BOOTSTRAP = "95 % intervals are the paper's: a bootstrap over the trials within each variant."
PROGRESS = "Intervals of progress are a bootstrap over trials."
PRINTED = (
    "Of published progress only the mean is known: its interval is rather too wide than too narrow."
)


def method_notes(columns: Sequence[Column]) -> list[str]:
    """The sentences for a report of `columns`; none if there are none."""
    if not columns:
        return []
    cells = [
        (c, estimate) for c in columns for cell in c.scores.cells.values()
        if (estimate := cell.values.get("ps")) is not None
    ]  # fmt: skip
    printed = any(column.published for column, _ in cells)
    ci = columns[0].scores.ci
    if ci == "bootstrap":
        return [AVERAGES, BOOTSTRAP, *[PRINTED] * printed]
    rates = (
        f"95 % intervals are over trials on other seeds: {SINGLE[ci]} for the rate of one variant; "
        "for an average MOVER, which combines the intervals of the variants below it."
    )
    resampled = any(not column.published for column, _ in cells)
    return [AVERAGES, rates, *[PROGRESS] * resampled, *[PRINTED] * printed]
