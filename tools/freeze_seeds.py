"""Make the lists of accepted seeds that are shipped, and the table of the expert.

    python tools/freeze_seeds.py                      # everything that a suite ships
    python tools/freeze_seeds.py --robots piper --minutes 50
    python tools/freeze_seeds.py --start 900000 --count 20 --measure --tasks all   # unseen seeds
    python tools/freeze_seeds.py --confirm 1          # after a change of code that changes no trial

A suite ships a hundred seeds of each of: all variants, basic ones too, with the default robot in
clean scenes; the 280 of the benchmark with it in randomized ones and with every other robot in
clean ones; the paper's ten multi-embodiment tasks with every other robot in randomized ones. Flags
choose among them; robots, modes and tasks that are named in full need not be shipped ones.

Each list is written as it is finished, so what is there may be committed at any time. Each finished
trial is kept in build/seeds: stopped anywhere, the same command goes on there. A list whose inputs
did not change since its row of the table was written is not made again. Rows of seeds that were
only measured stand in the same table, under their first seed. `--confirm` runs the first trials of
each list that was made with other code again, and lets the list stand where they end as before.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from robospa.harness.robots import embodiments
from robospa.harness.seeds.attempt import Evidence, expert_pool
from robospa.harness.seeds.lists import inputs, read_levels, save
from robospa.harness.seeds.summary import read_rows, row_of, write_rows
from robospa.harness.seeds.sweep import confirm, searches, sweep_with_bar
from robospa.harness.selection import (
    canonical_mode,
    parse_embodiments,
    parse_levels,
    parse_tasks,
)
from robospa.results.paper.published import load
from robospa.tasks.catalog import LEVELS
from robospa.tasks.seeds import FIRST_SEED, PER_VARIANT, ListKey
from robospa.text import plain_console
from robospa.trial import REFERENCE

ROOT = Path(__file__).resolve().parents[1]
LISTS = ROOT / "tasks" / "seeds"
TABLE = ROOT / "benchmarks" / "results" / "oracle.csv"
ATTEMPTS = ROOT / "build" / "seeds"


def shipped() -> list[ListKey]:
    """Every list of the suite, in the order in which they are made."""
    ten = list(load().embodiments.tasks.values())
    settings = [(REFERENCE, "clean", parse_tasks("all,basic"))]
    settings += [(REFERENCE, "randomized", parse_tasks("all"))]
    for robot in (name for name in embodiments() if name != REFERENCE):
        settings += [(robot, "clean", parse_tasks("all")), (robot, "randomized", ten)]
    return [ListKey(t, n, r, m) for r, m, tasks in settings for t in tasks for n in LEVELS]


def chosen(options: argparse.Namespace) -> list[ListKey]:
    """The lists that the flags name."""
    levels = parse_levels(options.levels)
    if not (options.robots or options.modes or options.tasks):
        return [key for key in shipped() if key.level in levels]
    robots = parse_embodiments(options.robots or REFERENCE)
    modes = [canonical_mode(word) for word in (options.modes or "clean").split(";")]
    if options.tasks:
        tasks = parse_tasks(options.tasks)
        return [ListKey(t, n, r, m) for r in robots for m in modes for t in tasks for n in levels]
    some = [k for k in shipped() if k.embodiment in robots and k.mode in modes]
    return [key for key in some if key.level in levels]


def main() -> None:
    """Make what is missing."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", help="such as piper,ur5-wsg, or all")
    parser.add_argument("--modes", help="such as clean;randomized")
    parser.add_argument("--tasks", help="such as GAC,RPF or all")
    parser.add_argument("--levels", default="1-5")
    parser.add_argument("--start", type=int, default=FIRST_SEED)
    parser.add_argument("--count", type=int, default=PER_VARIANT)
    parser.add_argument("--measure", action="store_true", help="try `count` seeds, write no lists")
    parser.add_argument("--confirm", type=int, metavar="TRIALS", help="of each list, run again")
    parser.add_argument("--minutes", type=float, help="begin no more trials after so long")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--lists", type=Path, default=LISTS)
    parser.add_argument("--table", type=Path, default=TABLE)
    parser.add_argument("--attempts", type=Path, default=ATTEMPTS)
    options = parser.parse_args()
    if (options.start, options.count) != (FIRST_SEED, PER_VARIANT) and not options.measure:
        parser.error(f"shipped lists are {PER_VARIANT} seeds from {FIRST_SEED}: give --measure")
    keys = chosen(options)
    for key, text in (confirmed if options.confirm else make)(keys, options):
        print(f"{key}: {text}", flush=True)
    rows = read_rows(options.table)
    made = [rows[place] for key in keys if (place := (key, options.start)) in rows]
    print(f"{len(made)} of {len(keys)} lists in {options.table}")


def make(keys: list[ListKey], options: argparse.Namespace) -> Iterator[tuple[ListKey, str]]:
    """Make what is missing of `keys`, with a sentence on each."""
    rows = read_rows(options.table)
    evidence = Evidence(options.attempts)

    def is_done(key: ListKey) -> bool:
        row = rows.get((key, options.start))
        if row is None or row.inputs != inputs(key):
            return False
        listed = len(read_levels(options.lists / key.file).get(key.level, ()))
        return bool(options.measure) or row.accepted < options.count or listed == options.count

    missing = [key for key in keys if not is_done(key)]
    plain_console().print(f"{len(keys) - len(missing)} of {len(keys)} lists are done already")
    wanted = searches(missing, options.start, options.count, evidence, measure=options.measure)
    end = time.monotonic() + 60 * options.minutes if options.minutes else float("inf")
    for search in sweep_with_bar(wanted, options.workers, evidence, lambda: time.monotonic() > end):
        key = search.key
        row = rows[key, options.start] = row_of(search, inputs(key))
        if not options.measure:  # no list, rather than an old one, of what was given up
            save(options.lists / key.file, key.level, [] if search.given_up else search.accepted)
        write_rows(options.table, rows)
        yield key, f"{row.accepted} of {row.tried} accepted  {row.reasons}".rstrip()


def confirmed(keys: list[ListKey], options: argparse.Namespace) -> Iterator[tuple[ListKey, str]]:
    """Confirm the lists of `keys` that other code made, with a sentence on each."""
    rows = read_rows(options.table)
    evidence = Evidence(options.attempts)
    made = {key: row.inputs for key in keys if (row := rows.get((key, options.start)))}
    old = {key: name for key, name in made.items() if name != inputs(key)}
    with expert_pool(options.workers) as pool:
        for found in confirm(lambda *job: pool.submit(job), old, evidence, options.confirm):
            key = found.key
            if found.holds:
                evidence.adopt(key, old[key], inputs(key))
                rows[key, options.start] = replace(rows[key, options.start], inputs=inputs(key))
                write_rows(options.table, rows)
                yield key, f"holds: {found.tried} trials end as before"
            elif found.tried:
                yield key, f"does not hold: {', '.join(map(str, found.differs))} end otherwise"
            else:
                yield key, f"its trials are not in {options.attempts}"


if __name__ == "__main__":
    main()
