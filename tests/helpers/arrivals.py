"""Clients of a batched model in virtual time: who asks when, and what comes of it."""

from __future__ import annotations

import asyncio
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from virtual_time import run

from robospa.protocol.batching import Batcher

Pause = Callable[[np.random.Generator, int, float], float]
WARM = 2.0
"""[s] before anything is counted."""


class Never(Batcher):
    """Calls the model as soon as it is free."""

    def wait_for(self, now: float) -> float:
        return 0.0


@dataclass(frozen=True)
class Pattern:
    """`pause`(rng, client, now) [s] between an answer and the next request; a call of n takes
    `fixed` + `each` n [s], times a factor drawn from `vary`. After `rest` requests a client leaves
    for a while."""

    pause: Pause
    clients: int = 8
    size: int = 8
    fixed: float = 0.05
    each: float = 0.0
    vary: tuple[float, float] = (1.0, 1.0)
    rest: int = 0
    seconds: float = 6.0


@dataclass(frozen=True)
class Seen:
    """Answers per second, share of full batches, and latencies [s]."""

    rate: float
    fill: float
    latency: float
    longest_wait: float


def between(low: float, high: float) -> Pause:
    """Pauses of any length from `low` to `high` [s]."""
    return lambda rng, client, now: rng.uniform(low, high)


def play(pattern: Pattern, kind: type[Batcher] = Batcher) -> Seen:
    """What the clients of `pattern` see of a batcher of this `kind`."""
    return run(_play(pattern, kind))


async def _play(pattern: Pattern, kind: type[Batcher]) -> Seen:
    loop, rng = asyncio.get_running_loop(), np.random.default_rng(99)
    sizes: list[int] = []
    latencies: list[float] = []
    waits: list[float] = []

    async def call(observations: Sequence[Any], sessions: Sequence[int]) -> Sequence[Any]:
        if loop.time() > WARM:
            sizes.append(len(observations))
        cost = pattern.fixed + pattern.each * len(observations)
        await asyncio.sleep(cost * rng.uniform(*pattern.vary))
        return observations

    batcher = kind(call, pattern.size, 256, clock=loop.time)

    async def client(number: int) -> None:
        own, asked = np.random.default_rng((0, number)), 0
        while (began := loop.time()) < pattern.seconds:
            _, timing = await batcher.infer(number, {})
            asked += 1
            if began > WARM:
                latencies.append(loop.time() - began)
                waits.append(timing["queue_ms"] / 1e3)
            if pattern.rest and asked % pattern.rest == 0:
                batcher.forget(number)
                await asyncio.sleep(own.uniform(0.5, 1.5))
            await asyncio.sleep(pattern.pause(own, number, loop.time()))

    await asyncio.gather(*(client(number) for number in range(pattern.clients)))
    return Seen(
        len(latencies) / (pattern.seconds - WARM),
        statistics.fmean(sizes) / min(pattern.size, pattern.clients),
        statistics.fmean(latencies),
        max(waits),
    )
