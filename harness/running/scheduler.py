"""Which trial runs next, and at which server.

A free worker goes where the most work is waiting for each worker's wait: to the server with the
largest (expected seconds of its trials) / (workers there, itself included, times what each adds to
the wait). So equal servers share the workers evenly, a server that gets slow loses workers to the
others, and one with twice the work gets twice the workers. A worker only moves for a clear gain.

A server keeps its base task until nothing of it is left to start. It then takes the task with the
most work that no other server is at, and joins another server's task only when there is no such
task: a server meets few changes of task, and long tasks do not come last.

A server that is away gives its workers to the others and is tried again by one worker at a time. A
trial that did not reach it is none the worse for it as long as waiting costs nothing: other trials
can run, or the server has not been away for `patience` seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from robospa.harness.running.queue import Pending, TrialQueue
from robospa.harness.running.servers import BROKEN, UNFIT, Server
from robospa.results.records.trial_record import TrialRecord

STAY = 0.8
"""What another server's pull is worth to a worker that would have to move there."""


@dataclass(frozen=True)
class Job:
    """A trial and the policy that is to do it."""

    work: Pending
    target: str


class Scheduler:
    """Hands out the trials of `queue`. `targets` names the policies that can do a task."""

    def __init__(
        self,
        queue: TrialQueue,
        targets: Callable[[str], Sequence[str]],
        *,
        batches: Mapping[str, int] | None = None,
        pause: float = 2.0,
        patience: float = 60.0,
    ) -> None:
        self.queue = queue
        self._pause, self._patience = pause, patience
        doing: dict[str, set[str]] = {}
        for task in queue.tasks:
            for target in targets(task):
                doing.setdefault(target, set()).add(task)
        self.servers = {
            target: Server(target, frozenset(tasks), (batches or {}).get(target, 1))
            for target, tasks in doing.items()
        }

    def next(self, now: float, at: str = "") -> Job | None:
        """What a free worker that is connected to the policy `at` does next; None to wait."""
        due = self.queue.due(now)
        there = [s for s in self.servers.values() if s.open(now) and not s.tasks.isdisjoint(due)]
        if not there:
            return None
        pulls = {s.target: self._pull(s, due, now) * (1 if s.target == at else STAY) for s in there}
        server = max(there, key=lambda s: pulls[s.target])
        work = self.queue.take(self._task(server, due), now)
        assert work is not None
        server.begin(work.key.task, now)
        return Job(work, server.target)

    def _pull(self, server: Server, due: Mapping[str, float], now: float) -> float:
        """Expected seconds of work that wait for `server`, for each worker's wait."""
        sharing = {
            task: sum(task in s.tasks and (s.up or s is server) for s in self.servers.values())
            for task in due
            if task in server.tasks
        }
        work = sum(due[task] / count for task, count in sharing.items())
        return work / ((server.running + 1) * self._wait(server, now))

    def _wait(self, server: Server, now: float) -> float:
        """What one worker adds to the wait there; that of an average server where unknown."""
        if (known := server.wait(now)) is not None:
            return max(known, 1e-3)
        others = [max(w, 1e-3) for s in self.servers.values() if (w := s.wait(now)) is not None]
        return sum(others) / len(others) if others else 1.0

    def _task(self, server: Server, due: Mapping[str, float]) -> str:
        """The base task that `server` goes on with or turns to."""
        if server.task in due:
            return server.task
        mine = [task for task in due if task in server.tasks]
        held = {s.task for s in self.servers.values() if s is not server and s.up}
        free = [task for task in mine if task not in held]
        return max(free or mine, key=lambda task: due[task])

    def done(self, job: Job, record: TrialRecord, now: float, seconds: float) -> None:
        """`job` has its record at time `now`, after `seconds`."""
        self.servers[job.target].finish(record, now)
        self.queue.costs.learn(record.key, seconds)

    def lost(self, job: Job, now: float, fault: str = "", text: str = "") -> bool:
        """`job` could not be run; whether that counts as one of its attempts."""
        server = self.servers[job.target]
        server.running -= 1
        if len(self.servers) == 1 or not fault:
            return True
        if fault == UNFIT:
            server.retired = text
            return False
        server.fail(now, self._pause)
        return fault == BROKEN or not self._can_wait(server, job, now)

    def _can_wait(self, server: Server, job: Job, now: float) -> bool:
        """Whether nothing is lost by trying `job` again after the others."""
        if now - server.since < self._patience:
            return True
        up = [s for s in self.servers.values() if s.up]
        busy = any(s.running for s in up)
        return busy or any(job.work.key.task in s.tasks for s in up)

    def again(self, job: Job, due: float, charged: bool) -> None:
        """Put the trial of `job` back, not to be run before time `due`."""
        work = job.work
        self.queue.again(replace(work, attempt=work.attempt + charged), due)

    def orphans(self) -> tuple[str, ...]:
        """Unfinished base tasks that no server is left for."""
        left = set(self.queue.waiting())
        kept = {task for s in self.servers.values() if not s.retired for task in s.tasks}
        return tuple(sorted(left - kept))

    def next_time(self, now: float) -> float | None:
        """When a pause of a trial or a server is over; None if nobody pauses."""
        pauses = [s.back for s in self.servers.values() if s.failures and s.back > now]
        if (due := self.queue.next_due(now)) is not None:
            pauses.append(due)
        return min(pauses, default=None)
