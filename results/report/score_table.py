"""A run's scores as one table, and what is to be said below it: on a terminal and in a notebook."""

from collections import Counter
from dataclasses import replace
from html import escape
from itertools import compress

from robospa.results.failures.labels import NAMES, failures_of
from robospa.results.paper.rounding import OVERALL
from robospa.results.records.action_problems import grouped, problem_lines
from robospa.results.records.manifest import departures
from robospa.results.records.runs import Run, by_setting, finished, setting_name
from robospa.results.report.run_card import ends
from robospa.results.scoring.comparable import comparable_table
from robospa.results.scoring.first_choice import after_others
from robospa.results.scoring.grounding import grounding_table
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
from robospa.results.scoring.usage import usage_line, usage_table
from robospa.results.statistics.intervals import Estimate
from robospa.results.tables import (
    MISSING,
    Table,
    TableCell,
    TableRow,
    estimate_cell,
    html_fragment,
    show,
)
from robospa.text import counted, plain_console
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


def percent(estimate: Estimate | None) -> str:
    """`12.0 [5.6, 23.8]`, or a dash."""
    return estimate_cell(estimate).text


def short(estimate: Estimate | None) -> str:
    """The value alone."""
    return percent(estimate).partition(" ")[0]


def rows(scores: Scores) -> list[tuple[str, str]]:
    """(row, label) of tasks by category, then categories, dimensions and the overall value; basic
    grounding comes last among tasks, and its categories after all else: they enter no average.

    Without categories if each would repeat its task.
    """
    category = scores.category_of
    made = [(t, f"{category[t]} {t.replace('_', ' ')}") for t in scores.tasks_by_category]
    several = len(made) > len(set(category.values()))
    categories = [(c, f"{c} {CATEGORY_NAMES[c]}") for c in CATEGORIES + BASIC if several]
    made += [row for row in categories if row[0] in CATEGORIES]
    made += [*((d, f"{d} categories") for d in DIMENSIONS), (OVERALL, OVERALL)]
    made += [row for row in categories if row[0] in BASIC]
    return [row for row in made if scores.part(row[0], 0)]


TAIL = ("SR [95 %]", "SR@1 [95 %]", "ONTA", "ONTA@1", "PS", "idle PS", "trials")
"""Heads of what is told of the mean over levels."""


def score_table(run: Run, scores: Scores) -> Table:
    """The success rates of `run` by level, with the metrics of the mean over levels that it has."""
    departs = "".join(f" ({one})" for one in departures(run.manifest))
    title = f"{run.manifest.policy.name or 'policy'}{departs}{_where(run)}"
    heads = (*map(level_name, scores.levels), *TAIL)
    lines = [_table_row(scores, *row) for row in rows(scores)]
    filled = [any(line.cells[i].text for line in lines) for i in range(len(heads))]
    lines = [replace(line, cells=tuple(compress(line.cells, filled))) for line in lines]
    return Table("scores", title, "", tuple(compress(heads, filled)), tuple(lines))


def _where(run: Run) -> str:
    """The robot and the scene mode, where they are not the benchmark's usual ones."""
    name = setting_name(run)
    return "" if name == REFERENCE else f", {name}"


def _table_row(scores: Scores, row: str, label: str) -> TableRow:
    cells = [_level_cell(scores.part(row, level)) for level in scores.levels]
    mean = scores.part(row, 0)
    assert mean is not None, "rows have a mean"
    lost = f" -{mean.missing}" if mean.missing else ""
    tail = [percent(mean.values.get(metric)) for metric in ("sr", "sr1")]
    others = ("onta", "onta1", "ps", IDLE)
    tail += [short(mean.values[m]) if m in mean.values else "" for m in others]
    kind = "row" if row in scores.category_of else "average"
    return TableRow(label, (*cells, *map(TableCell, (*tail, f"{mean.trials}{lost}"))), kind)


def _level_cell(part: VariantScore | AverageScore | None) -> TableCell:
    if part is None:
        return TableCell()
    return TableCell(short(part.values.get("sr")), sign=MISSING * bool(part.missing))


BESIDE = (grounding_table, comparable_table, usage_table)
"""Tables that a report has beside the paper's."""


def print_scores(run: Run, results: ModelResults, beside: bool = True) -> None:
    """Print the scores of `run` on the terminal: how its trials ended, why some are missing, are
    policy errors or were repeated, which actions could not be executed as they were sent; `beside`:
    the smaller tables, too."""
    scores = results.scores
    for table in (score_table(run, scores), *(of([results]) for of in BESIDE if beside)):
        if table is not None:
            show(table)
    console = plain_console(wide=130)
    console.print(_ends_line(run), style="dim", soft_wrap=True)
    if used := usage_line(run.records.values()):
        console.print(f"used: {used}", style="dim", soft_wrap=True)
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
    kinds = Counter(NAMES[f.kind] for f in failures_of(run.records.values()).values())
    found = ", ".join(f"{count} {name}" for name, count in kinds.most_common())
    failures = [f"failures: {found}"] if found else []
    lines = [f"{counted(len(run.keys), 'trial')}: {counts}", *failures, *_hindrances(run)]
    lines.append(f"folder: {run.folder}")
    notes = "<br>".join(escape(line) for line in lines)
    return f"{html_fragment(_scores(run))}\n<p>{notes}</p>"


def _hindrances(run: Run) -> list[str]:
    return [*policy_error_lines(run), *problem_lines(run.records.values())]
