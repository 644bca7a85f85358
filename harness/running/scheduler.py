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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from robospa.harness.running.messages import Fault
from robospa.harness.running.queue import Pending, TrialQueue
from robospa.harness.running.server_stats import ServerStats
from robospa.results.records.trial_record import TrialRecord

STAY = 0.8
"""Factor on another server's demand for a worker that would have to move there."""


@dataclass(frozen=True)
class Job:
    """A trial and the policy that is to do it."""

    work: Pending
    target: str


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

    def next(self, now: float, at: str = "") -> Job | None:
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
        work = self.queue.take(self._task(server, due), now)
        assert work is not None
        server.start_trial(work.key.task, now)
        return Job(work, server.target)

    def _taken(self, server: ServerStats) -> bool:
        """Whether `server` does one trial at a time and has one, under whatever URL."""
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
        """What one worker adds to the wait there; that of an average server where unknown."""
        if (known := server.wait(now)) is not None:
            return max(known, 1e-3)
        others = [max(w, 1e-3) for s in self.servers.values() if (w := s.wait(now)) is not None]
        return sum(others) / len(others) if others else 1.0

    def _task(self, server: ServerStats, due: Mapping[str, float]) -> str:
        """The base task that `server` goes on with or turns to."""
        if server.task in due:
            return server.task
        mine = [task for task in due if task in server.tasks]
        held = {s.task for s in self.servers.values() if s is not server and s.up}
        free = [task for task in mine if task not in held]
        return max(free or mine, key=lambda task: due[task])

    def done(self, job: Job, record: TrialRecord, now: float, seconds: float) -> None:
        """`job` has its record at time `now`, after `seconds`."""
        self.servers[job.target].finish_trial(record, now)
        self.queue.durations.add(record.key, seconds)

    def lost(self, job: Job, now: float, fault: Fault = "", text: str = "") -> bool:
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

    def give_back(self, job: Job, due: float) -> None:
        """`job` was not begun; not to be run before time `due`."""
        self.servers[job.target].running -= 1
        self.requeue(job, due, charged=False)

    def _can_wait(self, server: ServerStats, job: Job, now: float) -> bool:
        """Whether nothing is lost by trying `job` again after the others."""
        if now - server.failing_since < self._patience:
            return True
        up = [s for s in self.servers.values() if s.up]
        busy = any(s.running for s in up)
        return busy or any(job.work.key.task in s.tasks for s in up)

    def requeue(self, job: Job, due: float, charged: bool) -> None:
        """Put the trial of `job` back, not to be run before time `due`."""
        work = job.work
        self.queue.requeue(replace(work, attempt=work.attempt + charged), due)

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
