"""A policy during a trial: what it is asked, how long it takes, and where the trial's time goes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from robospa.protocol.policy import USAGE, Policy, PolicySpec
from robospa.results.records import trial_record

if TYPE_CHECKING:
    from robospa.harness.trial import TrialState

P = ParamSpec("P")
T = TypeVar("T")
SERVER_TIMES = {"queue": "queue_ms", "infer": "infer_ms", "batch": "batch"}
"""Entries of a record's `latency` that come from the server, and what the wire calls them."""


class Stopwatch:
    """Seconds by purpose."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.last_call = 0.0
        """What the last call of the policy took."""

    def call(self, purpose: str, work: Callable[P, T], *args: P.args, **named: P.kwargs) -> T:
        started = time.perf_counter()
        try:
            return work(*args, **named)
        finally:
            self.add(purpose, started)

    def ask(self, policy: object, work: Callable[P, T], *args: P.args, **named: P.kwargs) -> T:
        """A call of `policy`: "waiting", and "queueing" for the wait for another trial after it, if
        its `call_seconds` tell what is its own [s]."""
        started = time.perf_counter()
        try:
            return work(*args, **named)
        finally:
            elapsed = time.perf_counter() - started
            own = min(elapsed, getattr(policy, "call_seconds", elapsed))
            self.last_call = own
            for purpose, seconds in (("waiting", own), ("queueing", elapsed - own)):
                self.seconds[purpose] = self.seconds.get(purpose, 0.0) + seconds

    def add(self, purpose: str, started: float) -> None:
        """Count the time since `started` on the clock."""
        self.seconds[purpose] = self.seconds.get(purpose, 0.0) + time.perf_counter() - started

    def sum(self, *purposes: str) -> float:
        return sum(self.seconds.get(purpose, 0.0) for purpose in purposes)


def answer_times(
    latencies: list[float], server_timings: list[Mapping[str, float]]
) -> dict[str, float]:
    """Percentiles as the client measured them, and means of what a server reported, to a
    microsecond [ms]."""
    if not latencies:
        return {}
    p50, p95, p99 = (float(v) for v in np.percentile(latencies, [50, 95, 99]))
    found = {"p50": p50, "p95": p95, "p99": p99, "max": max(latencies)}
    for name, entry in SERVER_TIMES.items():
        values = [timing.get(entry) for timing in server_timings]
        usable = [v for v in values if isinstance(v, (int, float)) and 0.0 <= v < 1e9]
        if usable:
            found[name] = sum(usable) / len(usable)
    return {name: round(value, 3) for name, value in found.items()}


@dataclass(frozen=True)
class Committed:
    """What real-time chunking reads: `actions` float32 (n, D) that the robot has left, and how many
    of them will be executed before the answer takes over."""

    actions: NDArray[np.float32]
    delay: int


@dataclass
class PolicyCaller:
    """A policy, and how long it took to answer."""

    policy: Policy
    latencies: list[float] = field(default_factory=list)
    asked: list[int] = field(default_factory=list)
    """For every answer, how many actions had been begun when it was asked for."""
    server_timings: list[Mapping[str, float]] = field(default_factory=list)
    """For every answer, the times that the policy's server reported [ms]."""

    def next_actions(
        self,
        run: TrialState,
        spec: PolicySpec,
        committed: Committed | None = None,
        executed: int | None = None,
    ) -> NDArray[np.float32]:
        """The policy's next actions, float32 (T, D), quantised as they are executed; `committed`
        and `executed` go with the observation."""
        return run.checked(self.next_answer(run, spec, committed, executed), spec)

    def next_answer(
        self,
        run: TrialState,
        spec: PolicySpec,
        committed: Committed | None = None,
        executed: int | None = None,
    ) -> object:
        """The same as the policy answers it."""
        observation = run.observation(spec)
        if committed is not None:
            observation["committed"], observation["delay"] = committed.actions, committed.delay
        if executed is not None:
            observation["executed"] = executed
        try:
            answer = run.stopwatch.ask(self.policy, self.policy.infer, observation)
        finally:
            self.server_timings.append(getattr(self.policy, "last_timing", {}))
        self.asked.append(observation["step"])
        self.latencies.append(1000.0 * run.stopwatch.last_call)
        return answer

    def usage(self) -> dict[str, object]:
        """What a record keeps of what the trial has used, as its policy says after each answer."""
        last = self.server_timings[-1] if self.server_timings else {}
        found = {name: last[name] for name in USAGE if name in last and 0 <= last[name] < 1e15}
        return {trial_record.USAGE: found} if found else {}
