"""Every task's SR, SR@1 and PS of several runs, beside the PS of doing nothing, as Markdown.

    python tools/task_rates.py expert=runs/oracle tries-all=runs/tries_all ... > table.md
    python tools/task_rates.py --csv expert=runs/oracle ... > benchmarks/results/floors.csv

Means over the levels that a run has of a task. Of a run in parts name it once a part.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence

from robospa.results.paper.rounding import text
from robospa.results.records.runs import read_run
from robospa.results.scoring.scores import IDLE, Scores, combine, score_run
from robospa.results.statistics.intervals import Estimate
from robospa.results.tables import Table, TableCell, TableRow, to_csv, to_markdown
from robospa.trial import BASIC, CATEGORIES, CATEGORY_NAMES, METRIC_NAMES

SHOWN = ("sr", "sr1", "ps")
NOTHING = "doing nothing"


def task_rates(named: Mapping[str, Scores]) -> Table:
    """The table: a row a task, the metrics of every run, then the progress of doing nothing on the
    scenes of the first run that has the task."""
    category = {task: c for scores in named.values() for task, c in scores.category_of.items()}
    rows: list[TableRow] = []
    for one in (*CATEGORIES, *BASIC):
        tasks = sorted(task for task in category if category[task] == one)
        if tasks:
            rows.append(TableRow(f"{one} {CATEGORY_NAMES[one]}", kind="section"))
        rows += [_row(task, named) for task in tasks]
    groups = (*((name, 1 + len(SHOWN)) for name in named), (NOTHING, 1))
    shown = (*[METRIC_NAMES[metric] for metric in SHOWN], "trials")
    heads = (*shown * len(named), METRIC_NAMES["ps"])
    notes = tuple(f"{name}: {_extent(scores)}." for name, scores in named.items())
    return Table("task-rates", "Cell by cell", "task", heads, tuple(rows), groups, notes)


def _row(task: str, named: Mapping[str, Scores]) -> TableRow:
    found = [scores.tasks.get(task) for scores in named.values()]
    idle = next((one.values[IDLE] for one in found if one and one.values.get(IDLE)), None)
    cells: list[TableCell] = []
    for one in found:
        cells += [_cell(one.values.get(metric) if one else None) for metric in SHOWN]
        cells.append(TableCell(str(one.trials) if one else ""))
    return TableRow(task, (*cells, _cell(idle)))


def _cell(found: Estimate | None) -> TableCell:
    if found is None:
        return TableCell()
    return TableCell(
        text(100 * found.value, 0), *(100 * x for x in (found.value, found.low, found.high))
    )


def _extent(scores: Scores) -> str:
    trials = sorted({cell.trials for cell in scores.cells.values()})
    levels = ", ".join(map(str, scores.levels))
    return (
        f"levels {levels}, {' to '.join(map(str, {trials[0]: 0, trials[-1]: 0}))} trials a variant"
    )


def main(words: Sequence[str]) -> None:
    """Print the table of the runs `NAME=FOLDER`."""
    named: dict[str, Scores] = {}
    as_csv = "--csv" in words
    for word in words[as_csv:]:
        name, _, folder = word.rpartition("=")
        scores = score_run(read_run(folder))
        known = named.get(name)
        named[name] = combine({**known.cells, **scores.cells}) if known else scores
    table = task_rates(named)
    print(to_csv([table]) if as_csv else to_markdown(table), end="" if as_csv else "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
