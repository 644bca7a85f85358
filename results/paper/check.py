"""Check of every printed value of the paper against its per-task tables.

`checks` walks all cells of all result tables; `errata` keeps those that do not follow, with the
recomputed value and, where the numbers themselves give it away, the likely reason. Nothing here is
a list of known mistakes. What is given and not derived (per-task success and progress, other
robots) can only be checked to be possible at all.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache

from robospa.results.paper import rounding
from robospa.results.paper.columns import Column, published_column
from robospa.results.paper.published import LEVELS, PrintedTable, Published, load, row_title
from robospa.results.paper.rounding import rounded
from robospa.results.statistics.intervals import interval_of
from robospa.results.statistics.samples import onta_of_percent
from robospa.trial import DIMENSIONS, METRIC_CATEGORIES

ENDS = 0.1
"""Allowed distance [percent] of a printed interval end from ours: rounding and bootstrap noise."""
TITLES = {
    "sr": "per-task SR",
    "onta": "per-task ONTA",
    "ps": "per-task PS",
    "tab:main_results": "main",
    "tab:onta_spatial": "ONTA",
    "tab:long_horizon_completion": "PS",
}


@dataclass(frozen=True)
class Check:
    """One printed cell: `recomputed` is rounded like it; `derived` says it follows from others."""

    source: str
    table: str
    row: str
    model: str
    column: str
    printed: float
    recomputed: float
    derived: bool = True
    digits: int = 1
    tolerance: float = 0.0
    reason: str = ""

    @property
    def agrees(self) -> bool:
        return abs(self.printed - self.recomputed) <= self.tolerance + 1e-9

    def __str__(self) -> str:
        printed_value, ours = (
            rounding.text(x, self.digits) for x in (self.printed, self.recomputed)
        )
        why = f" ({self.reason})" if self.reason else ""
        where = f"{self.table}, {row_title(self.row)}, {self.model}, {self.column}"
        return f"{where}: printed {printed_value}, recomputed {ours}{why}"


def errata() -> list[Check]:
    """All printed values that do not follow, in the order of the paper's tables."""
    return [check for check in checks() if not check.agrees]


@cache
def checks() -> tuple[Check, ...]:
    """One check per printed cell of all result tables."""
    data = load()
    columns = {model: published_column(model, model) for model in data.models}
    found: list[Check] = []
    for table in (data.main, data.onta, data.ps):
        found += _summary_table(data, table, columns)
    found += _per_task(data)
    found += _intervals(data, columns)
    found += _embodiments(data)
    found += _basic(data)
    found += _counts(data)
    return tuple(found)


def _summary_table(
    data: Published, table: PrintedTable, columns: Mapping[str, Column]
) -> Iterator[Check]:
    for row, by_model in table.rows.items():
        for model, printed in by_model.items():
            for place, name in enumerate(table.columns):
                if name == "Drop":
                    levels = [int(c[1]) for c in table.columns if c != name]
                    ends = [columns[model].value(table.metric, row, n) for n in levels]
                    value = rounding.drop(*ends)
                else:
                    value = columns[model].value(table.metric, row, int(name[1]))
                assert value is not None, "published models are complete"
                ours, printed_value = rounded(value), printed[place]
                reason = ""
                if ours != printed_value:
                    reason = _reason(data, table, columns[model], row, name)
                cell = (table.source, TITLES[table.source], row, model, name, printed_value)
                yield Check(*cell, ours, reason=reason)


def _reason(data: Published, table: PrintedTable, column: Column, row: str, name: str) -> str:
    """The likely reason why a printed average differs, from the other printed numbers."""
    model = column.published
    printed = dict(zip(table.columns, table.rows[row][model], strict=True))
    if name == "Drop":
        first, last = printed["L1"], printed["L5"]
        if rounding.drop(first, last) == printed[name]:
            return "follows from the printed L1 and L5"
        return f"printed {first} - {last} is {rounding.drop(first, last)}"
    level = int(name[1])
    if row in data.members:
        return _category_reason(data, table, column, row, level, printed[name])
    place = table.columns.index(name)
    parts = METRIC_CATEGORIES[table.metric] if row == rounding.OVERALL else DIMENSIONS[row]
    ours = {c: column.value(table.metric, c, level) or 0.0 for c in parts}
    wrong = [c for c in parts if rounded(ours[c]) != table.rows[c][model][place]]
    ours.update({c: table.rows[c][model][place] for c in wrong})
    mean = rounding.mean(ours.values()) or 0.0
    if wrong and abs(mean - printed[name]) <= 0.05 + 0.05 * len(wrong) / len(parts) + 1e-9:
        return f"follows from {' and '.join(wrong)} as printed"
    return ""


def _category_reason(
    data: Published, table: PrintedTable, column: Column, row: str, level: int, printed: float
) -> str:
    model, tasks = column.published, data.members[row]
    if table.metric == "ps" and level == 1 and data.main.rows[row][model][0] == printed:
        return "as printed in the main table, though the tasks' PS is another"
    if table.metric != "sr":
        return ""
    rates = {task: data.value(model, "sr", task, level) or 0.0 for task in tasks}
    if level == 1 and row in METRIC_CATEGORIES["ps"]:
        for task in tasks:
            other = data.value(model, "ps", task, level)
            changed = rounding.mean({**rates, task: other}.values())
            if other != rates[task] and changed is not None and rounded(changed) == printed:
                return f"fits if SR of {data.tasks[task].title} were {other:.0f} as in PS"
    count, total = len(tasks), round(sum(rates.values()))
    near = round(printed * count)
    fitting = [n for n in range(near - 1, near + 2) if rounded(n / count) == printed]
    if not fitting:
        return f"no {count} whole success rates have this mean"
    return f"the tasks' SR add up to {total}, {fitting[0]} would fit"


def _per_task(data: Published) -> Iterator[Check]:
    for (model, metric), table in data.per_task.items():
        for task, row in table.rows.items():
            about = data.tasks[task]
            for level, printed_value in zip(LEVELS, row, strict=True):
                success = data.value(model, "sr", task, level) or 0.0
                count, reason, digits = about.counts[level - 1], "", 1
                if metric == "sr":
                    share = round(printed_value * data.trials / 100) / data.trials
                    ours, digits = rounded(share * 100), 0
                elif metric == "onta":
                    ours = rounded(onta_of_percent(success, count))
                    fits = [
                        n for n in range(101) if rounded(onta_of_percent(n, count)) == printed_value
                    ]
                    if ours != printed_value:
                        guesses = ["is the SR itself"] if printed_value == success else []
                        guesses += [f"is the ONTA of SR {fits[0]}"] if fits else []
                        reason = f"SR {success:.0f} of {count} objects"
                        reason += f"; {printed_value} {' or '.join(guesses)}" if guesses else ""
                elif count == 1:
                    ours = rounded(success)
                    reason = "with one subtask PS is SR" if ours != printed_value else ""
                else:
                    ours = rounded(rounding.exact_progress(printed_value, count, data.trials))
                derived = metric == "onta" or (metric == "ps" and count == 1)
                cell = (TITLES[metric], about.printed, model, f"L{level}", printed_value)
                yield Check(table.source, *cell, ours, derived, digits, reason=reason)


def _intervals(data: Published, columns: Mapping[str, Column]) -> Iterator[Check]:
    table = data.intervals
    for model, by_row in table.rows.items():
        for row, (point, low, high) in by_row.items():
            value = columns[model].value("sr", row, table.level) or 0.0
            found = interval_of(*columns[model].samples(row, table.level), method="bootstrap")
            for name, printed_value, ours, allowed in (
                ("value", point, value, 0.0),
                ("low", low, 100 * found.low, ENDS),
                ("high", high, 100 * found.high, ENDS),
            ):
                cell = (table.source, "intervals", row, model, name, printed_value)
                yield Check(*cell, rounded(ours, 3 if allowed else 1), tolerance=allowed)


def _embodiments(data: Published) -> Iterator[Check]:
    table = data.embodiments
    for robot, by_task in table.rows.items():
        for short, row in by_task.items():
            task = table.tasks[short]
            dimension = "spatial" if data.tasks[task].category in DIMENSIONS["spatial"] else ""
            for name, printed_value in zip(table.columns, row, strict=True):
                same = robot == data.embodiment
                ours = data.value(table.model, "sr", task, int(name[1])) if same else printed_value
                cell = ("embodiments", short, table.names[robot], name, printed_value)
                source = table.source[dimension or "procedural"]
                yield Check(source, *cell, rounded(ours or 0.0, 0), derived=same, digits=0)


def _basic(data: Published) -> Iterator[Check]:
    table = data.basic_grounding
    trials = table.tasks * table.trials
    for row, values in table.rows.items():
        for name, printed_value in zip(table.columns, values, strict=True):
            ours = rounded(100 * round(printed_value * trials / 100) / trials)
            yield Check(
                table.source, "basic grounding", row, "", name, printed_value, ours, derived=False
            )


def _counts(data: Published) -> Iterator[Check]:
    for model, row in data.models.items():
        hours = rounded(row.gpus * row.hours)
        yield Check(
            data.budget_source, "model sizes", model, model, "GPU hours", row.gpu_hours, hours
        )
    assets = data.assets
    totals = {"categories": len(assets.rows), "variants": sum(assets.rows.values())}
    for name, ours in totals.items():
        printed_value = assets.text[name]
        yield Check(assets.source, "assets", "total", "", name, printed_value, ours, digits=0)
