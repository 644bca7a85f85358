"""What the driver knows of one policy server: its load, its speed, whether it is there.

`waited` is the wait of a worker for one answer [ms], divided by the workers that shared the server
at that time: with one more worker, each of n + 1 is expected to wait `waited` * (n + 1). Of a
server where nobody is any more this is believed less and less, so that it is asked again some day.
A server that lost its line is left alone for a growing pause; then one worker tries it before
others follow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from robospa.results.records.trial_record import TrialRecord

UNREACHED, BROKEN, UNFIT = "unreached", "broken", "unfit"
"""Faults of a server: nobody listens; the line ended in a trial; it is another one than before."""
SMOOTHING = 0.3  # weight of the newest trial in the running means
FORGOTTEN = 30.0  # [s] after which the wait at a server without workers counts half
LONGEST_PAUSE = 30.0  # [s] between two attempts at a server that is away
MEASURES = ("p50", "queue", "infer", "batch")
"""What of a record's `latency` is averaged per server; the last three only if the server tells."""


@dataclass
class Server:
    """One policy server (or a policy in process), by its `target`. `batch`: the most that one call
    of its model holds."""

    target: str
    tasks: frozenset[str]
    batch: int = 1
    running: int = 0
    task: str = ""
    """Base task of the trial that was last sent there."""
    trials: int = 0
    switches: int = 0
    """How often the base task changed from one trial to the next."""
    failures: int = 0
    since: float = 0.0
    """When the first of the present failures was."""
    back: float = 0.0
    """When it may be tried again."""
    retired: str = ""
    """Why it takes part no more."""
    waited: float | None = None
    left: float = 0.0
    """When the last worker left."""
    means: dict[str, float] = field(default_factory=dict)
    fastest: float = float("inf")
    """Smallest median answer time of a trial [ms]."""

    def open(self, now: float) -> bool:
        """Whether a worker may go there: one at a time as long as it is not known to be back."""
        if self.retired:
            return False
        return not self.failures or (now >= self.back and self.running == 0)

    @property
    def up(self) -> bool:
        """Whether it answered when it was last asked."""
        return not self.failures and not self.retired

    def begin(self, task: str, now: float) -> None:
        """A trial of `task` is sent there."""
        self.waited = self.wait(now)
        self.switches += self.task not in ("", task)
        self.task = task
        self.running += 1

    def finish(self, record: TrialRecord, now: float) -> None:
        """A trial there has its record."""
        sharing, self.running, self.left = max(1, self.running), self.running - 1, now
        self.trials += 1
        self.failures = 0
        if not record.latency:
            return
        self.means = blended(self.means, record.latency)
        middle = record.latency["p50"]
        self.fastest = min(self.fastest, middle)
        self.waited = mean(self.waited, middle / sharing)

    def wait(self, now: float) -> float | None:
        """What one worker adds to the wait there [ms], as far as that is still believed."""
        if self.waited is None or self.running:
            return self.waited
        return float(self.waited * 0.5 ** ((now - self.left) / FORGOTTEN))

    def fail(self, now: float, pause: float) -> None:
        """It cannot be reached or its line broke; `pause` is the first pause [s]."""
        if self.failures and now < self.back:
            return  # the others there fail with it
        if not self.failures:
            self.since = now
        self.failures += 1
        self.back = now + min(LONGEST_PAUSE, pause * 2.0 ** (self.failures - 1))

    @property
    def saturated(self) -> bool:
        """Whether more workers would only wait longer.

        A request that waits longer than a whole call of the model takes finds others before it; so
        does one that waits for half a call where calls are full. A server that tells no times is
        taken for full when it answers slower than it once did.
        """
        if not self.means:
            return False
        if "queue" in self.means and "infer" in self.means:
            full = self.batch > 1 and self.means.get("batch", 0.0) > 0.9 * self.batch
            return self.means["queue"] > self.means["infer"] * (0.5 if full else 1.0)
        return self.means["p50"] > 1.5 * self.fastest


def mean(old: float | None, new: float) -> float:
    """The running mean `old` after `new`."""
    return new if old is None else old + SMOOTHING * (new - old)


def blended(old: Mapping[str, float], latency: Mapping[str, float]) -> dict[str, float]:
    """Running means of MEASURES after one more record's `latency`."""
    return {name: mean(old.get(name), latency[name]) for name in MEASURES if name in latency}


def fault_of(error: BaseException) -> str:
    """Which fault of its server `error` tells of; empty if it is not the server's line."""
    from robospa.protocol.errors import ConnectFailed, HandshakeError, ServerError, TransportError

    if isinstance(error, HandshakeError):
        return UNFIT
    if isinstance(error, ConnectFailed):
        return UNREACHED
    if isinstance(error, ServerError) or not isinstance(error, TransportError):
        return ""
    return BROKEN
