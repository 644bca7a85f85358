"""The driver of a run: hands a fixed list of trials to worker processes until every one is settled.

Every listed trial is finished, whatever the order in which they end. A trial that could not be run
is tried again from its seed a bounded number of times with growing pauses, then recorded as lost
("infrastructure"): missing, never a failure. A worker that dies or hangs gives its trial back and
is replaced. Which worker runs a trial, and when, does not enter the record.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robospa.harness.factory import is_url
from robospa.harness.running.executor import Executor, Hand, Message
from robospa.harness.running.executor import RunAborted as RunAborted
from robospa.harness.running.local_workers import LocalExecutor
from robospa.harness.running.queue import TrialQueue
from robospa.harness.running.scheduler import Job, Scheduler
from robospa.harness.running.servers import UNFIT
from robospa.harness.running.staffing import Staffing
from robospa.harness.running.status import Shares, Status
from robospa.harness.running.store import RecordWriter, StorageError
from robospa.harness.running.watchdog import Watch
from robospa.harness.running.worker import LOGS, WorkerConfig, task_finder
from robospa.results.records.run_io import read_file
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

START_SECONDS = 120.0
"""A worker that is not ready by then is replaced."""
TELL_SECONDS = 0.25
STOPPED_SECONDS = 5.0
"""The driver looks at its workers at least twice a second; if not, it was stopped itself."""


@dataclass(frozen=True)
class RunOptions:
    """How stubborn a run is. `trial_seconds` is the most one attempt may take before its worker is
    killed, `stuck_seconds` the most without getting on though no policy is waited for; pauses
    before retries are `backoff` * 2^k seconds; after `give_up` trials lost in a row the run stops,
    because the server is gone rather than a trial unlucky. There may be `most` workers if `workers`
    of them wait for their policies while cores idle. A server that is away beside others is tried
    for `patience` seconds before that counts as an attempt at a trial."""

    workers: int = 1
    attempts: int = 3
    backoff: float = 2.0
    trial_seconds: float = 1800.0
    give_up: int = 5
    stuck_seconds: float = 300.0
    most: int = 0
    patience: float = 60.0


@dataclass
class _Seat:
    """One worker and what the driver knows of it."""

    hand: Hand
    deadline: float
    file: Path | None = None
    job: Job | None = None
    at: str = ""
    """The policy that it is connected to."""
    begun: float = 0.0
    trials: int = 0
    ready: bool = False
    watch: Watch | None = None

    def due(self) -> float:
        """When it has to have got further; infinite while it has nothing to do."""
        if self.ready and self.job is None:
            return float("inf")
        return self.deadline if self.watch is None else min(self.deadline, self.watch.deadline)


@dataclass
class Runner:
    """Runs `keys` with workers of `executor`, by default processes here as `config` describes.

    `on_record` sees every settled trial, `on_note` one line for every mishap, `on_status` every now
    and then how things are.
    """

    config: WorkerConfig
    keys: Sequence[TrialKey]
    options: RunOptions = field(default_factory=RunOptions)
    on_record: Callable[[TrialRecord], None] = lambda record: None
    on_note: Callable[[str], None] = lambda text: None
    executor: Executor | None = None
    on_status: Callable[[Status], None] = lambda status: None

    def run(self) -> None:
        """Settle every trial. Raises RunAborted; on KeyboardInterrupt workers are killed first."""
        self._queue = TrialQueue(self.keys, task_finder(self.config.parts))
        most = max(self.options.workers, self.options.most)
        self._scheduler = Scheduler(
            self._queue,
            self.config.targets,
            batches={target: spec.batch for target, spec in self.config.expects.items()},
            pause=self.options.backoff,
            patience=self.options.patience,
        )
        self._crew = self.executor or LocalExecutor(self.config, most)
        self._staffing = Staffing(self.options.workers if self.executor is None else most, most)
        self.shares = Shares()
        self._seats: list[_Seat] = []
        self._started = 0
        self._false_starts = 0
        self._lost_in_a_row = 0
        self._writer: RecordWriter | None = None
        self._looked = time.monotonic()
        self._told = 0.0
        try:
            while self._queue.unsettled:
                self._staff()
                self._assign()
                self._listen()
                self._check_deadlines()
                self._tell()
            self._dismiss()
        except StorageError as error:
            raise RunAborted(str(error)) from error
        finally:
            self._kill_all()
            if self._writer is not None:
                self._writer.close()

    def _staff(self) -> None:
        """Replace workers that are gone, but never have more than there are trials left."""
        wanted = self._crew.room() if self.executor is not None else self._staffing.wanted
        wanted = min(wanted, self._queue.unsettled)
        while len(self._seats) < wanted:
            hand = self._crew.hire(f"worker-{self._started:03d}")
            self._started += 1
            self._seats.append(_Seat(hand, time.monotonic() + START_SECONDS))

    def _assign(self) -> None:
        for seat in self._seats:
            if seat.ready and seat.job is None:
                now = time.monotonic()
                job = self._scheduler.next(now, seat.at)
                if job is None:
                    return
                seat.job, seat.at, seat.begun = job, job.target, now
                seat.deadline = now + self.options.trial_seconds
                seat.watch = Watch(now, self.options.stuck_seconds)
                seat.hand.send(("run", job.work.key, job.work.attempt, job.target))

    def _listen(self) -> None:
        """Wait until a worker says something, dies, or a pause is over."""
        self._crew.wait([seat.hand for seat in self._seats], self._patience())
        for text in self._crew.news():
            self.on_note(text)
        for seat in list(self._seats):
            gone = seat.hand.gone()  # asked first: what it said before it went is still heard
            for message in seat.hand.messages():
                self._hear(seat, message)
            if gone is not None:
                self._bury(seat, f"its worker died ({gone})")

    def _patience(self) -> float:
        """Seconds until something has to be looked at, at most half a second."""
        now = time.monotonic()
        deadlines = [seat.due() for seat in self._seats]
        idle = any(s.ready and s.job is None for s in self._seats)
        if idle and (due := self._scheduler.next_time(now)) is not None:
            deadlines.append(due)
        return max(0.0, min([0.5, *(d - now for d in deadlines)]))

    def _hear(self, seat: _Seat, message: Message) -> None:
        if message[0] == "ready":
            seat.ready, seat.file = True, message[1]
            self._false_starts = 0
        elif message[0] == "beat":
            if seat.watch is not None:
                seat.watch.heard(message, time.monotonic())
        elif message[0] == "done":
            self._finish(seat, message[1])
        elif message[0] == "fatal":
            raise RunAborted(message[1])
        else:
            _, _, text, retry, fault = message
            job, seat.job = seat.job, None
            if job is not None:
                self._lose(job, text, retry, fault)

    def _finish(self, seat: _Seat, record: TrialRecord) -> None:
        """The trial of `seat` has its record."""
        job, seat.job = seat.job, None
        if job is not None:
            now = time.monotonic()
            # A worker's first trial waits until its world and connection are there.
            seconds = now - seat.begun if seat.trials else record.wall_time
            seat.trials += 1
            self._scheduler.done(job, record, now, seconds)
        self.shares.add(record)
        self._staffing.heard(record)
        self._settle(record)
        if self.executor is None and self._queue.unsettled > 2 * self._staffing.wanted:
            self._grow(seat.at)

    def _grow(self, at: str) -> None:
        """More workers if those that are there wait for servers that have room, as at `at`."""
        servers = self._scheduler.servers.values()
        asked = [s for s in servers if is_url(s.target) and (s.running or s.target == at)]
        if more := self._staffing.review(all(s.saturated for s in asked)):
            self.on_note(f"workers wait while cores idle: {more} more, {self._staffing.wanted} now")

    def _settle(self, record: TrialRecord) -> None:
        self._queue.settle()
        if record.end != "infrastructure":
            self._lost_in_a_row = 0
        self.on_record(record)

    def _lose(self, job: Job, text: str, retry: bool, fault: str = "") -> None:
        """Queue another attempt at the trial of `job`, or record it as missing."""
        work, now = job.work, time.monotonic()
        if fault == UNFIT and len(self._scheduler.servers) == 1:
            raise RunAborted(text)
        before = self._scheduler.servers[job.target].up
        charged = self._scheduler.lost(job, now, fault, text)
        if orphans := self._scheduler.orphans():
            raise RunAborted(f"no policy server is left for {orphans[0]}: {text}")
        if fault == UNFIT:
            self.on_note(f"{job.target} takes part no more: {text}")
        elif before and not self._scheduler.servers[job.target].up:
            self.on_note(f"{job.target} is away ({text}); other trials run until it is back")
        if not charged:
            self._scheduler.again(job, now, charged)
            return
        if retry and work.attempt < self.options.attempts:
            pause = self.options.backoff * 2.0 ** (work.attempt - 1)
            self.on_note(f"{work.key.slug}: {text}; trying again in {pause:g} s")
            self._scheduler.again(job, now + pause, charged)
            return
        self.on_note(f"{work.key.slug}: {text}; recorded as missing")
        if self._writer is None:
            self._writer = RecordWriter(self.config.folder)
        record = lost_record(work.key, text, work.attempt, self._queue)
        self._writer.write(record)
        self._lost_in_a_row += 1
        self._settle(record)
        if self._lost_in_a_row >= self.options.give_up and self._queue.unsettled:
            raise RunAborted(
                f"{self._lost_in_a_row} trials in a row could not be run, the last because: {text}"
            )

    def _bury(self, seat: _Seat, text: str) -> None:
        """Take back the trial of a dead worker, unless its record had reached the disk."""
        self._seats.remove(seat)
        seat.hand.close()
        if not seat.ready:
            self._false_starts += 1
            if self._false_starts >= 3:
                log = self.config.folder / LOGS / f"{seat.hand.name}.log"
                raise RunAborted(f"workers do not start; the last one's output is in {log}")
        if seat.job is None:
            return
        written = read_file(seat.file) if seat.file is not None and seat.file.exists() else []
        for record in written:
            if record.key == seat.job.work.key:
                self._finish(seat, record)
                return
        self._lose(seat.job, text, True)

    def _check_deadlines(self) -> None:
        now = time.monotonic()
        self._forgive(now - self._looked)
        self._looked = now
        for seat in list(self._seats):
            if not seat.ready and seat.hand.waiting():
                seat.deadline = now + START_SECONDS
            if now <= seat.due():
                continue
            seat.hand.kill()
            if not seat.ready:
                text = f"its worker was not ready after {START_SECONDS:g} s and was killed"
            elif now > seat.deadline:
                text = f"its worker was stuck for {self.options.trial_seconds:g} s and was killed"
            else:
                text = (
                    f"its worker did not get on for {self.options.stuck_seconds:g} s and was killed"
                )
            self._bury(seat, text)

    def _tell(self) -> None:
        """Say how things are, a few times a second and at the end."""
        now = time.monotonic()
        if now - self._told >= TELL_SECONDS or not self._queue.unsettled:
            self._told = now
            self.on_status(self.status(now))

    def status(self, now: float) -> Status:
        """How things are at time `now`."""
        costs, ready = self._queue.costs, [s for s in self._seats if s.ready]
        running = [s for s in ready if s.job is not None]
        left = self._queue.left()
        for seat in running:
            assert seat.job is not None
            left += max(0.0, costs.expect(seat.job.work.key) - (now - seat.begun))
        return Status(
            now,
            workers=len(self._seats),
            running=len(running),
            starting=len(self._seats) - len(ready),
            cores=self._staffing.cores if self.executor is None else self._crew.room(),
            servers=tuple(self._scheduler.servers.values()),
            shares=self.shares.now(),
            left=left / max(1, len(ready)) if costs.known else None,
        )

    def _forgive(self, gap: float) -> None:
        """A driver that was stopped itself (Ctrl-Z, a machine put to sleep) blames nobody."""
        if gap < STOPPED_SECONDS:
            return
        for seat in self._seats:
            seat.deadline += gap
            if seat.watch is not None:
                seat.watch.forgive(gap)

    def _dismiss(self) -> None:
        """Let idle workers close their connections, for a moment."""
        for seat in self._seats:
            seat.hand.send(("stop",))
        until = time.monotonic() + 5.0
        for seat in self._seats:
            seat.hand.join(until - time.monotonic())

    def _kill_all(self) -> None:
        for seat in self._seats:
            if seat.hand.gone() is None:
                seat.hand.kill()
            seat.hand.close()
        self._crew.close()


def lost_record(key: TrialKey, message: str, attempts: int, queue: TrialQueue) -> TrialRecord:
    """The record of a trial that could not be run."""
    facts = queue.facts(key)
    return TrialRecord(
        key=key,
        category=facts.category,
        instruction="",
        scene_digest="",
        end="infrastructure",
        success=False,
        done=0,
        best=0,
        total=facts.subtasks,
        candidates=facts.candidates,
        steps=0,
        physics_steps=0,
        policy_calls=0,
        digest="",
        actions_digest="",
        wall_time=0.0,
        message=message,
        attempts=attempts,
    )
