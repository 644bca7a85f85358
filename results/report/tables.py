"""Tables of a report: the paper's, cut to the tasks and levels of its runs.

Rows of tasks that no run of the report has are left out, so that a run of ten tasks is no page of
dashes; the notes below a table say how much was not run. Averages over tasks that were not run stay
open and are shown as dashes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from robospa.results.paper.columns import Column
from robospa.results.paper.other_tables import basic_table
from robospa.results.paper.result_tables import DASH, summary_table, task_table
from robospa.results.paper.tables import write_tables
from robospa.results.tables import Table, TableRow, html_fragment
from robospa.trial import METRIC_CATEGORIES

if TYPE_CHECKING:
    from markupsafe import Markup

FEW = 2
"""So many columns are shown with all their levels; more of them as in the paper."""
MOST_OPEN_ROWS = 30
"""Of a table of tasks beside others; a longer one is opened by hand."""
LONG = 250
"""Characters of a note; longer ones are opened by hand."""
SUMMARIES = (("main", "sr"), ("onta", "onta"), ("ps", "ps"))


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
    for name, metric in SUMMARIES:
        if any(_has(c, metric) for c in runs):
            table = summary_table(columns, name, metric, _heads(columns, levels, metric))
            made.append(ReportTable(covered(table, len(runs)), False))
    if any(c.covers_basic for c in runs):
        made.append(ReportTable(basic_table(columns), False))
    for _, metric in SUMMARIES:
        if any(_has(c, metric) for c in runs):
            table = task_table(columns, f"{metric}-tasks", metric)
            table = covered(table, len(runs))
            made.append(ReportTable(table, len(columns) > 1 and len(table.rows) > MOST_OPEN_ROWS))
    return [s for s in made if any(line.cells for line in s.table.rows)]


def _has(column: Column, metric: str) -> bool:
    categories = METRIC_CATEGORIES[metric]
    return any(cell.category in categories and cell.trials for cell in column.scores.cells.values())


def _heads(columns: Sequence[Column], levels: Sequence[int], metric: str) -> tuple[str, ...]:
    if len(columns) <= FEW or not {1, 5} <= set(levels):
        return tuple(f"L{level}" for level in levels)
    return ("L1", "L3", "L5") if metric != "sr" else ("L1", "L5", "Drop")


def covered(table: Table, runs: int) -> Table:
    """`table` without the rows that none of its first `runs` columns has a value in."""
    width = len(table.heads) // max(1, len(table.groups)) * runs
    kept: list[TableRow] = []
    for line in table.rows:
        if line.kind == "section" or any(e.text != DASH.text for e in line.cells[:width]):
            kept.append(line)
    after = [line.kind for line in kept[1:]] + ["section"]
    pairs = list(zip(kept, after, strict=False))
    full = [line for line, kind in pairs if line.kind != "section" or kind != "section"]
    return _levels_that_were_run(replace(table, rows=tuple(full)), runs)


def _levels_that_were_run(table: Table, runs: int) -> Table:
    """`table` without the levels at which its first `runs` groups have no value at all."""
    width = len(table.heads) // max(1, len(table.groups))
    cells = [line.cells for line in table.rows if line.kind != "section"]
    kept = [
        place
        for place in range(width)
        if any(row[n * width + place].text != DASH.text for row in cells for n in range(runs))
    ]
    if not cells or len(kept) == width:
        return table
    places = [n * width + place for n in range(len(table.heads) // width) for place in kept]
    lines = [
        line
        if line.kind == "section"
        else replace(line, cells=tuple(line.cells[p] for p in places))
        for line in table.rows
    ]
    return replace(
        table,
        heads=tuple(table.heads[p] for p in places),
        groups=tuple((title, len(kept)) for title, _ in table.groups),
        rows=tuple(lines),
    )


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
        paper_table = replace(table.table, notes=new)
        if not table.folded:
            said.update(new)
        long = [note for note in paper_table.notes if len(note) > LONG]
        short = replace(
            paper_table, notes=tuple(note for note in paper_table.notes if note not in long)
        )
        html = Markup(html_fragment(short))
        made.append(PageTable(paper_table.title, html, table.folded, long))
    return made


def write_files(tables: Sequence[ReportTable], folder: Path) -> None:
    """The same tables for papers and programs: LaTeX and CSV."""
    if tables:
        write_tables([t.table for t in tables], folder, ("tex", "csv"))
