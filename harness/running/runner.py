"""The driver of a run: hands a fixed list of trials to workers until every one has a record.

Every listed trial is finished, whatever the order in which they end. A trial that a fault of the
line, a worker or the simulator ended is tried again from its seed with growing pauses, a bounded
number of times over all drivers of the run (`attempts`), then recorded as lost ("infrastructure"):
missing, never a failure. A worker that dies or hangs is replaced, and its trial is run again. What
the policy says of itself, such as an error that it reports, never repeats a trial; if all trials
end so, the run stops (`error_watch`). Which worker runs a trial, and which other trial that worker
holds meanwhile, does not enter the record. A trial that a worker may have died of has its next
worker to itself: else the trial beside it could lose all of its attempts.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from robospa.harness.factory import is_url
from robospa.harness.running.atomic_file import LOGS, StorageError, storage_errors
from robospa.harness.running.attempts import (
    CUT_OFF,
    ErrorWatch,
    LossWriter,
    ProblemWatch,
    attempts_spent,
    earlier_retries,
)
from robospa.harness.running.executor import (
    Executor,
    Fatal,
    Heartbeat,
    Message,
    Proceed,
    RunAborted,
    RunTrial,
    Stop,
    TrialBegins,
    TrialDone,
    TrialLost,
    WorkerHandle,
    WorkerReady,
)
from robospa.harness.running.heartbeat import HeartbeatMonitor
from robospa.harness.running.scheduler import Scheduler, TrialJob, TrialQueue
from robospa.harness.running.status import Autoscaler, Status, TimeBreakdown, time_left
from robospa.harness.running.worker import LocalExecutor, WorkerConfig, task_finder
from robospa.results.records.manifest import Processor
from robospa.results.records.runs import read_file
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.results.scoring.repeats import reached_policy
from robospa.trial import TrialKey

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
        key = self.job.key
        return next((record for record in read_file(self.records) if record.key == key), None)

    def extend(self, seconds: float) -> None:
        """The driver itself was stopped for `seconds`: they do not count."""
        self.deadline += seconds
        if self.monitor is not None:
            self.monitor.extend(seconds)


def needs_worker_alone(job: TrialJob) -> bool:
    """Whether a worker may have died of this trial."""
    return any(row.cause in ("worker_ended", "worker_stuck") for row in job.retries)


def beside(slot: Slot, slots: Sequence[Slot]) -> list[Slot]:
    """The other places of its worker that have a trial."""
    return [
        s
        for s in slots
        if s is not slot and s.worker.name == slot.worker.name and s.job is not None
    ]


def free(slots: Sequence[Slot], extra: bool) -> Iterator[Slot]:
    """Places that can take a trial now, those of idle workers first; `extra` ones only if told."""
    idle = [s for s in slots if s.ready and s.job is None and (extra or not s.extra)]
    for slot in sorted(idle, key=lambda s: len(beside(s, slots))):
        if not any(map(needs_worker_alone, (s.job for s in beside(slot, slots) if s.job))):
            yield slot


FALSE_STARTS = 3
"""After so many workers in a row that ended before they were ready the run stops."""
STATUS_SECONDS = 0.25
STOP_SECONDS = 5.0
"""How long workers may take to close their connections."""
SUSPENDED_SECONDS = 5.0
"""The driver looks at its workers at least twice a second; if not, it was suspended itself."""


@dataclass(frozen=True)
class RunOptions:
    """Limits and retries of a run.

    workers: worker processes at the start, on this machine.
    concurrent_trials: that each of these holds at once, while servers have room for connections.
    attempts: how often a trial is tried, over all drivers of the run, before it is recorded as
        missing; attempts that reached no server count for this driver alone.
    backoff: the pause before attempt k + 2 is `backoff` * 2^k [s].
    trial_seconds: after so long one attempt's worker is killed [s].
    give_up: after so many lost trials in a row the run stops, because the server is gone.
    stuck_seconds: the same for a worker that does not advance though it waits for no policy [s].
    most: how many workers there may be if they wait for their policies while cores idle.
    patience: for so long a trial that cannot reach its server, of several, is charged nothing [s].
    policy_errors: what many trials with the same policy error do: "stop" the run, or just "count".
    """

    workers: int = 1
    attempts: int = 3
    backoff: float = 2.0
    trial_seconds: float = 1800.0
    give_up: int = 5
    stuck_seconds: float = 300.0
    most: int = 0
    patience: float = 60.0
    policy_errors: str = "stop"
    concurrent_trials: int = 1


@dataclass
class Runner:
    """Runs `keys` with workers of `executor`, by default processes here as `config` describes.

    `on_record` gets every record, `on_note` one line for every mishap, `on_status` the run's state
    now and then, `on_processor` the kind of every worker's. `known` has the records of earlier
    drivers.
    """

    config: WorkerConfig
    keys: Sequence[TrialKey]
    options: RunOptions = field(default_factory=RunOptions)
    on_record: Callable[[TrialRecord], None] = lambda record: None
    on_note: Callable[[str], None] = lambda text: None
    on_processor: Callable[[Processor], None] = lambda processor: None
    executor: Executor | None = None
    on_status: Callable[[Status], None] = lambda status: None
    known: Mapping[TrialKey, TrialRecord] = field(default_factory=dict)

    def run(self) -> None:
        """Record every trial. Raises RunAborted; on KeyboardInterrupt workers are killed first."""
        with storage_errors(self.config.folder):
            self.config.folder.mkdir(parents=True, exist_ok=True)  # nobody makes it later
        finder = task_finder(self.config.parts)
        self._queue = TrialQueue(self.keys, finder, earlier_retries(self.known))
        self._errors, self._problems = ErrorWatch(), ProblemWatch()
        self._errors.know(self.known.values())
        most = max(self.options.workers, self.options.most)
        self._scheduler = Scheduler(
            self._queue,
            self.config.targets,
            batches={target: spec.batch for target, spec in self.config.expects.items()},
            one_trial=self.config.one_trial,
            pause=self.options.backoff,
            patience=self.options.patience,
        )
        each = self._concurrent_trials = self.options.concurrent_trials
        self._workers = self.executor or LocalExecutor(self.config, most, each)
        first = most if self.executor else self.options.workers
        self._autoscaler = Autoscaler(first, most, concurrent_trials=each)
        self.times = TimeBreakdown()
        self._slots: list[Slot] = []
        self._closed_by = 0.0  # when the connections of places given up are closed
        self._started = self._false_starts = self._lost_in_a_row = 0
        self._losses = LossWriter(self.config.folder, self._queue)
        self._checked = time.monotonic()
        self._reported = 0.0
        try:
            while self._queue.unsettled:
                self._start_workers()
                self._assign()
                self._receive()
                self._check_deadlines()
                self._report_status()
            for slot in self._slots:
                slot.worker.send(Stop())
            until = time.monotonic() + STOP_SECONDS
            for slot in self._slots:
                slot.worker.join(until - time.monotonic())
        except StorageError as error:
            raise RunAborted(str(error)) from error
        finally:
            for slot in self._slots:
                if slot.worker.exit_status() is None:
                    slot.worker.kill()
                slot.worker.close()
            self._workers.close()
            self._losses.close()

    # --- workers ----------------------------------------------------------------------------------

    def _start_workers(self) -> None:
        """Replace workers that have ended, but never have more places than trials are left; workers
        take a second trial each only when there are as many of them as there should be."""
        left = self._queue.unsettled
        workers = [slot for slot in self._slots if not slot.extra]
        most = self._autoscaler.target if self.executor is None else self._workers.capacity()
        for _ in range(min(most - len(workers), left - len(self._slots))):
            worker = self._workers.start(f"worker-{self._started:03d}")
            self._started += 1
            self._slots.append(Slot(worker, time.monotonic() + START_SECONDS))
        for slot in [slot for slot in workers if slot.ready and self._concurrent_trials > 1]:
            if len(self._slots) < left and (more := slot.worker.another_trial()) is not None:
                self._slots.append(Slot(more, time.monotonic() + START_SECONDS, extra=True))

    def _assign(self) -> None:
        for slot in self._slots:
            if slot.job is not None and not slot.sent and not beside(slot, self._slots):
                self._send(slot)  # its trial has waited for its worker, and has it to itself now
        for slot in [
            s for s in self._slots if self._concurrent_trials == 1 and s.extra and s.job is None
        ]:
            slot.worker.send(Stop())  # its connection may be in another's place
            self._slots.remove(slot)
            self._closed_by = time.monotonic() + STOP_SECONDS
        for slot in free(self._slots, self._concurrent_trials > 1):
            job = self._scheduler.next(time.monotonic(), slot.target)
            if job is None:
                return
            slot.job, slot.target, slot.sent = job, job.target, False
            if not needs_worker_alone(job) or not beside(slot, self._slots):
                self._send(slot)

    def _send(self, slot: Slot) -> None:
        job, now = slot.job, time.monotonic()
        assert job is not None
        slot.sent, slot.started, slot.deadline = True, now, now + self.options.trial_seconds
        slot.monitor = HeartbeatMonitor(now, self.options.stuck_seconds)
        slot.worker.send(RunTrial(job.key, job.target, job.retries))

    def _receive(self) -> None:
        """Wait until a worker sends something or ends, or a pause is over."""
        self._workers.wait([slot.worker for slot in self._slots], self._timeout())
        for text in self._workers.notes():
            self.on_note(text)
        for slot in list(self._slots):
            ended = slot.worker.exit_status()  # asked first, so that its last messages are handled
            for message in slot.worker.messages():
                self._handle(slot, message)
            if ended is not None:
                self._reap(slot, f"its worker died ({ended})")

    def _timeout(self) -> float:
        now = time.monotonic()
        deadlines = [slot.due() for slot in self._slots]
        idle = any(slot.ready and slot.job is None for slot in self._slots)
        if idle and (due := self._scheduler.next_time(now)) is not None:
            deadlines.append(due)
        return max(0.0, min([0.5, *(deadline - now for deadline in deadlines)]))

    def _handle(self, slot: Slot, message: Message) -> None:
        match message:
            case WorkerReady():
                slot.ready, slot.records = True, message.records
                self.on_processor(message.processor)
                self._false_starts = 0
            case Heartbeat():
                if slot.monitor is not None:
                    slot.monitor.receive(message, time.monotonic())
                if new := message.answers - slot.answers:
                    slot.answers = message.answers
                    self._scheduler.servers[slot.target].add_answers(new, message.answer_ms)
            case TrialBegins():
                # On disk, as one that the end of this driver cuts off, before the policy has it.
                job = slot.job
                assert job is not None
                self._losses.write(job.key, CUT_OFF.message, (*job.retries, CUT_OFF))
                slot.worker.send(Proceed())
            case TrialDone():
                self._complete(slot, message.record)
            case Fatal():
                raise RunAborted(message.message)
            case TrialLost():
                job, slot.job = slot.job, None
                if job is not None and not self._narrow(slot, job, message):
                    self._retry(job, message)

    def _reap(self, slot: Slot, text: str, cause: str = "worker_ended") -> None:
        """Take the trial of a dead worker back, unless its record had reached the disk."""
        self._slots.remove(slot)
        slot.worker.close()
        if not slot.ready and not slot.extra:
            self._false_starts += 1
            if self._false_starts >= FALSE_STARTS:
                log = self.config.folder / LOGS / f"{slot.worker.name}.log"
                raise RunAborted(f"workers do not start; the last one's output is in {log}")
        if slot.job is None:
            return
        if not slot.sent:
            self._scheduler.give_back(slot.job, time.monotonic())
        elif (record := slot.written()) is not None:
            self._complete(slot, record)
        else:
            self._retry(slot.job, TrialLost(slot.job.key, RetryRow(cause, text)))

    def _check_deadlines(self) -> None:
        now = time.monotonic()
        gap, self._checked = now - self._checked, now
        for slot in list(self._slots):
            if gap >= SUSPENDED_SECONDS:  # Ctrl-Z, a machine asleep: then no worker is late
                slot.extend(gap)
            if not slot.ready and slot.worker.pending():
                slot.deadline = now + START_SECONDS
            if now <= slot.due():
                continue
            slot.worker.kill()
            self._reap(slot, f"its worker {slot.lateness(now)} and was killed", "worker_stuck")

    def _scale_up(self, target: str) -> None:
        """Start more workers if those there are wait for servers with room, as that at `target`."""
        servers = self._scheduler.servers.values()
        used = [s for s in servers if is_url(s.target) and (s.running or s.target == target)]
        if more := self._autoscaler.scale_up(all(s.saturated for s in used)):
            total = self._autoscaler.target
            self.on_note(f"workers wait while cores idle: {more} more, {total} now")

    # --- trials -----------------------------------------------------------------------------------

    def _complete(self, slot: Slot, record: TrialRecord) -> None:
        job, slot.job, target = slot.job, None, slot.target
        if job is not None:
            now = time.monotonic()
            # A worker's first trial waits until its world and connection are there.
            seconds = now - slot.started if slot.trials else record.wall_time
            slot.trials += 1
            self._scheduler.done(job, record, now, seconds)
        self.times.add(record)
        self._autoscaler.add(record)
        self._settle(record)
        for text in self._problems.add(record):
            self.on_note(text)
        if self.options.policy_errors == "stop":
            self._check_errors(record, target)
        if self.executor is None and self._queue.unsettled > 2 * self._autoscaler.target:
            self._scale_up(target)

    def _check_errors(self, record: TrialRecord, target: str) -> None:
        verdict = self._errors.add(record, target)
        if verdict is None:
            return
        for lost in verdict.withdrawn:
            row = RetryRow("policy_error", lost.message, lost.steps)
            retries = (*lost.retries, row)
            if attempts_spent(retries) < self.options.attempts:
                self._losses.write(lost.key, lost.message, retries)
        raise RunAborted(verdict.text)

    def _settle(self, record: TrialRecord) -> None:
        self._queue.settle()
        if record.end != "infrastructure":
            self._lost_in_a_row = 0
        self.on_record(record)

    def _narrow(self, slot: Slot, job: TrialJob, lost: TrialLost) -> bool:
        """Whether `job` may only have found no room for one more connection of a worker. It is not
        charged, and from now on every worker holds one trial."""
        several = time.monotonic() < self._closed_by or any(s.extra for s in self._slots)
        unfit = lost.fault == "incompatible" and not slot.extra
        if lost.row.cause != "unreachable" or not several or unfit:
            return False
        if self._concurrent_trials > 1:
            text = "workers hold one trial each from now on, since one more could not connect"
            self.on_note(f"{text}: {lost.row.message}")
        self._concurrent_trials = self._autoscaler.concurrent_trials = 1
        self._scheduler.give_back(job, time.monotonic() + self.options.backoff)
        return True

    def _retry(self, job: TrialJob, lost: TrialLost) -> None:
        text, now = lost.row.message, time.monotonic()
        unfit = lost.fault == "incompatible"
        server = self._scheduler.servers[job.target]
        retries = (*job.retries, lost.row)
        # On disk at once, so that no later driver forgets it, whatever ends this one.
        known = self._losses.write(job.key, text, retries) if reached_policy(lost.row) else None
        if unfit and len(self._scheduler.servers) == 1:
            raise RunAborted(text)
        was_up = server.up
        charged = self._scheduler.lost(job, now, lost.fault, text) or known is not None
        if tasks := self._scheduler.tasks_without_server():
            raise RunAborted(f"no policy server is left for {tasks[0]}: {text}")
        if unfit:
            self.on_note(f"{job.target} is left out from now on: {text}")
        elif was_up and not server.up:
            self.on_note(f"{job.target} is away ({text}); other trials run until it is back")
        if not charged:
            self._scheduler.requeue(job, now, charged)
            return
        most = self.options.attempts
        if lost.retry and job.attempt < most and attempts_spent(retries) < most:
            pause = self.options.backoff * 2.0 ** (job.attempt - 1)
            self.on_note(f"{job.key.slug}: {text}; trying again in {pause:g} s")
            self._scheduler.requeue(replace(job, retries=retries), now + pause, charged)
        else:
            self._record_missing(known or self._losses.write(job.key, text, retries))

    def _record_missing(self, record: TrialRecord) -> None:
        self.on_note(f"{record.key.slug}: {record.message}; recorded as missing")
        self._lost_in_a_row += 1
        self._settle(record)
        if self._lost_in_a_row >= self.options.give_up and self._queue.unsettled:
            raise RunAborted(
                f"{self._lost_in_a_row} trials in a row could not be run, the last because: "
                f"{record.message}"
            )

    # --- status -----------------------------------------------------------------------------------

    def _report_status(self) -> None:
        now = time.monotonic()
        if now - self._reported >= STATUS_SECONDS or not self._queue.unsettled:
            self._reported = now
            self.on_status(self.status(now))

    def status(self, now: float) -> Status:
        queue, local = self._queue, self.executor is None
        ready = [slot for slot in self._slots if slot.ready]
        workers = [slot for slot in self._slots if not slot.extra]
        running = [
            (queue.durations.expect(slot.job.key), now - slot.started)
            for slot in ready
            if slot.job is not None and slot.sent
        ]
        return Status(
            now,
            workers=len(workers),
            running=len(running),
            starting=sum(not slot.ready for slot in workers),
            places=len(ready),
            cores=self._autoscaler.cores if local else self._workers.capacity(),
            servers=tuple(self._scheduler.servers.values()),
            shares=self.times.recent_shares(),
            left=time_left(queue.left(), running, len(ready)) if queue.durations.known else None,
        )
