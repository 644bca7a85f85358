"""A run's scores as rows: for the terminal, as Markdown and as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from robospa.categories import BASIC, CATEGORIES, CATEGORY_NAMES, DIMENSIONS, METRIC_NAMES, METRICS
from robospa.results.records.run_io import Run
from robospa.results.report.run_card import ends
from robospa.results.scoring.scores import Average, Cell, Scores
from robospa.results.statistics.intervals import Estimate
from robospa.results.tables.table import MISSING

NOTE = (
    "Values in percent with 95 % intervals: Wilson for success rates (SR) of single variants and "
    "their chance-corrected form (ONTA: 0 is guessing among the candidates), bootstrap over "
    "episodes for progress (PS), MOVER for averages. Categories are means of tasks; dimensions "
    "and the overall value are means of categories."
)


@dataclass(frozen=True)
class Row:
    """One line of a table: `cells` holds (level, cell or average), level 0 the mean of levels."""

    label: str
    kind: str
    parts: tuple[tuple[int, Cell | Average | None], ...]
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


def rows(scores: Scores) -> list[Row]:
    """Tasks grouped by category, then categories, dimensions and the overall value; basic grounding
    tasks come last among tasks, their categories after all else, because they enter no average."""
    levels = (*scores.levels, 0)
    made: list[Row] = []
    category_of = {task: cell.category for (task, _), cell in scores.cells.items()}
    ordered = [t for c in (*CATEGORIES, *BASIC, "") for t in category_of if category_of[t] == c]
    for task in ordered:
        cells = [(n, scores.cells.get((task, n))) for n in scores.levels]
        parts = (*cells, (0, scores.tasks[task]))
        made.append(Row(task.replace("_", " "), "task", parts, category_of[task]))
    made += _category_rows(scores, CATEGORIES, levels)
    for dimension in DIMENSIONS:
        if (dimension, 0) in scores.dimensions:
            parts = _averages(scores.dimensions, dimension, levels)
            made.append(Row(f"{dimension} categories", "dimension", parts))
    if scores.overall:
        made.append(Row("overall", "overall", tuple((n, scores.overall.get(n)) for n in levels)))
    return made + _category_rows(scores, BASIC, levels)


def _category_rows(scores: Scores, categories: Iterable[str], levels: tuple[int, ...]) -> list[Row]:
    return [
        Row(f"{c} {CATEGORY_NAMES[c]}", "category", _averages(scores.categories, c, levels), c)
        for c in categories
        if (c, 0) in scores.categories
    ]


def _averages(
    found: Mapping[tuple[str, int], Average], name: str, levels: tuple[int, ...]
) -> tuple[tuple[int, Cell | Average | None], ...]:
    return tuple((level, found.get((name, level))) for level in levels)


def category_size(scores: Scores, row: Row) -> int:
    """How many tasks a category's row sums up; 0 for other rows."""
    tasks = {task for (task, _), cell in scores.cells.items() if cell.category == row.category}
    return len(tasks) if row.kind == "category" else 0


def metrics_of(row: Row) -> list[str]:
    """The metrics that apply to `row`, in their order."""
    present = {m for _, part in row.parts if part is not None for m in part.values}
    return [m for m in METRICS if m in present]


def level_name(level: int) -> str:
    """Column title."""
    return f"L{level}" if level else "mean"


def _counts(part: Cell | Average) -> str:
    lost = f", {part.missing} missing" if part.missing else ""
    if isinstance(part, Cell):
        return f"{part.successes}/{part.trials}{lost}"
    return f"n={part.trials}{lost}"


def markdown_table(scores: Scores, metric: str) -> str:
    """One table of `metric`: a row a task, category..., a column a level."""
    levels = (*scores.levels, 0)
    title = " | ".join(level_name(n) for n in levels)
    lines = [f"| {METRIC_NAMES[metric]} [%] | {title} |", "|---|" + "---|" * len(levels)]
    for row in rows(scores):
        if metric in metrics_of(row):
            name = row.label if row.kind == "task" else f"**{row.label}**"
            texts = [_markdown_cell(part, metric) for _, part in row.parts]
            lines.append(f"| {name} | " + " | ".join(texts) + " |")
    return "\n".join(lines)


def _markdown_cell(part: Cell | Average | None, metric: str) -> str:
    if part is None:
        return ""
    text = percent(part.values.get(metric))
    if isinstance(part, Cell) and metric == "sr":
        text += f" ({_counts(part)})"
    elif part.missing and metric == "sr":
        text += f" ({part.missing} missing: {100 * part.worst:.1f} to {100 * part.best:.1f})"
    return text


def missing_lines(scores: Scores) -> list[str]:
    """One sentence for every variant that lacks trials."""
    return [
        f"{cell.task} L{cell.level}: {cell.missing} of {cell.listed} trials are missing; if all "
        f"had failed SR would be {100 * cell.worst:.1f}, if all had succeeded {100 * cell.best:.1f}"
        for cell in scores.cells.values()
        if cell.missing
    ]


def loss_lines(run: Run, most: int = 5) -> list[str]:
    """Why trials are missing, one sentence a reason, the most frequent first."""
    reasons: dict[str, int] = {}
    for key in run.missing:
        record = run.records.get(key)
        reason = "not run yet" if record is None else record.message or "no reason was recorded"
        reasons[reason] = reasons.get(reason, 0) + 1
    common = sorted(reasons.items(), key=lambda item: -item[1])
    lines = [f"missing {count}: {reason}" for reason, count in common[:most]]
    if rest := common[most:]:
        lines.append(f"missing {sum(n for _, n in rest)}: for {len(rest)} other reasons")
    return lines


def to_json(scores: Scores) -> dict[str, Any]:
    """All scores as JSON values; rates are fractions."""

    def part(item: Cell | Average) -> dict[str, Any]:
        data: dict[str, Any] = {"trials": item.trials, "missing": item.missing}
        if isinstance(item, Cell):
            data["successes"] = item.successes
        for metric, found in item.values.items():
            data[metric] = None if found is None else list(_all(found))
            if item.missing and (ends := item.bounds(metric)) is not None:
                data[f"{metric}_bounds"] = list(ends)
        return data

    def table(pairs: Iterable[tuple[tuple[str, int], Cell | Average]]) -> dict[str, Any]:
        made: dict[str, Any] = {}
        for (name, level), item in pairs:
            made.setdefault(name, {})[level_name(level)] = part(item)
        return made

    return {
        "estimate": ["value", "low", "high"],
        "variants": table(scores.cells.items()),
        "tasks": {name: part(item) for name, item in scores.tasks.items()},
        "categories": table(scores.categories.items()),
        "dimensions": table(scores.dimensions.items()),
        "overall": {level_name(n): part(item) for n, item in scores.overall.items()},
    }


def terminal(run: Run, scores: Scores) -> None:
    """Print the table of `run` on the terminal, which has these `scores`."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    shown = rows(scores)
    if all(category_size(scores, row) < 2 for row in shown):
        shown = [row for row in shown if row.kind != "category"]  # they would repeat their task
    name = run.info.policy or "policy"
    privileged = " (privileged: sees the exact state)" if run.info.privileged else ""
    table = Table(title=f"{name}{privileged}", title_justify="left", box=None, pad_edge=False)
    table.add_column("")
    for level in scores.levels:
        table.add_column(level_name(level), justify="right", no_wrap=True)
    table.add_column("SR [95 %]", justify="right", no_wrap=True)
    table.add_column("ONTA", justify="right")
    table.add_column("PS", justify="right")
    table.add_column("trials", justify="right")
    last = "task"
    for row in shown:
        if row.kind != last:
            table.add_section()
            last = row.kind
        mean = dict(row.parts)[0]
        cells = [_level_cell(p) for n, p in row.parts if n]
        tail = ["", "", "", ""]
        if mean is not None:
            lost = f" -{mean.missing}" if mean.missing else ""
            tail = [
                percent(mean.values.get("sr")),
                short(mean.values["onta"]) if "onta" in mean.values else "",
                short(mean.values["ps"]) if "ps" in mean.values else "",
                f"{mean.trials}{lost}",
            ]
        style = "" if row.kind == "task" else "bold"
        label = f"{row.category} {row.label}" if row.kind == "task" else row.label
        table.add_row(*(Text(t, style=style) for t in (label, *cells, *tail)))
    console = Console()
    if not console.is_terminal:
        console = Console(width=130)  # a file is as wide as the table needs
    console.print(table, highlight=False)
    console.print(_ends_line(run), style="dim", markup=False, highlight=False, soft_wrap=True)
    for line in [*missing_lines(scores), *loss_lines(run)]:
        console.print(line, style="yellow", markup=False, highlight=False, soft_wrap=True)


def _level_cell(part: Cell | Average | None) -> str:
    """A success rate, marked if trials are missing below it."""
    if part is None:
        return ""
    return short(part.values.get("sr")) + MISSING * bool(part.missing)


def _ends_line(run: Run) -> str:
    """How the trials ended: what is no result, and what a policy could not do, is never hidden."""
    counts = ", ".join(f"{count} {name}" for name, count in ends(run).items())
    note = f" ({MISSING} lacks trials)" if run.missing else ""
    return f"{len(run.keys)} trials: {counts}{note}"
