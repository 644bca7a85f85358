"""A run as one table, whatever it holds, and as what a notebook shows of it."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from html import escape

from robospa.results.failures.labels import NAMES, failures_of
from robospa.results.records.action_problems import problem_lines
from robospa.results.records.run_io import Run
from robospa.results.records.settings_of_run import by_setting, setting_name
from robospa.results.report.faults import policy_error_lines
from robospa.results.report.run_card import ends
from robospa.results.report.score_table import score_table
from robospa.results.scoring.scores import score_run
from robospa.results.tables import Table, TableCell, TableRow, html_fragment


def run_table(run: Run) -> Table:
    """The scores of `run`, and below them why trials ended in policy errors and what could not be
    executed as sent; of several robots, scene modes or splits a section each."""
    table = _scores(run)
    return replace(table, notes=(*table.notes, *_hindrances(run)))


def _scores(run: Run) -> Table:
    parts = by_setting(run)
    tables = [score_table(part, score_run(part)) for part in parts]
    if len(tables) == 1:
        return tables[0]
    *_, tail = (table.heads[-4:] for table in tables)
    levels = sorted({head for table in tables for head in table.heads[:-4]})
    heads = (*levels, *tail)
    rows: list[TableRow] = []
    for part, table in zip(parts, tables, strict=True):
        rows.append(TableRow(setting_name(part), kind="section"))
        rows += [_spread(row, table.heads, heads) for row in table.rows]
    title = run.manifest.policy.name or "policy"
    return replace(tables[0], title=title, heads=heads, rows=tuple(rows))


def _spread(row: TableRow, heads: tuple[str, ...], wanted: tuple[str, ...]) -> TableRow:
    """`row` with its cells below the columns `wanted`, empty where it has none."""
    cells = dict(zip(heads, row.cells, strict=True))
    return replace(row, cells=tuple(cells.get(head, TableCell()) for head in wanted))


def run_html(run: Run) -> str:
    """Scores, how trials ended, types of failure, and what was executed otherwise than sent."""
    counts = ", ".join(f"{count} {name}" for name, count in ends(run).items())
    lines = [f"{len(run.keys)} trials: {counts}", *_lines(run), f"folder: {run.folder}"]
    notes = "<br>".join(escape(line) for line in lines)
    return f"{html_fragment(_scores(run))}\n<p>{notes}</p>"


def _lines(run: Run) -> list[str]:
    kinds = Counter(NAMES[f.kind] for f in failures_of(run.records.values()).values())
    found = ", ".join(f"{count} {name}" for name, count in kinds.most_common())
    failures = [f"failures: {found}"] if found else []
    return [*failures, *_hindrances(run)]


def _hindrances(run: Run) -> list[str]:
    return [*policy_error_lines(run), *problem_lines(run.records.values())]
