"""Success of the expert, and scores of standing still and of random motion, over every variant.

    python benchmarks/expert.py [--trials 3] [--first 900000] [--json]

Three runs of `robospa eval`, without server or pictures, in build/expert-*; one that is there is
gone on with. The expert gets `--trials` seeds of every variant that no list has (0: not run) and
is timed; `hold` gets the first listed seed of every variant, `random` that of every task's level 1,
because a trial of random moves takes its whole step limit. The shipped lists say the rest: how many
seeds had to be tried until a hundred were accepted. The bars are those of the benchmark: 98 of 100
seeds, and all 35,500 listed trials in four hours on two cores.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from frame import Figure, Result, main

from robospa.results.records.runs import read_run
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import LEVELS, tasks
from robospa.tasks.seeds import FIRST_SEED, PER_VARIANT, accepted

ROBOSPA = str(Path(sys.executable).with_name("robospa"))
BAR = 98.0
HOURS = 4.0
WORKERS = 2
WORST = 3


def evaluate(policy: str, *options: str) -> tuple[list[TrialRecord], float, bool]:
    """The finished trials of a run of all tasks, wall seconds, and whether it began just now."""
    folder = Path("build") / f"expert-{policy}"
    again = folder.exists()
    command = [ROBOSPA, "eval", policy, "--tasks", ",".join(tasks()), "--out", str(folder)]
    command += ["--workers", str(WORKERS), *options, *["--resume"][:again]]
    start_time = time.monotonic()
    subprocess.run(command, check=True)
    return list(read_run(folder).records.values()), time.monotonic() - start_time, not again


def lists() -> Iterator[Figure]:
    """Figures of the shipped seed lists."""
    tried = {
        (name, level): accepted(name, level)[-1] - FIRST_SEED + 1
        for name in tasks()
        for level in LEVELS
    }
    total, wanted = sum(tried.values()), PER_VARIANT * len(tried)
    worst = sorted(tried.items(), key=lambda item: -item[1])[:WORST]
    note = ", ".join(f"{name} {level}: {n}" for (name, level), n in worst if n > PER_VARIANT)
    most, made = int(PER_VARIANT * 100 / BAR), "robospa seeds all"
    yield Figure(
        f"variants whose first {PER_VARIANT} accepted seeds took {most} tries or fewer",
        sum(n <= most for n in tried.values()), f"of {len(tried)}", at_least=len(tried),
        command=made, note="the longest: " + note if note else "")  # fmt: skip
    yield Figure("seeds tried in a row and accepted", round(100 * wanted / total, 2), "%",
        at_least=BAR, command=made, note=f"{wanted:,} of {total:,}")  # fmt: skip


def oracle(trials: int, first: int) -> Iterator[Figure]:
    """Seeds that no list has, in physics."""
    seeds = f"{first}-{first + trials - 1}"
    records, wall, whole = evaluate("oracle", "--trials", str(trials), "--seeds", seeds)
    failed = [r for r in records if not r.success]
    names = ", ".join(f"{r.key.task} {r.key.level} seed {r.key.seed}" for r in failed[:WORST])
    solved = len(records) - len(failed)
    yield Figure("unseen seeds solved", round(100 * solved / len(records), 2), "%", at_least=BAR,
        note=f"{solved:,} of {len(records):,}" + (f"; not {names}" if names else ""))  # fmt: skip
    if whole:
        every = PER_VARIANT * len(LEVELS) * len(tasks())
        own = sum(record.wall_time for record in records) / WORKERS
        yield Figure(
            f"all {every:,} trials without rendering, {WORKERS} workers, at the trials' own time",
            round(own / len(records) * every / 3600, 2), "h", at_most=HOURS,
            note=f"{len(records):,} trials, all variants alike, took {own:.0f} s of each worker; "
            f"the run {wall:.0f} s")  # fmt: skip


def idle(policy: str, what: str, levels: str) -> Figure:
    """Scores of policies that know nothing."""
    records, _, _ = evaluate(policy, "--trials", "1", "--levels", levels)
    moved = sorted({r.key.task for r in records if r.done})
    return Figure(f"{what}: successes", sum(r.success for r in records), f"of {len(records)}",
        at_most=round(0.01 * len(records), 2),
        note=f"progress only in {', '.join(moved)}" if moved else "")  # fmt: skip


def measure(trials: int = 3, first: int = 900_000) -> Result:
    """Run what was asked for."""
    figures = [*lists(), *(oracle(trials, first) if trials else ())]
    figures.append(idle("hold", "holding still, every variant", "1-5"))
    figures.append(idle("random", "random moves, every task at level 1", "1"))
    return Result(
        "The expert",
        figures,
        text="""\
A policy that holds still makes progress by the official rules: the first block of a stack or row
counts as done, pairs of a row may stand in order by chance, and a red block may lie in its area
(see `idle_progress` in [fidelity](fidelity.md)). Random motion sometimes solves two tasks: an open
gripper's touch clicks the can of Click_Can_Place_Items (7 of 20 seeds), and a bottle of
Put_Bottles_Dustbin may fall into the bin (1 of 20). The seed lists were made once; of 26 clean
seeds that they leave out, the expert of 2026-11-29 solves 14. It solves 7,098 of 7,100 unseen
seeds, twenty of every variant, failing one each of Move_Playing_Cards_Away 2 and
Separate_Fries_Bread 3 (`robospa seeds all,basic --start 900000 --count 20 --check`).""",
    )


if __name__ == "__main__":
    main(expert=measure)
