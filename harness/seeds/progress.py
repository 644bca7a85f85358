"""Sweeping on the terminal: one bar over all lists, with the rate and how long it will take."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future

from robospa.harness.seeds.attempt import Attempt, expert_pool
from robospa.harness.seeds.evidence import Evidence
from robospa.harness.seeds.inputs import inputs
from robospa.harness.seeds.sweep import Search, sweep
from robospa.tasks.seeds import ListKey
from robospa.terminal import plain_console
from robospa.text import duration_text


def searches(
    keys: Sequence[ListKey],
    start: int,
    count: int,
    evidence: Evidence,
    *,
    measure: bool = False,
    fresh: bool = False,
) -> list[Search]:
    """A search for each of `keys`, with what `evidence` knows unless all is made `fresh`."""

    def known(key: ListKey) -> dict[int, Attempt]:
        return {} if fresh else evidence.attempts(key, inputs(key))

    return [Search(key, start, count, measure, known(key)) for key in keys]


def sweep_with_bar(
    wanted: Sequence[Search],
    workers: int,
    evidence: Evidence,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[Search]:
    """Every search of `wanted` once it is done; each attempt is kept as it finishes.

    Once `stop` says so, no more trials are begun, and what is not done is left out.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[speed]}", markup=False),
    )
    total = sum(search.count for search in wanted)
    known = sum(_got(search) for search in wanted)
    begun, tried = time.monotonic(), 0
    with Progress(*columns, console=plain_console()) as bar, expert_pool(workers) as pool:
        row = bar.add_task("seeds", total=total, completed=known, speed="")

        def note(search: Search, item: Attempt) -> None:
            nonlocal tried
            evidence.add(search.key, inputs(search.key), item)
            tried += 1
            rate = tried / (time.monotonic() - begun)
            bar.update(row, description=str(search.key))
            if item.accepted or search.measures:
                bar.advance(row)
            left = bar.tasks[0].remaining or 0
            bar.update(row, speed=f"{rate:.2f} trials/s, {duration_text(left / rate)} left")

        def submit(key: ListKey, seed: int) -> Future[Attempt]:
            return pool.submit((key, seed))

        for search in sweep(submit, workers, wanted, note, stop):
            bar.advance(row, search.count - _got(search))  # of one that was given up
            yield search


def _got(search: Search) -> int:
    """How much of what it looks for it has."""
    return len(search.row() if search.measures else search.accepted)
