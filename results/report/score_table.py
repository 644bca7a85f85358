"""A run's scores as a table for the print_scores."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from robospa.results.records.action_problems import problem_lines
from robospa.results.records.manifest import departures
from robospa.results.records.run_io import Run
from robospa.results.records.settings_of_run import setting_name
from robospa.results.report.faults import policy_error_lines, repeat_lines
from robospa.results.report.missing import loss_lines, missing_lines
from robospa.results.report.run_card import ends
from robospa.results.scoring.score_json import level_name
from robospa.results.scoring.scores import AverageScore, Scores, VariantScore
from robospa.results.statistics.intervals import Estimate
from robospa.results.tables import MISSING, Table, TableCell, TableRow, show
from robospa.text import plain_console
from robospa.trial import BASIC, CATEGORIES, CATEGORY_NAMES, DIMENSIONS, REFERENCE


@dataclass(frozen=True)
class ScoreRow:
    """One line of a table: `cells` holds (level, cell or average), level 0 the mean of levels."""

    label: str
    kind: str
    parts: tuple[tuple[int, VariantScore | AverageScore | None], ...]
    category: str = ""


def percent(estimate: Estimate | None, digits: int = 1) -> str:
    """`12.0 [5.6, 23.8]`, or a dash."""
    if estimate is None:
        return "–"
    value, low, high = (f"{100 * x:z.{digits}f}" for x in _all(estimate))
    return f"{value} [{low}, {high}]"


def short(estimate: Estimate | None) -> str:
    """The value alone, without decimals where there are none."""
    return "–" if estimate is None else f"{100 * estimate.value:.1f}"


def _all(estimate: Estimate) -> tuple[float, float, float]:
    return estimate.value, estimate.low, estimate.high


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


def score_table(run: Run, scores: Scores) -> Table:
    """The success rates of `run` by level, with the metrics of the mean over levels."""
    table_rows = rows(scores)
    if all(category_size(scores, row) < 2 for row in table_rows):
        table_rows = [
            row for row in table_rows if row.kind != "category"
        ]  # they would repeat their task
    departs = "".join(f" ({one})" for one in departures(run.manifest))
    heads = (*map(level_name, scores.levels), "SR [95 %]", "ONTA", "PS", "trials")
    return Table(
        "scores",
        f"{run.manifest.policy.name or 'policy'}{departs}{_where(run)}",
        "",
        heads,
        tuple(_table_row(row) for row in table_rows),
    )


def _where(run: Run) -> str:
    """The robot and the scene mode, where they are not the benchmark's usual ones."""
    name = setting_name(run)
    return "" if name == REFERENCE else f", {name}"


def _table_row(row: ScoreRow) -> TableRow:
    cells = [_level_cell(part) for level, part in row.parts if level]
    mean = dict(row.parts)[0]
    tail = ["", "", "", ""]
    if mean is not None:
        lost = f" -{mean.missing}" if mean.missing else ""
        tail = [
            percent(mean.values.get("sr")),
            short(mean.values["onta"]) if "onta" in mean.values else "",
            short(mean.values["ps"]) if "ps" in mean.values else "",
            f"{mean.trials}{lost}",
        ]
    label = f"{row.category} {row.label}" if row.kind == "task" else row.label
    kind = "row" if row.kind == "task" else "average"
    return TableRow(label, (*cells, *map(TableCell, tail)), kind)


def _level_cell(part: VariantScore | AverageScore | None) -> TableCell:
    """A success rate, marked if trials are missing below it."""
    if part is None:
        return TableCell()
    return TableCell(short(part.values.get("sr")), sign=MISSING * bool(part.missing))


def print_scores(run: Run, scores: Scores) -> None:
    """Print the table of `run` on the terminal: how its trials ended, why some are missing, are
    policy errors or were repeated, which actions could not be executed as they were sent."""
    show(score_table(run, scores))
    console = plain_console(wide=130)
    console.print(_ends_line(run), style="dim", soft_wrap=True)
    lines = [*missing_lines(scores), *loss_lines(run), *policy_error_lines(run)]
    for line in [*lines, *repeat_lines(run), *problem_lines(run.records.values())]:
        console.print(line, style="yellow", soft_wrap=True)


def _ends_line(run: Run) -> str:
    """Number of trials by end, those without a result included."""
    counts = ", ".join(f"{count} {name}" for name, count in ends(run).items())
    note = f" ({MISSING} lacks trials)" if run.missing else ""
    return f"{len(run.keys)} trials: {counts}{note}"
