"""All tables of the paper by name: those of results are in `result_tables`, the others here."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from robospa.results.paper import rounding
from robospa.results.paper.check import checks, errata
from robospa.results.paper.columns import Column, check_columns, check_worlds
from robospa.results.paper.origin import printed_note, table_note
from robospa.results.paper.published import load, row_title, title
from robospa.results.paper.result_tables import (
    DIMENSION_NAMES,
    not_run_note,
    summary_table,
    task_table,
    value_cell,
)
from robospa.results.statistics.intervals import Estimate, interval_of
from robospa.results.tables import (
    DASH,
    MISSING,
    Table,
    TableCell,
    TableRow,
    estimate_cell,
    html_page,
    latex_document,
    to_csv,
    to_latex,
    to_markdown,
)
from robospa.trial import BASIC, CATEGORY_NAMES, DIMENSIONS, METRIC_NAMES

INTERVAL_METHODS = (("bootstrap", "Stratified bootstrap"), ("wilson", "MOVER on Wilson limits"))


def interval_table(columns: Sequence[Column]) -> Table:
    """Success at L5 with intervals by two methods; of published models also as printed."""
    check_columns(columns)
    data = load()
    level, rows = data.intervals.level, (*DIMENSIONS, rounding.OVERALL)
    lines = []
    for column in columns:
        entries = [
            _interval(column, row, level, method) for method, _ in INTERVAL_METHODS for row in rows
        ]
        lines.append(TableRow(column.title, tuple(entries)))
        printed = data.intervals.rows.get(column.published)
        if printed:
            given = [
                estimate_cell(Estimate(value / 100, low / 100, high / 100))
                for value, low, high in (printed[row] for row in rows)
            ]
            blank = [TableCell()] * len(rows)
            lines.append(TableRow(f"{column.title}, as printed", (*given, *blank)))
    heads = ("Fine-grained", "Long-horizon", "Overall") * len(INTERVAL_METHODS)
    groups = tuple((name, len(rows)) for _, name in INTERVAL_METHODS)
    runs = [column.results for column in columns if not column.published]
    notes = (
        "The bootstrap resamples trials within every variant (10,000 times): the same tasks, other "
        "seeds. MOVER combines Wilson limits of the single variants and needs no seed; it stays "
        "honest where all trials of a variant fail.",
        *([table_note(runs)] if 0 < len(runs) < len(columns) else []),
        *_open_notes(columns, level),
    )
    name = "Success rate (SR) at L5 in percent with 95 % intervals"
    return Table("intervals", name, "Model", heads, tuple(lines), groups, notes)


def _open_notes(columns: Sequence[Column], level: int) -> list[str]:
    notes: list[str] = []
    for column in columns:
        notes += not_run_note(column, [level])
        part = column.scores.part(rounding.OVERALL, level)
        if part is not None and part.missing:
            low, high = (rounding.shown(100 * end) for end in part.bounds("sr") or (0.0, 1.0))
            notes.append(
                f"{MISSING} {column.title}: {part.missing} trials at L{level} have no result; over "
                f"what is listed SR lies between {rounding.text(low)} and {rounding.text(high)}."
            )
    return notes


def _interval(column: Column, row: str, level: int, method: str) -> TableCell:
    samples, shares = column.samples(row, level)
    if not samples:
        return DASH
    found = interval_of(samples, shares, method)
    value = column.value("sr", row, level) or 0.0
    entry = estimate_cell(replace(found, value=value / 100))
    return column.with_missing(entry, "sr", row, level)


def embodiment_table(dimension: str, columns: Sequence[Column] = ()) -> Table:
    """One task a category on five robots; runs are rows beside those of their robot."""
    table, data = load().embodiments, load()
    shorts = [s for s, t in table.tasks.items() if data.tasks[t].category in DIMENSIONS[dimension]]
    levels = [int(name[1]) for name in table.columns]
    lines = []
    runs = [column for column in columns if not column.published]
    for robot in dict.fromkeys((*table.rows, *(column.embodiment for column in runs))):
        name = table.names.get(robot, robot)
        if row := table.rows.get(robot):
            printed = [TableCell(rounding.text(x, 0), x) for s in shorts for x in row[s]]
            lines.append(TableRow(f"{table.model}, {name}", tuple(printed)))
        for column in runs:
            if column.embodiment == robot:
                entries = [
                    value_cell(column, "sr", table.tasks[s], n) for s in shorts for n in levels
                ]
                lines.append(TableRow(f"{column.title}, {name}", tuple(entries)))
    groups = tuple((short, len(levels)) for short in shorts)
    names = "; ".join(f"{s} {data.tasks[table.tasks[s]].title}" for s in shorts)
    lost = any(entry.sign for line in lines for entry in line.cells)
    notes = (
        f"{names}.",
        *([printed_note([run.results for run in runs])] if runs else []),
        *([f"{MISSING} Some trials have no result."] if lost else []),
    )
    return Table(
        f"embodiments-{dimension}",
        f"Success rate (SR) in percent by embodiment: {DIMENSION_NAMES[dimension]}",
        "Model, embodiment",
        table.columns * len(shorts),
        tuple(lines),
        groups,
        notes,
    )


def _words(*texts: object) -> tuple[TableCell, ...]:
    return tuple(TableCell(str(text)) for text in texts)


def basic_table(columns: Sequence[Column] = (), metrics: Sequence[str] = ("sr",)) -> Table:
    """Basic grounding tasks, which are no part of the 56: the printed values, and those of runs.

    A run's value is the mean over the sets of objects; it stays open unless all were run.
    """
    table = load().basic_grounding
    runs = [(c, metric) for c in columns if c.covers_basic for metric in metrics]
    heads = table.columns
    names = {CATEGORY_NAMES[category]: category for category in BASIC}
    lines = []
    for name, printed in table.rows.items():
        entries = [TableCell(rounding.text(x), x) for x in printed]
        for run, metric in runs:
            category = names[name]
            entries += [_grounding(run, metric, category, int(h[1]), table.tasks) for h in heads]
        lines.append(TableRow(name, tuple(entries)))
    titles = ["Printed", *(c.title + (m != "sr") * f" {METRIC_NAMES[m]}" for c, m in runs)]
    groups = tuple((name, len(heads)) for name in titles) if runs else ()
    notes = [
        f"Means over {table.tasks} tasks of {table.trials} trials; "
        "the paper does not name the model."
    ]
    if runs:
        notes.append(printed_note([run.results for run, metric in runs if metric == "sr"]))
        notes.append(
            "Intervals of runs are 95 % intervals of the mean over the tasks; it stays open where "
            "not all of them were run."
        )
    if any(entry.sign for line in lines for entry in line.cells):
        notes.append(f"{MISSING} Some trials have no result.")
    name = "Success rate (SR) in percent on basic spatial tasks"
    return Table("basic", name, "Task", heads * (1 + len(runs)), tuple(lines), groups, tuple(notes))


def _grounding(run: Column, metric: str, category: str, level: int, sets: int) -> TableCell:
    part = run.scores.categories.get((category, level))
    found = None if part is None else part.values.get(metric)
    if part is None or found is None:
        return DASH
    cells = run.scores.cells.items()
    if sum(cell.category == category and n == level for (_, n), cell in cells) < sets:
        return DASH
    return estimate_cell(found, sign=MISSING * bool(part.missing))


def models_table() -> Table:
    """Size and training of the published models."""
    lines = tuple(
        TableRow(
            title(model),
            (
                TableCell(row.parameters),
                *(TableCell(f"{n:g}", n) for n in (row.gpus, row.hours, row.gpu_hours)),
            ),
        )
        for model, row in load().models.items()
    )
    heads = ("Parameters", "GPUs", "Hours", "GPU hours")
    return Table("models", "Model size and training per base task", "Model", heads, lines)


def datasets_table() -> Table:
    """Data sets and benchmarks beside RoboSPA."""
    table = load().datasets
    lines, last = [], ""
    for row in table.rows:
        if row.kind != last:
            last = row.kind
            lines.append(
                TableRow({"dataset": "Datasets", "benchmark": "Benchmarks"}[last], (), "section")
            )
        counts = (row.categories, row.tasks, row.trajectories, row.embodiments)
        has = (
            *(row.spatial_reasoning, row.long_horizon, row.step_level),
            *(row.multi_difficulty, row.scene_diversity),
        )
        words = (*(count or "–" for count in counts), *("yes" if part else "no" for part in has))
        lines.append(TableRow(row.name, _words(*words)))
    heads = (
        *("Categories", "Tasks", "Trajectories", "Embodiments", "Spatial reasoning"),
        *("Long-horizon", "Step-level", "Multi-difficulty", "Scene diversity"),
    )
    notes = (table.note,)
    name = "Robot manipulation datasets and benchmarks"
    return Table("datasets", name, "Name", heads, tuple(lines), notes=notes, words=True)


def assets_table() -> Table:
    """Object categories and their variants."""
    table = load().assets
    rows = tuple(TableRow(name, (TableCell(str(n), n),)) for name, n in table.rows.items())
    total = sum(table.rows.values())
    lines = (*rows, TableRow("Total", (TableCell(str(total), total),), "average"))
    name = f"Object categories ({len(rows)}) and variants of each"
    return Table("assets", name, "Asset", ("Variants",), lines)


def errata_table() -> Table:
    """Every printed value that does not follow from the per-task tables."""
    lines = tuple(
        TableRow(
            check.table,
            _words(
                row_title(check.row),
                title(check.model),
                check.column,
                rounding.text(check.printed, check.digits),
                rounding.text(check.recomputed, check.digits),
                check.reason or "–",
            ),
        )
        for check in errata()
    )
    derived = sum(check.derived for check in checks())
    notes = (
        f"{len(checks())} printed cells were walked, {derived} of them follow from others. "
        "Interval ends count as reproduced within 0.1; all else to the printed digit.",
    )
    heads = ("Row", "Model", "Column", "Printed", "Recomputed", "Remark")
    name = "Printed values that do not follow from the per-task tables"
    return Table("errata", name, "Table", heads, lines, notes=notes, words=True)


Maker = Callable[[Sequence[Column], str], Table]

TABLES: dict[str, Maker] = {
    "main": lambda c, m: summary_table(c, "main", "sr", ("L1", "L5", "Drop"), m),
    "onta": lambda c, m: summary_table(c, "onta", "onta", ("L1", "L3", "L5"), m),
    "ps": lambda c, m: summary_table(c, "ps", "ps", ("L1", "L3", "L5"), m),
    "intervals": lambda c, m: interval_table(c),
    "sr-tasks": lambda c, m: task_table(c, "sr-tasks", "sr", m),
    "onta-tasks": lambda c, m: task_table(c, "onta-tasks", "onta", m),
    "ps-tasks": lambda c, m: task_table(c, "ps-tasks", "ps", m),
    "embodiments-spatial": lambda c, m: embodiment_table("spatial", c),
    "embodiments-procedural": lambda c, m: embodiment_table("procedural", c),
    "basic": lambda c, m: basic_table(c),
    "models": lambda c, m: models_table(),
    "datasets": lambda c, m: datasets_table(),
    "assets": lambda c, m: assets_table(),
    "errata": lambda c, m: errata_table(),
}
"""Name -> what makes it from columns and a way of marking the best (`tables_paper.MARKS`)."""

FORMATS: dict[str, Callable[[Sequence[Table]], str]] = {
    "md": lambda tables: "\n".join(to_markdown(table) for table in tables),
    "tex": latex_document,
    "html": lambda tables: html_page(tables, "RoboSPA: results"),
    "csv": to_csv,
}
"""Ending -> what writes several tables as one file."""


def make_tables(
    columns: Sequence[Column], names: Sequence[str] | None = None, mark: str = "tied"
) -> list[Table]:
    """The tables called `names` (default all); ValueError if one is unknown.

    Runs of basic grounding tasks alone appear in the table of these only. IncomparableError if runs
    of official worlds and of this benchmark's own suites are mixed.
    """
    chosen = list(TABLES) if names is None else list(names)
    for name in chosen:
        if name not in TABLES:
            raise ValueError(f"no table is called {name!r}; there are {', '.join(TABLES)}")
    check_worlds(columns)
    base = [column for column in columns if column.covers_benchmark]
    alike = like_paper(columns)

    def shown(name: str) -> Sequence[Column]:
        if name.startswith("embodiments-"):
            return base
        return [c for c in (columns if name == "basic" else base) if c in alike]

    return [TABLES[name](shown(name), mark) for name in chosen]


def like_paper(columns: Sequence[Column]) -> list[Column]:
    """The columns that may stand beside the published models in `columns`, if there are any: those
    of their robot. Runs on another robot are rows of the embodiment tables only."""
    robots = {column.embodiment for column in columns if column.published}
    return [column for column in columns if not robots or column.embodiment in robots]


def write_tables(tables: Sequence[Table], folder: Path, formats: Sequence[str]) -> list[Path]:
    """Write `tables.<ending>` with all of `tables`; for LaTeX also one file each, to be input."""
    folder.mkdir(parents=True, exist_ok=True)
    files: dict[str, str] = {}
    for ending in formats:
        files[f"tables.{ending}"] = FORMATS[ending](tables)
        if ending == "tex":
            files |= {f"{table.name}.tex": to_latex(table) for table in tables}
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in files]
