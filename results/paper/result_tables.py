"""The paper's tables of results, from any mix of published models and runs.

A value is printed as the paper prints it (`paper.rounding`). What a run lacks is a dash and a note,
what it lost is a † with the range that the lost trials leave open, and a published value that does
not follow from the per-task tables is a * with what was printed instead.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby

from robospa.results.paper import rounding
from robospa.results.paper.check import Check, errata
from robospa.results.paper.columns import Column, check_columns
from robospa.results.paper.origin import table_note
from robospa.results.paper.published import LEVELS, load, row_title, title
from robospa.results.scoring.models import in_official_world
from robospa.results.statistics.significance import supported_best
from robospa.results.tables import DASH, MISSING, PRINTED_OTHERWISE, Table, TableCell, TableRow
from robospa.trial import CATEGORY_NAMES, DIMENSIONS, METRIC_CATEGORIES, METRIC_NAMES

MARKS = ("tied", "highest", "none")
"""Which values are marked as best among the runs (in a table without runs among the published
models, beside runs of official worlds among all): those that are better than another and worse than
none (Boschloo's test or the interval of the difference, Benjamini-Hochberg over the table), the
highest, or none."""
DIMENSION_NAMES = {
    "spatial": "Fine-Grained Spatial Reasoning",
    "procedural": "Long-Horizon Procedural Planning",
}
_MARK_NOTES = {
    "tied": "Bold: significantly better than another value of the row and level, and worse than "
    "none (false discovery rate 5 % over the table).",
    "highest": "Bold: the highest value of a row and level.",
    "none": "",
}
LONG_NAMES = {
    "sr": "Success rate",
    "sr1": "Success rate by the first choice",
    "onta": "Object-normalized target accuracy",
    "onta1": "Object-normalized target accuracy by the first choice",
    "ps": "Progress score",
}
FIRST = (
    "The official rule (SR, ONTA) lets a policy try one object after another: one that reads "
    "nothing can solve 100 % of the spatial tasks. SR@1 and ONTA@1 count only successes with "
    "nothing else taken or pressed, and no step done early or repeated."
)
Marked = Mapping[tuple[str, int], set[str]]
"""Titles of the columns to mark, by row and level."""
CellMaker = Callable[[Column, str, str, Marked], TableCell]


def summary_table(
    columns: Sequence[Column],
    name: str,
    metric: str,
    heads: Sequence[str],
    mark: str = "tied",
    covering: Sequence[Column] = (),
) -> Table:
    """Categories, dimensions and the overall value of `metric` at some levels, or their drop; only
    the rows and levels that any of the columns `covering` has a value at, if there are some."""
    check_columns(columns)
    rows = [(row, label, "row" if row in CATEGORY_NAMES else "average" if row else "section")
            for row, label in _summary_rows(metric)]  # fmt: skip
    levels = [int(head[1]) for head in heads if head != "Drop"]
    data = load()
    redrawn = {"main": data.main, "onta": data.onta, "ps": data.ps}.get(name)
    wrong = _wrong(redrawn.source if redrawn else "")

    def cell(column: Column, row: str, head: str, best: Marked) -> TableCell:
        if head == "Drop":
            entry = _number(rounding.drop(*(column.value(metric, row, level) for level in levels)))
        else:
            level = int(head[1])
            entry = value_cell(column, metric, row, level, column.title in best[row, level])
        return _signed(entry, PRINTED_OTHERWISE * ((row, column.published, head) in wrong))

    made = (columns, metric, rows, tuple(heads), tuple(levels), mark, covering, wrong)
    return _made(*made, cell, name, "")


def task_table(
    columns: Sequence[Column],
    name: str,
    metric: str,
    mark: str = "tied",
    covering: Sequence[Column] = (),
) -> Table:
    """Every task at every level; see `summary_table` for `covering`."""
    check_columns(columns)
    data = load()
    tasks = [t for t in data.tasks.values() if t.category in METRIC_CATEGORIES[metric]]
    rows: list[tuple[str, str, str]] = []
    for category, members in groupby(tasks, key=lambda task: task.category):
        rows.append(("", f"{category} {CATEGORY_NAMES[category]}", "section"))
        rows += [(task.name, task.title, "row") for task in members]
    wrong = {
        key: check
        for column in columns
        if column.published
        if (column.published, metric) in data.per_task
        for key, check in _wrong(data.per_task[column.published, metric].source).items()
    }

    def cell(column: Column, row: str, head: str, best: Marked) -> TableCell:
        level = int(head[1])
        key = (data.tasks[row].printed, column.published, head)
        if key in wrong and metric == "ps":  # it is given there, not derived
            return _signed(_number(wrong[key].printed), PRINTED_OTHERWISE)
        entry = value_cell(column, metric, row, level, column.title in best[row, level])
        return _signed(entry, PRINTED_OTHERWISE * (key in wrong))

    heads = tuple(f"L{level}" for level in LEVELS)
    return _made(columns, metric, rows, heads, LEVELS, mark, covering, wrong, cell, name, "Task")


def _made(
    columns: Sequence[Column],
    metric: str,
    lines: Sequence[tuple[str, str, str]],
    heads: tuple[str, ...],
    levels: tuple[int, ...],
    mark: str,
    covering: Sequence[Column],
    wrong: Mapping[tuple[str, str, str], Check],
    cell: CellMaker,
    name: str,
    corner: str,
) -> Table:
    """A table of the `lines` (row, label, kind), with marks and notes that look at all of them and
    at all levels."""

    def covered(rows: Sequence[str], heads: Sequence[str]) -> bool:
        """Whether any of the columns `covering` has a value in these rows, under these heads."""
        wanted = [[int(h[1])] if h != "Drop" else levels for h in heads]
        return not covering or any(
            all(column.value(metric, row, level) is not None for level in those)
            for column in covering
            for row in rows
            for those in wanted
        )

    rows = [row for row, _, _ in lines if row]
    best = _best(columns, metric, rows, levels, mark)
    notes = _notes(columns, metric, rows, levels, mark, wrong)
    lines = [one for one in lines if not one[0] or covered([one[0]], heads)]
    after = [kind for _, _, kind in lines[1:]] + ["section"]
    pairs = zip(lines, after, strict=False)  # a section without rows is left out
    lines = [one for one, following in pairs if not one[2] == following == "section"]
    shown = [row for row, _, _ in lines if row]
    heads = tuple(head for head in heads if covered(shown, [head])) or heads
    made = tuple(
        TableRow(
            label,
            tuple(cell(column, row, head, best) for column in columns for head in heads if row),
            kind,
        )
        for row, label, kind in lines
    )
    groups = tuple((column.title, len(heads)) for column in columns)
    by = corner.lower() or "category"
    title = f"{LONG_NAMES[metric]} ({METRIC_NAMES[metric]}) in percent by {by}"
    return Table(name, title, corner, heads * len(columns), made, groups, notes)


def _summary_rows(metric: str) -> list[tuple[str, str]]:
    """(row, label) in the paper's order; a section's row is ""."""
    rows: list[tuple[str, str]] = []
    dimensions = [d for d in DIMENSIONS if set(DIMENSIONS[d]) <= set(METRIC_CATEGORIES[metric])]
    for dimension in dimensions:
        rows += [("", DIMENSION_NAMES[dimension])] * (len(dimensions) > 1)
        rows += [(category, CATEGORY_NAMES[category]) for category in DIMENSIONS[dimension]]
        rows.append((dimension, "Average"))
    if len(dimensions) > 1:
        rows += [("", "Overall"), (rounding.OVERALL, "Overall average")]
    return rows


def _best(
    columns: Sequence[Column], metric: str, rows: Sequence[str], levels: Sequence[int], mark: str
) -> dict[tuple[str, int], set[str]]:
    if mark not in MARKS:
        raise ValueError(f"no mark is called {mark!r}; there are {', '.join(MARKS)}")
    places = [(row, level) for row in rows for level in levels]
    rivals = [column for column in _one_suite(columns) if column.ranked]
    if mark == "none" or len(rivals) < 2:
        return {place: set() for place in places}
    if mark == "tied":
        entries = [[column.sample(metric, *place) for column in rivals] for place in places]
        marked = [{rivals[n].title for n in found} for found in supported_best(entries)]
        return dict(zip(places, marked, strict=True))
    made = {}
    for place in places:
        values = {c.title: c.value(metric, *place) for c in rivals}
        shown = {t: rounding.rounded(value) for t, value in values.items() if value is not None}
        top = max(shown.values(), default=0.0)
        made[place] = {title for title, value in shown.items() if value == top}
    return made


def _one_suite(columns: Sequence[Column]) -> list[Column]:
    """The columns that are ranked with each other: the runs, or the published models where there
    is no run, because they are of another suite; all of them if the runs are of official worlds."""
    runs = [column for column in columns if not column.published]
    official = all(in_official_world(column.results) for column in runs)
    return list(columns) if official else runs


def value_cell(column: Column, metric: str, row: str, level: int, best: bool = False) -> TableCell:
    """A value of `column` with its interval and what is missing; a dash where there is none."""
    value = column.value(metric, row, level)
    if value is None:
        return DASH
    whole = metric in ("sr", "sr1") and row in load().tasks and value == round(value)
    found = column.estimate(metric, row, level)
    low, high = (100 * found.low, 100 * found.high) if found else (None, None)
    entry = TableCell(rounding.text(value, 0 if whole else 1), value, low, high, best)
    return column.with_missing(entry, metric, row, level)


def _number(value: float | None) -> TableCell:
    return DASH if value is None else TableCell(rounding.text(value), value)


def _signed(entry: TableCell, sign: str) -> TableCell:
    return replace(entry, sign=entry.sign + sign)


def _wrong(source: str) -> Mapping[tuple[str, str, str], Check]:
    return {(c.row, c.model, c.column): c for c in errata() if c.source == source}


def _notes(
    columns: Sequence[Column],
    metric: str,
    rows: Sequence[str],
    levels: Sequence[int],
    mark: str,
    wrong: Mapping[tuple[str, str, str], Check],
) -> tuple[str, ...]:
    own = [column for column in _one_suite(columns) if not column.idle]
    runs = [c.results for c in columns if not c.published]
    notes = [FIRST] if metric == "sr1" else []
    notes += [table_note(runs)] if 0 < len(runs) < len(columns) else []
    notes += [_MARK_NOTES[mark]] if mark != "none" and len(own) > 1 else []
    models = {c.published for c in columns if c.published}
    listed = [
        f"{row_title(c.row)} {title(c.model)} {c.column} {rounding.text(c.printed, c.digits)}"
        for c in wrong.values()
        if c.model in models
    ]
    if listed and metric == "ps" and rows[0] in load().tasks:
        notes.append(f"{PRINTED_OTHERWISE} Does not follow from SR: {'; '.join(listed)}.")
    elif listed:
        notes.append(f"{PRINTED_OTHERWISE} The paper prints: {'; '.join(listed)}.")
    trials = load().trials
    for column in columns:
        if column.published or column.idle:
            continue
        if column.trials != trials:
            theirs = f", the published models {trials}" if models else ""
            notes.append(f"{column.title}: up to {column.trials} trials per variant{theirs}.")
        notes += not_run_note(column, levels)
        places = [(row, level) for row in rows for level in levels]
        lost = [text for place in places if (text := _lost(column, metric, *place))]
        if lost:
            notes.append(f"{MISSING} {column.title}, trials without a result: {'; '.join(lost)}.")
    return tuple(notes)


def not_run_note(column: Column, levels: Sequence[int]) -> list[str]:
    """A note on the number of the benchmark's tasks that `column` lacks at `levels`, or nothing."""
    lacking = [f"{n} at L{level}" for level in levels if (n := column.not_run(level))]
    if not lacking:
        return []
    total = len(load().tasks)
    if column.results.to_run:
        return [
            f"{column.title}: {column.results.to_run} trials are still to run; averages are over "
            "what has finished."
        ]
    return [
        f"{column.title}: not run are {', '.join(lacking)} of {total} tasks; averages over them "
        "are left out."
    ]


def _lost(column: Column, metric: str, row: str, level: int) -> str:
    part = column.scores.part(row, level)
    if part is None or not part.missing or not (metric in part.values or not part.trials):
        return ""
    name = load().tasks[row].title if row in load().tasks else row
    ends = part.bounds(metric)
    if ends is None:
        return f"{name} L{level} lacks {part.missing}"
    low, high = (f"{rounding.shown(100 * end):.1f}" for end in ends)
    return f"{name} L{level} lacks {part.missing}, {METRIC_NAMES[metric]} between {low} and {high}"
