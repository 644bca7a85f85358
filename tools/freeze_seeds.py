"""Make the lists of accepted seeds that a suite ships and that are not there yet.

    python tools/freeze_seeds.py                      # everything that a suite ships
    python tools/freeze_seeds.py --robots piper --modes randomized --minutes 50

A suite ships a hundred seeds of each of: all variants, basic ones too, with the default robot in
clean scenes; the 280 of the benchmark with it in randomized ones and with every other robot in
clean ones; the paper's ten multi-embodiment tasks with every other robot in randomized ones. For
others, and for seeds that are only tried, there is `robospa seeds`.

Each list is written as it is finished, with its row in the table of the expert, so what is there
may be committed at any time. Each finished trial is kept in build/seeds: stopped anywhere, the same
command goes on there.
"""

from __future__ import annotations

import argparse
import csv
import io
import re
import time
from collections import Counter
from pathlib import Path

from robospa.harness.robots import embodiments
from robospa.harness.running.atomic_file import replace_file
from robospa.harness.running.status import cores
from robospa.harness.seeds.attempt import Evidence, Search, searches, sweep_with_bar
from robospa.harness.seeds.lists import inputs, read_levels, save
from robospa.harness.selection import parse_tasks
from robospa.results.paper.published import load
from robospa.tasks.catalog import LEVELS
from robospa.tasks.seeds import FIRST_SEED, PER_VARIANT, ListKey
from robospa.trial import REFERENCE

ROOT = Path(__file__).resolve().parents[1]
LISTS = ROOT / "tasks" / "seeds"
TABLE = ROOT / "benchmarks" / "results" / "oracle.csv"
ATTEMPTS = ROOT / "build" / "seeds"
REASONS = 3
"""Reasons of refusals that a row names, the most frequent ones."""


def shipped() -> list[ListKey]:
    """Every list of the suite, in the order in which they are made."""
    ten = list(load().embodiments.tasks.values())
    settings = [(REFERENCE, "clean", parse_tasks("all,basic"))]
    settings += [(REFERENCE, "randomized", parse_tasks("all"))]
    for robot in (name for name in embodiments() if name != REFERENCE):
        settings += [(robot, "clean", parse_tasks("all")), (robot, "randomized", ten)]
    return [ListKey(t, n, r, m) for r, m, tasks in settings for t in tasks for n in LEVELS]


def row_of(search: Search) -> list[object]:
    """The row of a search that is done: how many seeds were tried and accepted, the mean processor
    time of a solved trial [s], what it was made with, and why seeds were refused, with # for every
    number."""
    key, tried = search.key, search.row()
    solved = [item.seconds for item in tried if item.accepted]
    why = Counter(re.sub(r"-?\d+(\.\d+)?", "#", item.reason) for item in search.refused)
    reasons = "; ".join(f"{n}x {text}" for text, n in why.most_common(REASONS))
    mean = round(sum(solved) / len(solved), 3) if solved else 0.0
    of = (key.embodiment, key.mode, key.task, key.level, search.start)
    return [*of, len(tried), len(solved), mean, inputs(key), reasons]


def put(row: list[object]) -> None:
    """Put a row into the table, in the place of an older one of the same list."""
    header, *rows = csv.reader(TABLE.read_text().splitlines())
    known = {tuple(one[:5]): one for one in [*rows, [str(value) for value in row]]}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(sorted(known.values(), key=lambda one: (one[:3], int(one[3]), int(one[4]))))
    replace_file(TABLE, text.getvalue().encode())


def main() -> None:
    """Make what is missing."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", help="such as piper,ur5-wsg; else all")
    parser.add_argument("--modes", help="clean or randomized; else both")
    parser.add_argument("--tasks", help="such as spatial or RPF,OFE, as of robospa eval; else all")
    parser.add_argument("--minutes", type=float, help="go on with no further list after so long")
    parser.add_argument("--workers", type=int, default=cores())
    options = parser.parse_args()
    robots, modes = (text and text.split(",") for text in (options.robots, options.modes))
    tasks = set(parse_tasks(options.tasks)) if options.tasks else None
    keys = [
        key
        for key in shipped()
        if key.embodiment in (robots or [key.embodiment])
        and key.mode in (modes or [key.mode])
        and key.task in (tasks or [key.task])
    ]
    lists = {key: read_levels(LISTS / key.file).get(key.level, ()) for key in keys}
    missing = [key for key, seeds in lists.items() if len(seeds) < PER_VARIANT]
    print(f"{len(keys) - len(missing)} of {len(keys)} lists are there already", flush=True)
    evidence = Evidence(ATTEMPTS)
    wanted = searches(missing, FIRST_SEED, PER_VARIANT, evidence)
    end = time.monotonic() + 60 * options.minutes if options.minutes else float("inf")
    for search in sweep_with_bar(wanted, options.workers, evidence):
        key, row = search.key, row_of(search)
        # No list, rather than a part of one, of what was given up.
        save(LISTS / key.file, key.level, [] if search.given_up else search.accepted)
        put(row)
        print(f"{key}: {row[6]} of {row[5]} accepted  {row[9]}".rstrip(), flush=True)
        if time.monotonic() > end:
            break


if __name__ == "__main__":
    main()
