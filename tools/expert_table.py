"""What the expert solves with every robot on seeds that no list holds.

    robospa eval oracle --embodiments ARX-X5,piper,franka-panda,ur5-wsg \\
        --seeds 900000-900019 --trials 20 --out runs/experts
    python tools/expert_table.py runs/experts ...   counts runs into benchmarks/results, where they
                                                    replace the variants that they hold
    python tools/expert_table.py                    writes the table into docs/adding-a-robot.md

A test holds the page against the counts: the table, and that every variant below 95 % is named.
"""

from __future__ import annotations

import csv
import sys
from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from robospa.results.paper.published import load
from robospa.results.records.runs import read_run
from robospa.text import markdown_table

ROOT = Path(__file__).resolve().parents[1]
COUNTS = ROOT / "benchmarks" / "results" / "expert_robots.csv"
PAGE = ROOT / "docs" / "adding-a-robot.md"
HEAD = "| robot |"
ENOUGH = 0.95
"""The share of its trials that the expert has to solve of a variant."""


class Variant(NamedTuple):
    """How many of the tried trials were solved, and the seeds of those that were not."""

    robot: str
    task: str
    level: int
    solved: int
    tried: int
    failed: tuple[int, ...] = ()


def counted(runs: Sequence[Path]) -> list[Variant]:
    """Every variant and robot of `runs`; of a trial that several hold, the last run counts.

    Raises `RunError` for a folder that is no run.
    """
    solved: dict[tuple[str, str, int], dict[int, bool]] = defaultdict(dict)
    for run in runs:
        for record in read_run(run).records.values():
            key = record.key
            solved[key.embodiment, key.task, key.level][key.seed] = record.success
    failed = {key: tuple(sorted(s for s in seeds if not seeds[s])) for key, seeds in solved.items()}
    return [
        Variant(*key, sum(seeds.values()), len(seeds), failed[key])
        for key, seeds in sorted(solved.items())
    ]


def write(path: Path, variants: Sequence[Variant]) -> None:
    """The counts as CSV, a line for each variant and robot."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Variant._fields)
        writer.writerows((*v[:-1], " ".join(map(str, v.failed))) for v in variants)


def read(path: Path) -> list[Variant]:
    """The counts of `write`."""
    with path.open(newline="") as file:
        _, *rows = csv.reader(file)
    return [
        Variant(robot, task, *map(int, counts), tuple(map(int, failed.split())))
        for robot, task, *counts, failed in rows
    ]


def merged(old: Sequence[Variant], new: Sequence[Variant]) -> list[Variant]:
    """All variants, `new` ones in place of the `old` of the same robot, task and level."""
    found = {v[:3]: v for v in (*old, *new)}
    return [found[key] for key in sorted(found)]


def table(variants: Sequence[Variant]) -> list[str]:
    """Lines of Markdown: a row for each robot, a column for each category."""
    category = {name: task.category for name, task in load().tasks.items()}
    columns = list(dict.fromkeys(category.values()))
    rows = []
    for robot in dict.fromkeys(v.robot for v in variants):
        solved, tried = Counter[str](), Counter[str]()
        for v in (v for v in variants if v.robot == robot):
            for column in (category[v.task], "all"):
                solved[column] += v.solved
                tried[column] += v.tried
        share = 1000 * solved["all"] // tried["all"] / 10  # never rounded up to all of them
        whole = f"{solved['all']:,}/{tried['all']:,}: {share:.1f} %"
        rows.append((robot, *(f"{solved[c]}/{tried[c]}" for c in columns), whole))
    return markdown_table(("robot", *columns, "all"), rows).splitlines()


def below(variants: Sequence[Variant]) -> dict[tuple[str, str], dict[int, Variant]]:
    """Levels of every robot and task of which too few trials were solved."""
    found: dict[tuple[str, str], dict[int, Variant]] = {}
    for v in variants:
        if v.solved < ENOUGH * v.tried:
            found.setdefault((v.robot, v.task), {})[v.level] = v
    return found


def main(runs: Sequence[str]) -> None:
    """Count runs, or write the table of what was counted."""
    if runs:
        write(COUNTS, merged(read(COUNTS), counted([Path(run) for run in runs])))
    lines = PAGE.read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith(HEAD))
    end = next(i for i in range(first, len(lines)) if not lines[i].startswith("|"))
    variants = read(COUNTS)
    PAGE.write_text("\n".join([*lines[:first], *table(variants), *lines[end:]]) + "\n")
    for (robot, task), levels in below(variants).items():
        print(robot, task, *(f"{level}: {v.solved}/{v.tried}" for level, v in levels.items()))


if __name__ == "__main__":
    main(sys.argv[1:])
