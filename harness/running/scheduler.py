"""Which trial runs next, and at which server.

A free worker goes where the most work is waiting for each worker's wait: to the server with the
largest (expected seconds of its trials) / (workers there, itself included, times what each adds to
the wait). So equal servers share the workers evenly, a server that gets slow loses workers to the
others, and one with twice the work gets twice the workers. A worker only moves for a clear gain.

A server keeps its base task until nothing of it is left to start. It then takes the task with the
most work that no other server is at, and joins another server's task only when there is no such
task: a server meets few changes of task, and long tasks do not come last.

A server whose model has one state for all connections does one trial at a time.

A server that cannot be reached gives its workers to the others and is tried again by one worker at
a time. A trial that did not reach it is not charged an attempt as long as waiting costs nothing:
other trials can run, or the server has been failing for less than `patience` seconds.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from robospa.harness.running.executor import Fault
from robospa.harness.running.status import ServerStats
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from robospa.tasks.task import Task

STAY = 0.8
"""Factor on another server's demand for a worker that would have to move there."""


@dataclass(frozen=True)
class TrialJob:
    """A trial to be run for the `attempt`-th time by this driver; `retries` are all attempts that
    did not count, those of earlier drivers first. `target`: the policy that is to do it, if that
    is known yet."""

    key: TrialKey
    attempt: int = 1
    retries: tuple[RetryRow, ...] = ()
    target: str = ""


class Scheduler:
    """Hands out the trials of `queue`. `targets` names the policies that can do a task, `one_trial`
    has the address of those that may do one trial at a time."""

    def __init__(
        self,
        queue: TrialQueue,
        targets: Callable[[str], Sequence[str]],
        *,
        batches: Mapping[str, int] | None = None,
        one_trial: Mapping[str, str] | None = None,
        pause: float = 2.0,
        patience: float = 60.0,
    ) -> None:
        self.queue = queue
        self._pause, self._patience = pause, patience
        self._one_trial = one_trial or {}
        tasks_of: dict[str, set[str]] = {}
        for task in queue.tasks:
            for target in targets(task):
                tasks_of.setdefault(target, set()).add(task)
        self.servers = {
            target: ServerStats(target, frozenset(tasks), (batches or {}).get(target, 1))
            for target, tasks in tasks_of.items()
        }

    def next(self, now: float, at: str = "") -> TrialJob | None:
        """What a free worker that is connected to the policy `at` does next; None to wait."""
        due = self.queue.due(now)
        usable = [
            s
            for s in self.servers.values()
            if s.available(now) and not s.tasks.isdisjoint(due) and not self._taken(s)
        ]
        if not usable:
            return None
        demands = {
            s.target: self._demand(s, due, now) * (1 if s.target == at else STAY) for s in usable
        }
        server = max(usable, key=lambda s: demands[s.target])
        job = self.queue.take(self._task(server, due), now)
        assert job is not None
        server.start_trial(job.key.task, now)
        return replace(job, target=server.target)

    def _taken(self, server: ServerStats) -> bool:
        address = self._one_trial.get(server.target)
        return address is not None and any(
            s.running for s in self.servers.values() if self._one_trial.get(s.target) == address
        )

    def _demand(self, server: ServerStats, due: Mapping[str, float], now: float) -> float:
        """Expected seconds of work that wait for `server`, for each worker's wait."""
        sharing = {
            task: sum(task in s.tasks and (s.up or s is server) for s in self.servers.values())
            for task in due
            if task in server.tasks
        }
        work = sum(due[task] / count for task, count in sharing.items())
        return work / ((server.running + 1) * self._wait(server, now))

    def _wait(self, server: ServerStats, now: float) -> float:
        if (known := server.wait(now)) is not None:
            return max(known, 1e-3)
        others = [max(w, 1e-3) for s in self.servers.values() if (w := s.wait(now)) is not None]
        return sum(others) / len(others) if others else 1.0

    def _task(self, server: ServerStats, due: Mapping[str, float]) -> str:
        if server.task in due:
            return server.task
        mine = [task for task in due if task in server.tasks]
        held = {s.task for s in self.servers.values() if s is not server and s.up}
        free = [task for task in mine if task not in held]
        return max(free or mine, key=lambda task: due[task])

    def done(self, job: TrialJob, record: TrialRecord, now: float, seconds: float) -> None:
        self.servers[job.target].finish_trial(record, now)
        self.queue.durations.add(record.key, seconds)

    def lost(self, job: TrialJob, now: float, fault: Fault = "", text: str = "") -> bool:
        """`job` could not be run; whether that counts as one of its attempts."""
        server = self.servers[job.target]
        server.running -= 1
        if len(self.servers) == 1 or not fault:
            return True
        if fault == "incompatible":
            server.excluded = text
            return False
        server.fail(now, self._pause)
        return fault == "disconnected" or not self._can_wait(server, job, now)

    def give_back(self, job: TrialJob, due: float) -> None:
        """`job` was not begun; not to be run before time `due`."""
        self.servers[job.target].running -= 1
        self.requeue(job, due, charged=False)

    def _can_wait(self, server: ServerStats, job: TrialJob, now: float) -> bool:
        """Whether nothing is lost by trying `job` again after the others."""
        if now - server.failing_since < self._patience:
            return True
        up = [s for s in self.servers.values() if s.up]
        busy = any(s.running for s in up)
        return busy or any(job.key.task in s.tasks for s in up)

    def requeue(self, job: TrialJob, due: float, charged: bool) -> None:
        """Put the trial of `job` back, not to be run before time `due`."""
        self.queue.requeue(replace(job, attempt=job.attempt + charged, target=""), due)

    def tasks_without_server(self) -> tuple[str, ...]:
        """Unfinished base tasks for which no server is left."""
        left = set(self.queue.waiting())
        kept = {task for s in self.servers.values() if not s.excluded for task in s.tasks}
        return tuple(sorted(left - kept))

    def next_time(self, now: float) -> float | None:
        """When a pause of a trial or a server is over; None if there is none."""
        pauses = [s.retry_at for s in self.servers.values() if s.failures and s.retry_at > now]
        if (due := self.queue.next_due(now)) is not None:
            pauses.append(due)
        return min(pauses, default=None)


@dataclass(frozen=True)
class VariantInfo:
    """What the catalog says of a variant, before any of its trials has run."""

    category: str = ""
    candidates: int = 0
    subtasks: int = 0
    steps: int = 0


class DurationEstimates:
    """Expected seconds of a trial. `steps` gives the step limit of a key's variant.

    The estimate for a variant is the mean of its measured trials and of one guess: its step limit
    times the seconds that the run's trials have taken for each step of theirs.
    """

    def __init__(self, steps: Callable[[TrialKey], int]) -> None:
        self._steps = steps
        self._measured: dict[tuple[str, int], tuple[float, int]] = {}
        self._seconds = self._limits = 0.0

    @property
    def known(self) -> bool:
        """Whether any trial was measured; until then `expect` is in steps, not seconds."""
        return self._limits > 0

    def add(self, key: TrialKey, seconds: float) -> None:
        total, count = self._measured.get(key.variant, (0.0, 0))
        self._measured[key.variant] = (total + seconds, count + 1)
        self._seconds += seconds
        self._limits += max(1, self._steps(key))

    def expect(self, key: TrialKey) -> float:
        """Seconds that a trial of the variant of `key` should take."""
        per_step = self._seconds / self._limits if self.known else 1.0
        total, count = self._measured.get(key.variant, (0.0, 0))
        return (total + per_step * max(1, self._steps(key))) / (count + 1)


@dataclass
class _Group:
    """What is left of one base task: fresh trials by level, retries by the time they are due."""

    fresh: dict[int, deque[TrialJob]] = field(default_factory=dict)
    retries: list[tuple[float, int, TrialJob]] = field(default_factory=list)

    def due(self, now: float) -> bool:
        return bool(self.fresh) or (bool(self.retries) and self.retries[0][0] <= now)


class TrialQueue:
    """All trials of a run that are not settled yet. `task_of` finds the task of a key, `retries`
    has the attempts of earlier drivers."""

    def __init__(
        self,
        keys: Sequence[TrialKey],
        task_of: Callable[[TrialKey], Task],
        retries: Mapping[TrialKey, tuple[RetryRow, ...]] | None = None,
    ) -> None:
        self._task_of = task_of
        self._info: dict[tuple[str, int], VariantInfo] = {}
        self._groups: dict[str, _Group] = {}
        self._count = 0
        self.durations = DurationEstimates(lambda key: self.info(key).steps)
        self.unsettled = 0
        for key in sorted(keys):
            by_level = self._groups.setdefault(key.task, _Group()).fresh
            job = TrialJob(key, retries=(retries or {}).get(key, ()))
            by_level.setdefault(key.level, deque()).append(job)
            self.unsettled += 1

    def info(self, key: TrialKey) -> VariantInfo:
        """The variant of `key`; all fields empty if its task cannot be found."""
        if key.variant not in self._info:
            try:
                task = self._task_of(key)
                level = task.levels[key.level]
                found = VariantInfo(task.category, level.candidates, level.subtasks, level.steps)
            except Exception:  # the worker will meet the same error and report it
                found = VariantInfo()
            self._info[key.variant] = found
        return self._info[key.variant]

    @property
    def tasks(self) -> tuple[str, ...]:
        return tuple(self._groups)

    def due(self, now: float) -> dict[str, float]:
        """Expected seconds of what waits, for every task that has something to run at `now`."""
        return {
            task: self._seconds_left(group)
            for task, group in self._groups.items()
            if group.due(now)
        }

    def waiting(self) -> tuple[str, ...]:
        """Every base task that still has a trial to start, now or after its pause."""
        return tuple(task for task, g in self._groups.items() if g.fresh or g.retries)

    def left(self) -> float:
        """Expected seconds of all trials that wait."""
        return sum(map(self._seconds_left, self._groups.values()))

    def _seconds_left(self, group: _Group) -> float:
        fresh = sum(len(q) * self.durations.expect(q[0].key) for q in group.fresh.values())
        return fresh + sum(self.durations.expect(job.key) for _, _, job in group.retries)

    def take(self, task: str, now: float) -> TrialJob | None:
        """The next trial of `task`: a retry whose pause is over, or the longest; None if none."""
        group = self._groups[task]
        if group.retries and group.retries[0][0] <= now:
            return heapq.heappop(group.retries)[2]
        if not group.fresh:
            return None
        level = max(group.fresh, key=lambda n: (self.durations.expect(group.fresh[n][0].key), -n))
        job = group.fresh[level].popleft()
        if not group.fresh[level]:
            del group.fresh[level]
        return job

    def requeue(self, job: TrialJob, due: float) -> None:
        """Run `job` (as it is: the caller counts attempts), not before time `due`."""
        self._count += 1
        heapq.heappush(self._groups[job.key.task].retries, (due, self._count, job))

    def next_due(self, now: float) -> float | None:
        """When the next retry after `now` is due; None if there is none."""
        dues = [due for g in self._groups.values() for due, _, _ in g.retries if due > now]
        return min(dues, default=None)

    def settle(self) -> None:
        """One trial has its record."""
        self.unsettled -= 1
