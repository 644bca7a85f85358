"""What a run will cost, from a minute of it: a sample of its trials, run as the run would run them.

The sample goes through all variants alike, short and long ones. While it goes on every place of a
worker has a trial; what was done then, in a window that begins when the workers have started up, is
the rate. Done is counted in steps of the trials' limits, of which a trial has done the share of its
duration that lies in the window: so the mix of variants in a short sample matters little, and the
trials that begin and end there not at all. Nothing of it is kept.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from robospa.harness.factory import is_url
from robospa.harness.running.evaluate import Request, ready_config
from robospa.harness.running.policy_probe import probe_policies
from robospa.harness.running.runner import Runner
from robospa.harness.running.status import Status
from robospa.results.records.run_io import finished
from robospa.results.records.trial_record import PROCESSOR, TrialRecord
from robospa.tasks.catalog import task
from robospa.trial import TrialKey

SECONDS = 60.0
"""For so long the sample takes up trials."""
WARM = 1 / 3
"""Share of that after which the window begins at the latest."""
GOLDEN = 0.6180339887498949
"""Multiples of it, without their whole parts, fill the range from 0 to 1 evenly, however many."""


class ProbeFailed(Exception):
    """The sample says nothing; the message says why."""


@dataclass(frozen=True)
class Done:
    """A trial of the sample: when it began and ended [s since the probe's start], the steps of its
    limit, its queries of the policy, and its processor time [s]."""

    began: float
    ended: float
    limit: int
    calls: int
    processor: float

    def share(self, start: float, end: float) -> float:
        """Of its duration, how much lies between `start` and `end` [s]."""
        within = min(self.ended, end) - max(self.began, start)
        return max(0.0, within) / max(self.ended - self.began, 1e-9)


@dataclass(frozen=True)
class Cost:
    """What all `trials` will cost, by a sample of `sampled` ones: `seconds` of wall time, from
    `least` to `most` (two standard errors), `calls` of the policy, processor hours of the workers,
    hours of all servers together, which are taken up for as long as the run goes on. `workers` and
    `bottleneck` are those at the end of the sample."""

    trials: int
    sampled: int
    seconds: float
    least: float
    most: float
    calls: int
    core_hours: float
    server_hours: float
    workers: int = 0
    bottleneck: str = ""


def limit_of(key: TrialKey) -> int:
    """The most steps of a trial."""
    return task(key.task).levels[key.level].steps


def spread(keys: Sequence[TrialKey]) -> list[TrialKey]:
    """All `keys`, every beginning of which has short and long variants in proportion."""
    rows = sorted(keys, key=lambda key: (limit_of(key), key.variant, key.seed))
    order = sorted(range(len(rows)), key=lambda n: n * GOLDEN % 1.0)
    place = {n: rank for rank, n in enumerate(order)}
    return [rows[place[n]] for n in range(len(rows))]


def predict(done: Sequence[Done], keys: Iterable[TrialKey], started: float) -> Cost:
    """What a run of `keys` will cost, on one server.

    `done` is a sample, run by workers that had all started at `started` [s]. Every place of theirs
    was busy until the last trial of it began. Raises ProbeFailed for a sample that says nothing.
    """
    if not done:
        raise ProbeFailed("no trial of the probe could be run; `robospa check` says why")
    limits = [limit_of(key) for key in keys]
    end = max(one.began for one in done)
    rate = sum(one.limit * one.share(started, end) for one in done) / max(end - started, 1e-9)
    if end <= started or rate <= 0.0:
        started, end = 0.0, max(one.ended for one in done)  # fewer trials than places
        rate = sum(one.limit for one in done) / end
    before = sum(one.limit * one.share(0.0, started) for one in done)
    seconds = started + max(0.0, sum(limits) - before) / rate
    error = _error([(one.ended - one.began, one.limit) for one in done])
    scale = sum(limits) / sum(one.limit for one in done)
    return Cost(
        trials=len(limits),
        sampled=len(done),
        seconds=seconds,
        least=seconds * (1 - 2 * error),
        most=seconds * (1 + 2 * error),
        calls=round(scale * sum(one.calls for one in done)),
        core_hours=scale * sum(one.processor for one in done) / 3600,
        server_hours=seconds / 3600,
    )


def _error(rows: Sequence[tuple[float, int]]) -> float:
    """Relative standard error of the ratio of durations [s] to limits; a half at most."""
    durations = sum(duration for duration, _ in rows)
    if len(rows) < 2:
        return 0.5
    ratio = durations / sum(limit for _, limit in rows)
    squares = sum((duration - ratio * limit) ** 2 for duration, limit in rows)
    return min(0.5, math.sqrt(squares * len(rows) / (len(rows) - 1)) / durations)


def probe_cost(
    request: Request,
    seconds: float = SECONDS,
    on_note: Callable[[str], None] = lambda text: None,
) -> Cost:
    """What the run of `request` will cost, from a sample that takes up trials for `seconds`.

    Returns when the last of these has ended. Raises ProbeFailed, and what an evaluation raises
    before its first trial.
    """
    policies = probe_policies(request.config, request.keys, request.wait)
    sample = _Sample(spread(request.keys), seconds)
    with tempfile.TemporaryDirectory(prefix="robospa-plan-") as folder:
        config = replace(request.config, folder=Path(folder), video="none")
        runner = Runner(ready_config(config, request.keys, policies), (), request.options)
        runner.tasks = tuple({key.task for key in request.keys})
        runner.more, runner.on_record, runner.on_note = sample.more, sample.add, on_note
        runner.on_status = sample.show
        runner.run()
    cost = predict(sample.done, request.keys, sample.started)
    servers = {p.target for policy in policies.values() for p in (policy, *policy.replicas)}
    return replace(
        cost,
        server_hours=cost.server_hours * sum(map(is_url, servers)),
        workers=sample.workers,
        bottleneck=sample.bottleneck,
    )


class _Sample:
    """Hands out trials for so many `seconds`, and keeps what came of them."""

    def __init__(self, keys: Sequence[TrialKey], seconds: float) -> None:
        self._keys, self._seconds = list(keys), seconds
        self._began = time.monotonic()
        self._grown, self._places, self._ended_before = 0.0, 0, 0
        self.workers, self.bottleneck = 0, ""
        self.done: list[Done] = []

    def more(self, waiting: int, places: int) -> list[TrialKey]:
        """Trials to take up, while there is time."""
        now = time.monotonic() - self._began
        if now > self._seconds:
            return []
        if places > self._places:
            self._grown, self._places, self._ended_before = now, places, len(self.done)
        if 2 * waiting >= places:
            return []
        count = places - waiting
        taken, self._keys = self._keys[:count], self._keys[count:]
        return taken

    def add(self, record: TrialRecord) -> None:
        """A trial has its record."""
        ended = time.monotonic() - self._began
        if finished(record):
            began = max(0.0, ended - record.wall_time)
            limit, busy = limit_of(record.key), record.timing.get(PROCESSOR, 0.0)
            self.done.append(Done(began, ended, limit, record.policy_calls, busy))

    def show(self, status: Status) -> None:
        """The run's state now; that at its end, when places idle, is of no use."""
        if time.monotonic() - self._began < self._seconds:
            self.workers, self.bottleneck = status.workers, status.bottleneck

    @property
    def started(self) -> float:
        """When all places had finished the first trial since there are so many, but not later than
        a third into the time that was left [s]."""
        latest = self._grown + WARM * max(0.0, self._seconds - self._grown)
        later = [one.ended for one in self.done[self._ended_before :]]
        warm = sorted(later)[self._places - 1] if len(later) >= self._places else latest
        return min(warm, latest)
