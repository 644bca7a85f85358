"""A place for one trial in a worker, as the driver of a run sees it.

A trial that a worker may have died of has its next worker to itself: else the same trial beside it
could lose all of its attempts.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from robospa.harness.running.executor import RunTrial, Stop, WorkerHandle
from robospa.harness.running.heartbeat import HeartbeatMonitor
from robospa.harness.running.scheduler import TrialJob, TrialQueue
from robospa.harness.running.status import ServerStats, Status, time_left
from robospa.results.records.runs import read_file
from robospa.results.records.trial_record import TrialRecord

START_SECONDS = 120.0
"""A worker that is not ready by then is replaced."""


@dataclass
class Slot:
    """One place and what the driver knows of it."""

    worker: WorkerHandle
    deadline: float
    records: Path | None = None
    extra: bool = False
    """Whether its worker has another place, which was there first."""
    job: TrialJob | None = None
    sent: bool = True
    """Whether its worker has `job`; it may have to wait until it is alone there."""
    target: str = ""
    """The policy that it is connected to."""
    started: float = 0.0
    """When it was sent its trial."""
    trials: int = 0
    answers: int = 0
    """Of policies to this worker, as far as its heartbeats told."""
    ready: bool = False
    monitor: HeartbeatMonitor | None = None

    def due(self) -> float:
        """When it has to have advanced; infinite while it has nothing to do."""
        if not self.sent or (self.ready and self.job is None):
            return float("inf")
        return self.deadline if self.monitor is None else min(self.deadline, self.monitor.deadline)

    def send(self, now: float, trial_seconds: float, stuck_seconds: float) -> None:
        """Send the worker its trial, which has so many seconds from now on."""
        assert self.job is not None
        self.sent, self.started, self.deadline = True, now, now + trial_seconds
        self.monitor = HeartbeatMonitor(now, stuck_seconds)
        work = self.job.work
        self.worker.send(RunTrial(work.key, self.job.target, work.retries))

    def lateness(self, now: float) -> str:
        """By how much its worker is late, in words."""
        if not self.ready:
            return f"was not ready after {START_SECONDS:g} s"
        if now > self.deadline:
            return f"was stuck for {self.deadline - self.started:g} s"
        assert self.monitor is not None
        return f"did not advance for {self.monitor.seconds:g} s"

    def written(self) -> TrialRecord | None:
        """The record of its trial if its worker has written it; the worker has ended."""
        if self.job is None or self.records is None or not self.records.exists():
            return None
        key = self.job.work.key
        return next((record for record in read_file(self.records) if record.key == key), None)

    def extend(self, seconds: float) -> None:
        """The driver itself was stopped for `seconds`: they do not count."""
        self.deadline += seconds
        if self.monitor is not None:
            self.monitor.extend(seconds)


def needs_worker_alone(job: TrialJob) -> bool:
    """Whether a worker may have died of this trial."""
    return any(row.cause in ("worker_ended", "worker_stuck") for row in job.work.retries)


def beside(slot: Slot, slots: Sequence[Slot]) -> list[Slot]:
    """The other places of its worker that have a trial."""
    return [
        s
        for s in slots
        if s is not slot and s.worker.name == slot.worker.name and s.job is not None
    ]


def sendable(slots: Sequence[Slot]) -> list[Slot]:
    """Places whose trial has waited for its worker and now has it to itself."""
    return [s for s in slots if s.job is not None and not s.sent and not beside(s, slots)]


def free(slots: Sequence[Slot], extra: bool) -> Iterator[Slot]:
    """Places that can take a trial now, those of idle workers first; `extra` ones only if told."""
    idle = [s for s in slots if s.ready and s.job is None and (extra or not s.extra)]
    for slot in sorted(idle, key=lambda s: len(beside(s, slots))):
        if not any(map(needs_worker_alone, (s.job for s in beside(slot, slots) if s.job))):
            yield slot


def run_status(
    now: float,
    slots: Sequence[Slot],
    queue: TrialQueue,
    *,
    cores: int,
    servers: Sequence[ServerStats],
    shares: Mapping[str, float],
) -> Status:
    """The state of a run at time `now`."""
    ready = [slot for slot in slots if slot.ready]
    workers = [slot for slot in slots if not slot.extra]
    running = [
        (queue.durations.expect(slot.job.work.key), now - slot.started)
        for slot in ready
        if slot.job is not None and slot.sent
    ]
    return Status(
        now,
        workers=len(workers),
        running=len(running),
        starting=sum(not slot.ready for slot in workers),
        places=len(ready),
        cores=cores,
        servers=servers,
        shares=shares,
        left=time_left(queue.left(), running, len(ready)) if queue.durations.known else None,
    )


def stop_all(slots: Sequence[Slot], seconds: float) -> None:
    """Give idle workers so many `seconds` to close their connections."""
    for slot in slots:
        slot.worker.send(Stop())
    until = time.monotonic() + seconds
    for slot in slots:
        slot.worker.join(until - time.monotonic())


def kill_all(slots: Sequence[Slot]) -> None:
    """End all workers that have not ended."""
    for slot in slots:
        if slot.worker.exit_status() is None:
            slot.worker.kill()
        slot.worker.close()
