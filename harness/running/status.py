"""How a run is doing, as values and in words: where the time goes, what each server does, what the
bottleneck is.

The driver makes a `Status` from what it knows; `harness.progress` shows it.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robospa.harness.factory import is_url
from robospa.harness.running.executor import Fault
from robospa.results.records.trial_record import PROCESSOR, TrialRecord
from robospa.text import counted

RECENT = 200
"""Trials whose shares of time are shown while a run goes on."""
PURPOSES = {
    "physics": ("physics", "goal"),
    "rendering": ("rendering",),
    "waiting": ("waiting",),
    "queueing": ("queueing",),
    "scenes": ("loading",),
}
"""What is shown, and the entries of a record's `timing` that belong to it; the rest is "other"."""


@dataclass
class TimeBreakdown:
    """Where the time of the last trials went, and of all."""

    recent: deque[Mapping[str, float]] = field(default_factory=lambda: deque(maxlen=RECENT))
    whole: dict[str, float] = field(default_factory=dict)

    def add(self, record: TrialRecord) -> None:
        spent = {
            name: sum(record.timing.get(part, 0.0) for part in parts)
            for name, parts in PURPOSES.items()
        }
        spent["other"] = max(0.0, record.wall_time - sum(spent.values()))
        self.recent.append(spent)
        for name, seconds in spent.items():
            self.whole[name] = self.whole.get(name, 0.0) + seconds

    def recent_shares(self) -> dict[str, float]:
        """Shares of the last trials; empty before the first."""
        return _shares(self.recent)

    def overall_shares(self) -> dict[str, float]:
        return _shares([self.whole])


def _shares(parts: Collection[Mapping[str, float]]) -> dict[str, float]:
    seconds = {n: sum(part.get(n, 0.0) for part in parts) for n in (*PURPOSES, "other")}
    total = sum(seconds.values())
    return {name: s / total for name, s in seconds.items()} if total > 0 else {}


LATE = 0.25
"""Part of its expected, or longer actual, time that a trial at its end is expected to take yet."""


def time_left(waiting: float, running: Sequence[tuple[float, float]], workers: int) -> float:
    """Seconds until the end of a run.

    `waiting`: what the trials that wait should take [s]. `running`: how long each of the others
    should take and has taken [s]. Near the end it is the longest of these that counts.
    """
    rest = [max(expected - taken, LATE * max(expected, taken)) for expected, taken in running]
    return max([(waiting + sum(rest)) / max(1, workers), *rest])


@dataclass(frozen=True)
class Status:
    """A run at one instant: of `workers` workers `starting` are not ready yet; `running` trials are
    under way, of the `places` that there are (0: one a worker). `left`: seconds, None if nothing is
    known yet. `films` are still to be made."""

    now: float
    workers: int
    running: int
    cores: int
    servers: Sequence[ServerStats] = ()
    shares: Mapping[str, float] = field(default_factory=dict)
    left: float | None = None
    starting: int = 0
    films: int = 0
    places: int = 0

    @property
    def bottleneck(self) -> str:
        """The bottleneck, in words; empty before the first trial."""
        if not self.shares:
            return ""
        waiting = self.shares.get("waiting", 0.0)
        if not any(is_url(s.target) for s in self.servers):
            waiting = 0.0  # a policy in the worker's own process takes its core as well
        places = self.places or self.workers - self.starting
        busy = places * (1.0 - waiting - self.shares.get("queueing", 0.0))
        used = [s for s in self.servers if s.running and s.means]
        if away := [s for s in self.servers if not s.up and not s.excluded]:
            others = "" if len(away) == len(self.servers) else "; the others get its workers"
            return f"{_some(len(away))} away{others}"
        slow = ""
        if used and all(s.saturated for s in used) and waiting >= NOTABLE:
            who = "the policy server is" if len(used) == 1 else "the policy servers are"
            slow = f"{who} the bottleneck: workers wait {100 * waiting:.0f} % of their time"
        if self.cores and busy >= FULL * self.cores and not (slow and waiting > MOSTLY):
            full = "the only core" if self.cores == 1 else f"all {self.cores} cores"
            return f"the simulators are the bottleneck: they fill {full}"
        if slow:
            return slow
        share = f"{100 * waiting:.0f} %"
        if not all("queue" in s.means for s in used):
            return f"workers wait {share} of their time"
        return f"room for more workers: they wait {share} of their time, no queue is long"

    @property
    def first_words(self) -> str:
        """What happens before the first trial has ended."""
        if self.starting == self.workers:
            return "starting"
        answers = sum(server.answers for server in self.servers)
        return f"first trials under way, {answers} answers of the policy so far"

    @property
    def crowd(self) -> str:
        """`8 workers on 4 cores`."""
        return f"{counted(self.workers, 'worker')} on {counted(self.cores, 'core')}"

    @property
    def workers_text(self) -> str:
        """`8 workers on 4 cores`, and how many of them are starting or idle."""
        text = self.crowd
        if self.starting:
            return f"{text}, {self.starting} starting"
        idle = self.workers - self.running
        return f"{text}, {idle} idle" if idle > 0 else text


def _some(count: int) -> str:
    return "a policy server is" if count == 1 else f"{count} policy servers are"


def shares_text(shares: Mapping[str, float]) -> str:
    """`physics 45 %, rendering 20 %, waiting 30 %`: what takes at least one per cent."""
    return ", ".join(f"{name} {100 * s:.0f} %" for name, s in shares.items() if s >= 0.005)


def server_text(server: ServerStats, now: float) -> str:
    """Answer time, queue and batch of one server, or that it is away."""
    if server.excluded:
        return f"left out: {server.excluded}"
    if server.failures:
        pause = server.retry_at - now
        return f"away, next try in {pause:.0f} s" if pause > 0 else "away, being tried"
    if not server.means:
        if server.answer_ms is None:
            return "no answer yet"
        return f"answers in {_ms(server.answer_ms)}"
    parts = [f"answers in {_ms(server.means['p50'])}"]
    if "queue" in server.means:
        parts.append(f"queue {_ms(server.means['queue'])}")
    if "batch" in server.means and server.batch > 1:
        parts.append(f"batch {server.means['batch']:.1f} of {server.batch}")
    return ", ".join(parts)


def _ms(value: float) -> str:
    if value >= 1e4:
        return f"{value / 1000:.0f} s"
    return f"{value:.1f} ms" if value < 10 else f"{value:.0f} ms"


SMOOTHING = 0.3  # weight of the newest trial in the running means
HALF_LIFE = 30.0  # [s] in which the estimated wait at a server without workers halves
LONGEST_PAUSE = 30.0  # [s] between two attempts at a server that cannot be reached
MEASURES = ("p50", "queue", "infer", "batch")
"""What of a record's `latency` is averaged per server; the last three only if the server
reports them."""


@dataclass
class ServerStats:
    """One policy server (or a policy in process), by its `target`. `batch`: the most that one call
    of its model holds."""

    target: str
    tasks: frozenset[str]
    batch: int = 1
    running: int = 0
    task: str = ""
    """Base task of the trial that was last sent there."""
    trials: int = 0
    failures: int = 0
    failing_since: float = 0.0
    """When the first of the present failures was."""
    retry_at: float = 0.0
    excluded: str = ""
    """Why it is used no more."""
    wait_per_worker: float | None = None
    idle_since: float = 0.0
    """When a trial there last ended."""
    means: dict[str, float] = field(default_factory=dict)
    answers: int = 0
    """Answers so far, those of trials in progress included."""
    answer_ms: float | None = None
    """Running mean of what some of these took, for as long as no trial has ended."""
    fastest: float = float("inf")
    """Smallest median answer time of a trial [ms]."""

    def available(self, now: float) -> bool:
        """Whether a worker may go there: one at a time as long as it is not known to be back."""
        if self.excluded:
            return False
        return not self.failures or (now >= self.retry_at and self.running == 0)

    @property
    def up(self) -> bool:
        """Whether it answered when it was last asked."""
        return not self.failures and not self.excluded

    def start_trial(self, task: str, now: float) -> None:
        self.wait_per_worker = self.wait(now)
        self.task = task
        self.running += 1

    def add_answers(self, count: int, ms: float) -> None:
        """`count` more answers have come, the last after `ms`."""
        self.answers += count
        self.answer_ms = update_mean(self.answer_ms, ms)

    def finish_trial(self, record: TrialRecord, now: float) -> None:
        sharing, self.idle_since = max(1, self.running), now
        self.running -= 1
        self.trials += 1
        self.failures = 0
        if not record.latency:
            return
        self.means = {
            name: update_mean(self.means.get(name), record.latency[name])
            for name in MEASURES
            if name in record.latency
        }
        middle = record.latency["p50"]
        self.fastest = min(self.fastest, middle)
        self.wait_per_worker = update_mean(self.wait_per_worker, middle / sharing)

    def wait(self, now: float) -> float | None:
        """What one worker adds to the wait there [ms], decayed while no worker is there."""
        if self.wait_per_worker is None or self.running:
            return self.wait_per_worker
        return float(self.wait_per_worker * 0.5 ** ((now - self.idle_since) / HALF_LIFE))

    def fail(self, now: float, pause: float) -> None:
        """It cannot be reached or its connection broke; `pause` is the first pause [s]."""
        if self.failures and now < self.retry_at:
            return  # the other workers there fail with it
        if not self.failures:
            self.failing_since = now
        self.failures += 1
        self.retry_at = now + min(LONGEST_PAUSE, pause * 2.0 ** (self.failures - 1))

    @property
    def saturated(self) -> bool:
        """Whether more workers would only wait longer.

        A request that waits longer than a whole call of the model takes finds others before it; so
        does one that waits for half a call where calls are full. A server that reports no times is
        taken for full when it answers 1.5 times slower than its best.
        """
        if not self.means:
            return False
        if "queue" in self.means and "infer" in self.means:
            full = self.batch > 1 and self.means.get("batch", 0.0) > 0.9 * self.batch
            return self.means["queue"] > self.means["infer"] * (0.5 if full else 1.0)
        return self.means["p50"] > 1.5 * self.fastest


def update_mean(old: float | None, new: float) -> float:
    return new if old is None else old + SMOOTHING * (new - old)


def connection_fault(error: BaseException, in_trial: bool) -> Fault:
    """Which fault of a server `error` reports; empty if its connection is not to blame.

    `in_trial`: the server had been sent the trial, so it was reached.
    """
    from robospa.protocol.errors import ConnectFailed, HandshakeError, WireError

    if isinstance(error, HandshakeError):
        return "incompatible"
    if isinstance(error, ConnectFailed) and not in_trial:
        return "unreachable"
    return "disconnected" if isinstance(error, WireError) else ""


def retry_cause(error: BaseException, in_trial: bool) -> str:
    """The cause of `RETRY_CAUSES` that `error` of an attempt is. `in_trial`: as above."""
    from robospa.protocol.errors import (
        CallTimeout,
        HandshakeError,
        ProtocolViolation,
        TransportError,
        WireError,
    )

    if isinstance(error, WireError) and not in_trial:
        return "unreachable"
    if isinstance(error, CallTimeout):
        return "deadline"
    if isinstance(error, ProtocolViolation):
        return "unreadable_answer"
    lost = isinstance(error, (TransportError, HandshakeError))
    return "connection_lost" if lost else "harness_error"


PER_CORE = 8
"""Most workers for a core."""
MEMORY = 0.75e9
"""Bytes that a worker may need: simulator, renderer and one batch of images."""
FULL = 0.9
"""Share of the cores that counts as all of them."""
NOTABLE, MOSTLY = 0.1, 0.5
"""Share of its time that a worker has to wait before its server is what a run waits for, and before
it is so even where the cores are full."""


def cores(root: Path = Path("/")) -> int:
    """Processor cores that this process may use: those that it is bound to, within the limit of its
    container, whole ones, but at least one. What the kernel says is read below `root`."""
    files = ("cpu.cfs_quota_us", "cpu.cfs_period_us"), ("cpu.max",)
    limits = [quota // period for quota, period in _limits(root, "cpu", *files)]
    return max(1, min([len(os.sched_getaffinity(0)), *limits]))


def most_workers(root: Path = Path("/")) -> int:
    """What cores and free memory allow; at least one per core."""
    lines = _text(root / "proc/meminfo").splitlines()
    free = [int(x.split()[1]) * 1024 for x in lines if x.startswith("MemAvailable:")] or [0]
    limits = _limits(root, "memory", ("memory.limit_in_bytes",), ("memory.max",))
    least = min(free + [limit for (limit,) in limits])
    return max(cores(root), min(PER_CORE * cores(root), int(least / MEMORY)))


def _limits(root: Path, kind: str, *files: tuple[str, ...]) -> Iterator[list[int]]:
    """The numbers in `files`, named for versions 1 and 2, of this process's control group and of
    all above it, whose limits hold for it too; of those that have a limit."""
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, kinds, group = line.split(":", 2)
        if not kinds or kind in kinds.split(","):
            top, inner = root / "sys/fs/cgroup" / (kind if kinds else ""), Path(group.strip("/"))
            for place in (inner, *inner.parents):
                texts = (_text(top / place / name) for name in files[not kinds])
                words = " ".join(texts).split()
                if words and all(word.isdecimal() for word in words):
                    yield list(map(int, words))


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""


@dataclass
class Autoscaler:
    """How many workers there should be: `target` now, `maximum` ever, for `cores` cores. Each holds
    `concurrent_trials` at once."""

    target: int
    maximum: int
    cores: int = field(default_factory=cores)
    concurrent_trials: int = 1
    _seconds: float = 0.0
    _busy: float = 0.0
    _trials: int = 0

    def add(self, record: TrialRecord) -> None:
        self._seconds += record.wall_time
        self._busy += record.timing.get(PROCESSOR, 0.0)
        self._trials += 1

    def scale_up(self, saturated: bool) -> int:
        """How many more workers to start now. `saturated`: no server has room for more."""
        at_once = self.target * self.concurrent_trials
        if self.target >= self.maximum or self._trials < at_once or self._seconds <= 0:
            return 0
        busy = at_once * self._busy / self._seconds
        self._seconds = self._busy = 0.0
        self._trials = 0
        if saturated or busy >= FULL * self.cores:
            return 0
        fitting = round(self.target * self.cores / max(busy, 1e-9))
        before = self.target
        self.target = min(self.maximum, 2 * before, max(before + 1, fitting))
        return self.target - before
