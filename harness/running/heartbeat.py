"""Is a worker still advancing with its trial? Both ends of the answer.

A thread of the worker tells the driver about once a second how often something has advanced (a
scene loaded, an action polled or executed, an answer received) and what the worker is doing. A
worker that is stopped, or stuck inside native code that never lets another thread run, sends
nothing; one that is stuck elsewhere sends the same count for ever. Waiting for a server is no
fault: the client has deadlines of its own. Nor is waiting for another trial of the same worker,
which is watched itself. A policy inside the worker may keep all of it busy for long (loading
weights), so that is announced, and then only the trial's own deadline counts.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from typing import Any

from robospa.harness.factory import is_url
from robospa.harness.running.executor import Activity, Heartbeat
from robospa.observation import Observation
from robospa.protocol.errors import (
    PolicyAnswerError,
    PolicyError,
    WireError,
    error_sentence,
    policy_traceback,
)
from robospa.protocol.policy import Policy, PolicyAnswer, PolicySpec, TrialInfo, has

HEARTBEAT_SECONDS = 1.0


class HeartbeatSender:
    """The worker's end, of one of the trials that it holds. `send` may block or raise OSError.
    `turn` is there if other trials compute while this one waits for its server."""

    def __init__(
        self, send: Callable[[Heartbeat], None] = lambda beat: None, turn: ComputeLock | None = None
    ) -> None:
        self._send = send
        self._turn = turn
        self.count = self.answers = 0
        self.answer_ms = 0.0
        self.policy_seconds = 0.0
        """What the last call of a policy took, without the wait for the turn after it."""
        self.activity: Activity = "simulating"

    def start(self) -> None:
        """Send heartbeats until the process ends or the driver is gone."""
        threading.Thread(target=self._run, name="heartbeat", daemon=True).start()

    def _run(self) -> None:
        pause = threading.Event()
        while not pause.wait(HEARTBEAT_SECONDS):
            try:
                self._send(self._beat())
            except OSError:
                return

    def _beat(self) -> Heartbeat:
        return Heartbeat(self.count, self.activity, self.answers, self.answer_ms)

    def answered(self, seconds: float) -> None:
        self.answers += 1
        self.answer_ms = 1000.0 * seconds

    def advance(self, *_: object) -> None:
        self.count += 1

    @contextmanager
    def computing(self) -> Iterator[None]:
        """While it is this trial's turn."""
        self.activity = "waiting"
        with self._turn or nullcontext():
            self.activity = "simulating"
            yield

    def processor(self) -> float:
        """Processor time of this trial's simulation so far [s]."""
        return time.process_time() if self._turn is None else self._turn.processor()

    @contextmanager
    def policy(self, target: str) -> Iterator[None]:
        """While the policy at `target` is doing something; other trials may compute if it does so
        elsewhere."""
        self.count += 1
        elsewhere = is_url(target)
        if elsewhere:
            self.activity = "waiting"
        else:
            self.activity = "in_policy"
            self._send(self._beat())
        try:
            with self._turn.given_away() if self._turn and elsewhere else nullcontext():
                started = time.perf_counter()
                try:
                    yield
                finally:
                    self.policy_seconds = time.perf_counter() - started
        finally:
            self.activity = "simulating"
            self.count += 1
            if not elsewhere:
                self._send(self._beat())


class MonitoredPolicy:
    """A policy whose calls `heartbeat` knows about. What a policy may lack does nothing here.

    An exception of a policy in this process becomes a PolicyError. `in_trial`: it was sent a trial
    since it was connected to, or since `begin`. `failed`: it reported an error of its own since
    then, after which its connection may be of no more use. `announce` is called before it is sent
    a trial.
    """

    def __init__(
        self,
        policy: Policy,
        target: str,
        heartbeat: HeartbeatSender,
        announce: Callable[[], None] = lambda: None,
    ) -> None:
        self._policy, self._announce = policy, announce
        self.target = target
        self._heartbeat = heartbeat
        self.in_trial = self.failed = False

    @property
    def spec(self) -> PolicySpec:
        return self._policy.spec

    @property
    def hello(self) -> Mapping[str, Any]:
        """The server's greeting; empty for a policy without a server."""
        return self._policy.hello if has(self._policy, "hello") else {}

    @property
    def last_timing(self) -> Mapping[str, float]:
        """The server's times of the last answer [ms]; empty if it reports none."""
        return self._policy.last_timing if has(self._policy, "last_timing") else {}

    def begin(self) -> None:
        self.in_trial = self.failed = False

    def reset(self, trial: TrialInfo) -> None:
        with self._heartbeat.policy(self.target):
            self._announce()
            self.in_trial = True
            with self._own_errors():
                self._policy.reset(trial)

    def infer(self, observation: Observation) -> PolicyAnswer:
        """The policy's answer, not yet checked."""
        with self._heartbeat.policy(self.target), self._own_errors():
            answer = self._policy.infer(observation)
        self._heartbeat.answered(self.call_seconds)
        return answer

    @property
    def call_seconds(self) -> float:
        """What the last call took, without the wait for other trials of the process after it."""
        return self._heartbeat.policy_seconds

    @contextmanager
    def _own_errors(self) -> Iterator[None]:
        """Tell errors of the policy from those of the line to it."""
        try:
            yield
        except PolicyAnswerError:
            raise
        except PolicyError:
            self.failed = True
            raise
        except WireError:
            raise
        except Exception as error:
            if is_url(self.target):
                raise
            self.failed = True
            with suppress(OSError):  # the log's disk may be full
                print(policy_traceback(error), file=sys.stderr, flush=True)
            raise PolicyError(error_sentence(error)) from error

    def end(self, outcome: Mapping[str, Any]) -> None:
        if has(self._policy, "end"):
            with self._heartbeat.policy(self.target):
                self._policy.end(outcome)

    def reconnect(self) -> None:
        if has(self._policy, "reconnect"):
            with self._heartbeat.policy(self.target):
                self._policy.reconnect()

    def close(self) -> None:
        if has(self._policy, "close"):
            with self._heartbeat.policy(self.target):
                self._policy.close()


@dataclass
class HeartbeatMonitor:
    """The driver's end: watches one attempt at a trial, which last advanced at time `since` of the
    driver's own monotonic clock; `seconds` without advancing are too many."""

    since: float
    seconds: float
    _count: int = -1
    _activity: Activity = "simulating"

    def receive(self, beat: Heartbeat, now: float) -> None:
        if beat.progress != self._count or beat.activity == "waiting":
            self.since = now
        self._count, self._activity = beat.progress, beat.activity

    def extend(self, seconds: float) -> None:
        """The driver itself was stopped for `seconds`: they do not count."""
        self.since += seconds

    @property
    def deadline(self) -> float:
        """When it is too late; infinite inside a policy of the worker's own."""
        return float("inf") if self._activity == "in_policy" else self.since + self.seconds


class ComputeLock:
    """A trial's access to its process; `lock` is the same for all trials there."""

    def __init__(self, lock: threading.Lock) -> None:
        self._lock = lock
        self._seconds = 0.0
        self._since: float | None = None

    def __enter__(self) -> ComputeLock:
        self._lock.acquire()
        self._since = time.process_time()
        return self

    def __exit__(self, *_: object) -> None:
        self._seconds, self._since = self.processor(), None
        self._lock.release()

    def processor(self) -> float:
        """Processor time so far [s]: that of the process during its turns, threads of the renderer
        included, and else that of its own thread."""
        now = 0.0 if self._since is None else time.process_time() - self._since
        return self._seconds + now

    @contextmanager
    def given_away(self) -> Iterator[None]:
        """Let other trials compute meanwhile; only for who has the turn."""
        self.__exit__()
        own = time.thread_time()
        try:
            yield
        finally:
            self._seconds += time.thread_time() - own
            self.__enter__()
