"""The driver of a run: hands a fixed list of trials to worker processes until every one is settled.

Every listed trial is finished, whatever the order in which they end. A trial that could not be run
is tried again from its seed a bounded number of times with growing pauses, then recorded as lost
("infrastructure"): missing, never a failure. A worker that dies or hangs gives its trial back and
is replaced. Which worker runs a trial, and when, does not enter the record.
"""

from __future__ import annotations

import multiprocessing
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from robospa.harness.factory import load
from robospa.harness.queue import Pending, TrialQueue
from robospa.harness.store import RecordWriter
from robospa.harness.worker import LOGS, WorkerConfig
from robospa.harness.worker import main as worker_main
from robospa.results.reading import read_file
from robospa.results.records import TrialKey, TrialRecord

START_SECONDS = 120.0
"""A worker that is not ready by then is replaced."""


class RunAborted(Exception):
    """The run cannot go on; what is finished is kept, and the run can be resumed."""


@dataclass(frozen=True)
class RunOptions:
    """How stubborn a run is. `trial_seconds` is the most one attempt may take before its worker is
    killed; pauses before retries are `backoff` * 2^k seconds; after `give_up` trials lost in a row
    the run stops, because the server is gone rather than a trial unlucky."""

    workers: int = 1
    attempts: int = 3
    backoff: float = 2.0
    trial_seconds: float = 1800.0
    give_up: int = 5


@dataclass
class _Hand:
    """One worker process as the driver sees it."""

    process: Any
    pipe: Connection
    name: str
    deadline: float
    file: Path | None = None
    work: Pending | None = None
    ready: bool = False


@dataclass
class Runner:
    """Runs `keys` with the workers that `config` describes.

    `on_record` sees every settled trial, `on_note` one line for every mishap.
    """

    config: WorkerConfig
    keys: Sequence[TrialKey]
    options: RunOptions = field(default_factory=RunOptions)
    on_record: Callable[[TrialRecord], None] = lambda record: None
    on_note: Callable[[str], None] = lambda text: None

    def run(self) -> None:
        """Settle every trial. Raises RunAborted; on KeyboardInterrupt workers are killed first."""
        self._queue = TrialQueue(self.keys, load(self.config.parts))
        self._hands: list[_Hand] = []
        self._started = 0
        self._false_starts = 0
        self._lost_in_a_row = 0
        self._writer: RecordWriter | None = None
        try:
            while self._queue.unsettled:
                self._staff()
                self._assign()
                self._listen()
                self._check_deadlines()
            self._dismiss()
        finally:
            self._kill_all()
            if self._writer is not None:
                self._writer.close()

    def _staff(self) -> None:
        """Replace workers that are gone, but never have more than there are trials left."""
        wanted = min(self.options.workers, self._queue.unsettled)
        while len(self._hands) < wanted:
            self._hands.append(self._hire())

    def _hire(self) -> _Hand:
        spawn = multiprocessing.get_context("spawn")
        name = f"worker-{self._started:03d}"
        self._started += 1
        ours, theirs = spawn.Pipe()
        process = spawn.Process(
            target=worker_main, args=(theirs, self.config, name), name=name, daemon=True
        )
        with _deaf():
            process.start()
        theirs.close()
        return _Hand(process, ours, name, time.monotonic() + START_SECONDS)

    def _assign(self) -> None:
        for hand in self._hands:
            if hand.ready and hand.work is None:
                work = self._queue.take(time.monotonic())
                if work is None:
                    return
                hand.work = work
                hand.deadline = time.monotonic() + self.options.trial_seconds
                self._send(hand, ("run", work.key, work.attempt))

    @staticmethod
    def _send(hand: _Hand, message: tuple[Any, ...]) -> None:
        try:
            hand.pipe.send(message)
        except OSError:
            return  # it has just died: `_listen` notices and gives the trial back

    def _listen(self) -> None:
        """Wait until a worker says something, dies, or a pause is over."""
        sources = [s for h in self._hands for s in (h.pipe, h.process.sentinel)]
        wait(sources, timeout=self._patience())
        for hand in list(self._hands):
            try:
                while hand.pipe.poll():
                    self._hear(hand, hand.pipe.recv())
            except (EOFError, OSError):
                pass  # closed: it is dying
            if not hand.process.is_alive():
                self._bury(hand, f"its worker died ({_exit_text(hand.process.exitcode)})")

    def _patience(self) -> float:
        """Seconds until something has to be looked at, at most half a second."""
        now = time.monotonic()
        deadlines = [h.deadline for h in self._hands if h.work is not None or not h.ready]
        idle = any(h.ready and h.work is None for h in self._hands)
        if idle and (due := self._queue.next_due()) is not None:
            deadlines.append(due)
        return max(0.0, min([0.5, *(d - now for d in deadlines)]))

    def _hear(self, hand: _Hand, message: tuple[Any, ...]) -> None:
        if message[0] == "ready":
            hand.ready, hand.file = True, message[1]
            self._false_starts = 0
        elif message[0] == "done":
            hand.work = None
            self._settle(message[1])
        elif message[0] == "fatal":
            raise RunAborted(message[1])
        else:
            _, _, text, retry = message
            work, hand.work = hand.work, None
            if work is not None:
                self._lose(work, text, retry)

    def _settle(self, record: TrialRecord) -> None:
        self._queue.settle()
        if record.end != "infrastructure":
            self._lost_in_a_row = 0
        self.on_record(record)

    def _lose(self, work: Pending, text: str, retry: bool) -> None:
        """Queue another attempt at `work`, or record it as missing."""
        if retry and work.attempt < self.options.attempts:
            pause = self.options.backoff * 2.0 ** (work.attempt - 1)
            self.on_note(f"{work.key.slug}: {text}; trying again in {pause:g} s")
            self._queue.again(work, time.monotonic() + pause)
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

    def _bury(self, hand: _Hand, text: str) -> None:
        """Take back the trial of a dead worker, unless its record had reached the disk."""
        self._hands.remove(hand)
        hand.process.join()
        hand.pipe.close()
        if not hand.ready:
            self._false_starts += 1
            if self._false_starts >= 3:
                log = self.config.folder / LOGS / f"{hand.name}.log"
                raise RunAborted(f"workers do not start; the last one's output is in {log}")
        if hand.work is None:
            return
        written = read_file(hand.file) if hand.file is not None and hand.file.exists() else []
        for record in written:
            if record.key == hand.work.key:
                self._settle(record)
                return
        self._lose(hand.work, text, True)

    def _check_deadlines(self) -> None:
        now = time.monotonic()
        for hand in list(self._hands):
            if (hand.work is not None or not hand.ready) and now > hand.deadline:
                hand.process.kill()
                hand.process.join()
                limit = self.options.trial_seconds if hand.ready else START_SECONDS
                self._bury(hand, f"its worker was stuck for {limit:g} s and was killed")

    def _dismiss(self) -> None:
        """Let idle workers close their connections, for a moment."""
        for hand in self._hands:
            self._send(hand, ("stop",))
        until = time.monotonic() + 5.0
        for hand in self._hands:
            hand.process.join(max(0.0, until - time.monotonic()))

    def _kill_all(self) -> None:
        for hand in self._hands:
            if hand.process.is_alive():
                hand.process.kill()
            hand.process.join()
            hand.pipe.close()


@contextmanager
def _deaf() -> Iterator[None]:
    """Start processes that Ctrl-C does not reach, not even while they are starting."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _exit_text(code: int | None) -> str:
    return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"


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
