"""When is the next request due, what does a call cost, and is it worth waiting?

Kept for every session are its last pauses between an answer and the next request; for the model
how long calls of how many observations took. With k requests here and m(w) more expected within w
seconds, waiting answers (k + m) / (w + cost(k + m)) requests per second. Calling now answers
k / cost(k), or, if it serves those who come meanwhile right afterwards, (k + j) / (cost(k) +
cost(j)). The highest rate wins. m(w) follows from the pauses themselves, given how long each
session has been silent already: no shape of their distribution is assumed, and whoever is later
than ever before is waited for only a little. A request whose first bytes are here is as good as
come.

The rule was chosen by simulation of some twenty patterns of arrival against waiting for mean
pauses, never waiting, and the best fixed window of each; `tests/protocol/test_batching_patterns.py`
holds it to that.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

KEPT = 32
"""Pauses remembered of every session."""
ENOUGH = 4
"""With fewer of its own, a session is expected to pause as the others do."""
FADING = 0.9
"""Weight of a call's cost beside the one after it."""
GRACE = 0.95
"""A session counts as silent for so much of the time since its answer: who is a little later than
ever before is still waited for."""
SLACK = 1e-4
"""[s] added to a predicted arrival."""
PATIENCE = 4.0
"""A request that takes so many times as long as usual to arrive is not waited for."""


@dataclass
class _Pace:
    """One session: when it was answered, its pauses since [s], and when a request began."""

    answered: float | None = None
    began: float | None = None
    pauses: deque[float] = field(default_factory=lambda: deque(maxlen=KEPT))


@dataclass
class CallCost:
    """What a call of n observations takes [s]: a straight line through recent calls."""

    weight: float = 0.0
    n: float = 0.0
    d: float = 0.0
    nn: float = 0.0
    nd: float = 0.0

    def add(self, size: int, seconds: float) -> None:
        for name, value in (("weight", 1.0), ("n", size), ("d", seconds)):
            setattr(self, name, FADING * getattr(self, name) + value)
        self.nn = FADING * self.nn + size * size
        self.nd = FADING * self.nd + size * seconds

    def __call__(self, size: float) -> float:
        """Seconds for `size` observations; the mean while all calls were of one size."""
        mean, seconds = self.n / self.weight, self.d / self.weight
        variance = self.nn / self.weight - mean * mean
        if variance < 0.05:
            return seconds
        slope = (self.nd / self.weight - mean * seconds) / variance
        return seconds + min(max(slope, 0.0), seconds / mean) * (size - mean)


class AdaptiveBatchWindow:
    """The pace of all sessions of one model. Times are of one clock [s]."""

    def __init__(self) -> None:
        self.cost = CallCost()
        self._sessions: dict[int, _Pace] = {}
        self._all: deque[float] = deque(maxlen=2 * KEPT)
        self._transfer = 0.0
        self._free = 0.0

    def coming(self, session: int, now: float) -> None:
        """The first bytes of a request are here."""
        self._sessions.setdefault(session, _Pace()).began = now

    def arrived(self, session: int, now: float) -> None:
        """A whole request is here."""
        pace = self._sessions.setdefault(session, _Pace())
        if pace.began is not None:
            self._transfer += 0.2 * (now - pace.began - self._transfer)
            pace.began = None
        if pace.answered is not None:
            pace.pauses.append(now - pace.answered)
            self._all.append(now - pace.answered)
            pace.answered = None

    def answered(self, sessions: Sequence[int], start: float, end: float) -> None:
        """A call for `sessions` is over."""
        self.cost.add(len(sessions), end - start)
        self._free = end
        for session in sessions:
            if session in self._sessions:
                self._sessions[session].answered = end

    def forget(self, session: int) -> None:
        """The session rests."""
        self._sessions.pop(session, None)

    def wait_for(self, now: float, waiting: Collection[int], oldest: float, size: int) -> float:
        """Seconds that it is worth waiting, 0 for not at all; `oldest`: arrival of the first."""
        k = len(waiting)
        if self.cost.weight == 0:
            return 0.0
        alone = self.cost(k)
        limit = max(oldest, self._free) + alone - now
        due, chance = self._expected(now, waiting, limit)
        if not len(due):
            return 0.0
        # Their sum is the expected number of arrivals by then.
        more = np.cumsum(chance)
        batch = np.minimum(k + more, size)
        rates = batch / (due + self._costs(batch))
        meanwhile = float(min(more[-1], size))
        served = [k / alone, (k + meanwhile) / (alone + self.cost(meanwhile))]
        best = int(np.argmax(rates))
        return float(due[best]) + SLACK if rates[best] > max(served) else 0.0

    def _expected(
        self, now: float, waiting: Collection[int], limit: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """When requests may come [s from now], soonest first, and with what chance each."""
        found: list[tuple[float, float]] = []
        for session, pace in self._sessions.items():
            if session in waiting:
                continue
            if pace.began is not None:
                spent = now - pace.began
                if spent <= PATIENCE * self._transfer:
                    found.append((max(self._transfer - spent, self._transfer / 4), 1.0))
            elif pace.answered is not None:
                silent = GRACE * (now - pace.answered)
                known = pace.pauses if len(pace.pauses) >= ENOUGH else self._all
                later = [pause - silent for pause in known if pause > silent]
                # one more than were seen: it may be later than ever
                found += [(wait, 1 / (len(later) + 1)) for wait in later]
        table = np.array(sorted(f for f in found if f[0] <= limit)).reshape(-1, 2)
        return table[:, 0], table[:, 1]

    def _costs(self, sizes: NDArray[np.float64]) -> NDArray[np.float64]:
        low, high = self.cost(1.0), self.cost(2.0)
        return low + (high - low) * (sizes - 1.0)
