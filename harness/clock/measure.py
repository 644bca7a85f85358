"""How long a server takes to answer when one, four or eight clients ask it at once.

What a client sees: from the request to the answer's arrival, with transport and queue. Every client
is a connection of its own, with made-up observations of the form that the policy asks for.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from robospa.harness.clock.latency import Latency, of_samples
from robospa.protocol.client import RemotePolicy
from robospa.protocol.conformance import synthetic_observation, trial_for

CLIENTS = (1, 4, 8)
"""How many at once; one is a robot with a server for itself."""
QUERIES = 40
"""Of each client, where the time allows them."""
LEAST = 3
"""Queries of each client, however long they take."""
SHARES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
"""What of a distribution its `--clock` line has."""


@dataclass(frozen=True)
class Load:
    """The answers to `clients` at once: their times [ms], and how many came a second."""

    clients: int
    latencies: tuple[float, ...]
    per_second: float

    @property
    def latency(self) -> Latency:
        """The distribution, to a tenth of a millisecond."""
        whole = of_samples(self.latencies)
        return Latency(tuple((100.0 * s, round(whole.at(s), 1)) for s in SHARES))

    @property
    def clock(self) -> str:
        """The setting that stands for it."""
        return f"real:{self.latency}"


def measure(
    connect: Callable[[], RemotePolicy], seconds: float, clients: Sequence[int] = CLIENTS
) -> list[Load]:
    """The load of each number of `clients`, in `seconds` each, or less if the server is fast.

    The first answer of a client does not count: it may compile. Raises what the connections do.
    """
    return [_load(connect, count, seconds) for count in clients]


def _load(connect: Callable[[], RemotePolicy], count: int, seconds: float) -> Load:
    ready = threading.Barrier(count)
    times: list[float] = []
    spans: list[tuple[float, float]] = []
    errors: list[BaseException] = []

    def ask() -> None:
        try:
            with connect() as policy:
                policy.reset(trial_for(policy.spec))
                policy.infer(synthetic_observation(policy.spec))
                ready.wait()
                began = time.perf_counter()
                own = _times(policy, began + seconds)
                spans.append((began, time.perf_counter()))
                times.extend(own)
        except BaseException as error:  # raised again in the caller's thread
            errors.append(error)
            ready.abort()

    threads = [threading.Thread(target=ask) for _ in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    real = [error for error in errors if not isinstance(error, threading.BrokenBarrierError)]
    if errors:
        raise real[0] if real else errors[0]
    took = max(end for _, end in spans) - min(start for start, _ in spans)
    return Load(count, tuple(sorted(times)), len(times) / took)


def _times(policy: RemotePolicy, until: float) -> list[float]:
    """Latencies [ms] of one client's queries."""
    found: list[float] = []
    while len(found) < QUERIES and (len(found) < LEAST or time.perf_counter() < until):
        seen = synthetic_observation(policy.spec, step=len(found) + 1, seed=len(found) + 1)
        start = time.perf_counter()
        policy.infer(seen)
        found.append(1000.0 * (time.perf_counter() - start))
    return found
