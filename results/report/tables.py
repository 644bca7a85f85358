"""Tables of a report: the paper's, cut to the tasks and levels of its runs.

Rows of tasks that no run of the report has are left out, so that a run of ten tasks is no page of
dashes; the notes below a table say how much was not run. Averages over tasks that were not run stay
open and are shown as dashes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from robospa.results.paper.columns import Column, idle_column
from robospa.results.paper.result_tables import summary_table, task_table
from robospa.results.paper.tables import basic_table
from robospa.results.scoring.models import ModelResults, by_track, restricted
from robospa.results.scoring.scores import Variant
from robospa.results.tables import Table, TableRow, html_fragment
from robospa.trial import BASIC, METRIC_CATEGORIES, METRICS

if TYPE_CHECKING:
    from markupsafe import Markup


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


def beside_runs(published: ModelResults, runs: Sequence[ModelResults]) -> ModelResults:
    """`published` over the variants that any of `runs` has results of."""
    return restricted(published, set().union(*map(with_results, runs)))


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
    shown = {m: _beside(columns, runs, m) for m in METRICS if any(_has(c, m) for c in runs)}
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


def _has(column: Column, metric: str) -> bool:
    categories = METRIC_CATEGORIES[metric]
    cells = column.scores.cells.values()
    return any(cell.category in categories and metric in cell.samples for cell in cells)


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


@dataclass(frozen=True)
class PageTable:
    """A table on the page; `notes` are those too long to stand below it."""

    title: str
    html: Markup
    folded: bool
    notes: Sequence[str]


def for_page(tables: Sequence[ReportTable]) -> list[PageTable]:
    """The tables for a page; a note stands below the first of the open tables that has it."""
    from markupsafe import Markup

    made: list[PageTable] = []
    said: set[str] = set()
    for table in tables:
        new = tuple(note for note in table.table.notes if table.folded or note not in said)
        if not table.folded:
            said.update(new)
        long, short = ([n for n in new if (len(n) > LONG) == is_long] for is_long in (True, False))
        rows = tuple(map(_short, table.table.rows))
        html = Markup(html_fragment(replace(table.table, notes=tuple(short), rows=rows)))
        made.append(PageTable(table.table.title, html, table.folded, long))
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
