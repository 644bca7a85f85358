"""A run's scores as one table, and what is to be said below it: on a terminal and in a notebook."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from html import escape
from itertools import compress

from robospa.results.failures.labels import NAMES, failures_of
from robospa.results.paper.rounding import rounded, text
from robospa.results.records.action_problems import grouped, problem_lines
from robospa.results.records.manifest import departures
from robospa.results.records.runs import Run, by_setting, finished, setting_name
from robospa.results.report.run_card import ends
from robospa.results.scoring.comparable import comparable_table
from robospa.results.scoring.first_choice import after_others
from robospa.results.scoring.models import ModelResults
from robospa.results.scoring.repeats import policy_error_lines, repeat_lines
from robospa.results.scoring.scores import (
    IDLE,
    AverageScore,
    Scores,
    VariantScore,
    level_name,
    score_run,
)
from robospa.results.statistics.intervals import Estimate
from robospa.results.tables import MISSING, Table, TableCell, TableRow, html_fragment, show
from robospa.text import counted, interval_text, plain_console
from robospa.trial import BASIC, CATEGORIES, CATEGORY_NAMES, DIMENSIONS, REFERENCE


def missing_lines(scores: Scores) -> list[str]:
    """One sentence for every variant that lacks trials."""
    lines = []
    for cell in scores.cells.values():
        sr, first = (cell.bounds(metric) or (0.0, 1.0) for metric in ("sr", "sr1"))
        text = (
            f"{cell.task} L{cell.level}: {cell.missing} of {cell.listed} trials are missing; if "
            f"all had failed SR would be {100 * sr[0]:.1f} and SR@1 {100 * first[0]:.1f}, if all "
            f"had succeeded {100 * sr[1]:.1f} and {100 * first[1]:.1f}"
        )
        lines += [text] * bool(cell.missing)
    return lines


def loss_lines(run: Run, most: int = 5) -> list[str]:
    """The reasons for missing trials, one sentence a reason, the most frequent first."""
    records = [run.records.get(key) for key in run.missing]
    reasons = ["not run yet" if r is None else r.message for r in records]
    return [f"missing {count}: {reason}" for count, reason in grouped(reasons, most)]


@dataclass(frozen=True)
class ScoreRow:
    """One line of a table: `cells` holds (level, cell or average), level 0 the mean of levels."""

    label: str
    kind: str
    parts: tuple[tuple[int, VariantScore | AverageScore | None], ...]
    category: str = ""


def percent(estimate: Estimate | None) -> str:
    """`12.0 [5.6, 23.8]`, or a dash; rounded as everywhere (`paper.rounding`)."""
    if estimate is None:
        return "–"
    return interval_text(*(rounded(100 * x) for x in (estimate.value, estimate.low, estimate.high)))


def short(estimate: Estimate | None) -> str:
    """The value alone."""
    return "–" if estimate is None else text(100 * estimate.value)


def rows(scores: Scores) -> list[ScoreRow]:
    """Tasks grouped by category, then categories, dimensions and the overall value; basic grounding
    tasks come last among tasks, their categories after all else, because they enter no average."""
    levels = (*scores.levels, 0)
    made: list[ScoreRow] = []
    for task in scores.tasks_by_category:
        cells = [(n, scores.cells.get((task, n))) for n in scores.levels]
        parts = (*cells, (0, scores.tasks[task]))
        made.append(ScoreRow(task.replace("_", " "), "task", parts, scores.category_of[task]))
    made += _category_rows(scores, CATEGORIES, levels)
    for dimension in DIMENSIONS:
        if (dimension, 0) in scores.dimensions:
            parts = _averages(scores.dimensions, dimension, levels)
            made.append(ScoreRow(f"{dimension} categories", "dimension", parts))
    if scores.overall:
        made.append(
            ScoreRow("overall", "overall", tuple((n, scores.overall.get(n)) for n in levels))
        )
    return made + _category_rows(scores, BASIC, levels)


def _category_rows(
    scores: Scores, categories: Iterable[str], levels: tuple[int, ...]
) -> list[ScoreRow]:
    return [
        ScoreRow(f"{c} {CATEGORY_NAMES[c]}", "category", _averages(scores.categories, c, levels), c)
        for c in categories
        if (c, 0) in scores.categories
    ]


def _averages(
    found: Mapping[tuple[str, int], AverageScore], name: str, levels: tuple[int, ...]
) -> tuple[tuple[int, VariantScore | AverageScore | None], ...]:
    return tuple((level, found.get((name, level))) for level in levels)


def category_size(scores: Scores, row: ScoreRow) -> int:
    """Number of tasks below a category's row; 0 for other rows."""
    return [*scores.category_of.values()].count(row.category) if row.kind == "category" else 0


TAIL = ("SR [95 %]", "SR@1 [95 %]", "ONTA", "ONTA@1", "PS", "idle PS", "trials")
"""Heads of what is told of the mean over levels."""


def score_table(run: Run, scores: Scores) -> Table:
    """The success rates of `run` by level, with the metrics of the mean over levels that it has."""
    table_rows = rows(scores)
    if all(category_size(scores, row) < 2 for row in table_rows):
        table_rows = [
            row for row in table_rows if row.kind != "category"
        ]  # they would repeat their task
    departs = "".join(f" ({one})" for one in departures(run.manifest))
    title = f"{run.manifest.policy.name or 'policy'}{departs}{_where(run)}"
    heads = (*map(level_name, scores.levels), *TAIL)
    lines = [_table_row(row) for row in table_rows]
    filled = [any(line.cells[i].text for line in lines) for i in range(len(heads))]
    lines = [replace(line, cells=tuple(compress(line.cells, filled))) for line in lines]
    return Table("scores", title, "", tuple(compress(heads, filled)), tuple(lines))


def _where(run: Run) -> str:
    """The robot and the scene mode, where they are not the benchmark's usual ones."""
    name = setting_name(run)
    return "" if name == REFERENCE else f", {name}"


def _table_row(row: ScoreRow) -> TableRow:
    cells = [_level_cell(part) for level, part in row.parts if level]
    mean = dict(row.parts)[0]
    tail = [""] * len(TAIL)
    if mean is not None:
        lost = f" -{mean.missing}" if mean.missing else ""
        rates = [percent(mean.values.get(metric)) for metric in ("sr", "sr1")]
        others = ("onta", "onta1", "ps", IDLE)
        shorts = [short(mean.values[m]) if m in mean.values else "" for m in others]
        tail = [*rates, *shorts, f"{mean.trials}{lost}"]
    label = f"{row.category} {row.label}" if row.kind == "task" else row.label
    kind = "row" if row.kind == "task" else "average"
    return TableRow(label, (*cells, *map(TableCell, tail)), kind)


def _level_cell(part: VariantScore | AverageScore | None) -> TableCell:
    if part is None:
        return TableCell()
    return TableCell(short(part.values.get("sr")), sign=MISSING * bool(part.missing))


def print_scores(run: Run, results: ModelResults) -> None:
    """Print the tables of `run` on the terminal: how its trials ended, why some are missing, are
    policy errors or were repeated, which actions could not be executed as they were sent."""
    scores = results.scores
    for table in (score_table(run, scores), comparable_table([results])):
        if table is not None:
            show(table)
    console = plain_console(wide=130)
    console.print(_ends_line(run), style="dim", soft_wrap=True)
    lines = [*missing_lines(scores), *loss_lines(run), *policy_error_lines(run)]
    odd = after_others([r for r in run.records.values() if finished(r)])
    for line in [
        *lines,
        *[odd] * bool(odd),
        *repeat_lines(run),
        *problem_lines(run.records.values()),
    ]:
        console.print(line, style="yellow", soft_wrap=True)


def _ends_line(run: Run) -> str:
    counts = ", ".join(f"{count} {name}" for name, count in ends(run).items())
    note = f" ({MISSING} lacks trials)" if run.missing else ""
    return f"{counted(len(run.keys), 'trial')}: {counts}{note}"


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
    found = {head for table in tables for head in table.heads}
    heads = (*sorted(found.difference(TAIL)), *(head for head in TAIL if head in found))
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
    lines = [f"{counted(len(run.keys), 'trial')}: {counts}", *_lines(run), f"folder: {run.folder}"]
    notes = "<br>".join(escape(line) for line in lines)
    return f"{html_fragment(_scores(run))}\n<p>{notes}</p>"


def _lines(run: Run) -> list[str]:
    kinds = Counter(NAMES[f.kind] for f in failures_of(run.records.values()).values())
    found = ", ".join(f"{count} {name}" for name, count in kinds.most_common())
    failures = [f"failures: {found}"] if found else []
    return [*failures, *_hindrances(run)]


def _hindrances(run: Run) -> list[str]:
    return [*policy_error_lines(run), *problem_lines(run.records.values())]
