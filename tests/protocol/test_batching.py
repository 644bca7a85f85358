"""When the batcher waits, by hand; and what becomes of calls that go wrong."""

import asyncio
import statistics
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import pytest

from robospa.protocol.batching import KEPT, SLACK, AdaptiveBatchWindow, Batcher, CallCost, QueueFull

T = TypeVar("T")


class VirtualLoop(asyncio.SelectorEventLoop):
    """Time passes only while everybody waits. Waiting without a timer is an error."""

    def __init__(self) -> None:
        super().__init__()
        self._now = 0.0
        selector: Any = self._selector  # type: ignore[attr-defined]
        select = selector.select

        def jump(timeout: float | None) -> Any:
            if timeout is None:
                raise RuntimeError("everybody waits and no timer is set")
            self._now += max(timeout, 0.0)
            return select(0)

        selector.select = jump

    def time(self) -> float:
        return self._now


def run(work: Coroutine[Any, Any, T]) -> T:
    """`work` to its end in virtual time."""
    loop = VirtualLoop()
    try:
        return loop.run_until_complete(work)
    finally:
        pending = asyncio.all_tasks(loop)
        for task in pending:
            task.cancel()
        if pending:
            loop.run_until_complete(asyncio.gather(*pending, return_exceptions=True))
        loop.close()


@pytest.fixture
def window() -> AdaptiveBatchWindow:
    """A model that takes 1 s and became free at t = 10 s; session 2 pauses 0.1 s, always."""
    found = AdaptiveBatchWindow()
    used(found, 2, 0.1)
    found.cost = CallCost()
    found.answered([9], 9.0, 10.0)
    return found


def used(window: AdaptiveBatchWindow, session: int, pause: float) -> None:
    """`session` was answered at t = 10 s and has paused `pause` [s] so far, each time; the calls
    that answered it count for nothing."""
    cost, window.cost = window.cost, CallCost()
    for time in (10.0 - number * pause for number in reversed(range(KEPT + 1))):
        window.arrived(session, time)
        window.answered([session], time, time)
    window.cost = cost


def wait(window: AdaptiveBatchWindow, now: float = 10.0, *waiting: int) -> float:
    return window.wait_for(now, waiting or (1,), 10.0, 4)


def test_a_session_that_is_due_soon_is_waited_for(window: AdaptiveBatchWindow) -> None:
    assert wait(window) == pytest.approx(0.1 + SLACK)


def test_a_request_whose_first_bytes_have_come_is_waited_for(window: AdaptiveBatchWindow) -> None:
    window.forget(2)
    window.request_began(5, 1.0)
    window.arrived(5, 1.02)
    window.request_began(6, 10.0)
    assert 0 < wait(window, 10.001) < 0.01


def long_simulation(window: AdaptiveBatchWindow) -> None:
    window.forget(2)
    used(window, 3, 5.0)


def costs_more_than_it_brings(window: AdaptiveBatchWindow) -> None:
    window.forget(2)
    used(window, 4, 0.4)
    assert 4 / (1 + 0.4) < 3 / 1


def byte_by_byte(window: AdaptiveBatchWindow) -> None:
    window.forget(2)
    window.request_began(5, 1.0)
    window.arrived(5, 1.02)
    window.request_began(6, 9.0)


def no_gain_from_batches(window: AdaptiveBatchWindow) -> None:
    window.cost = CallCost()
    for size in (1, 4, 2, 8):
        window.cost.add(size, 0.25 * size)
    assert window.cost(4) == pytest.approx(1.0)


def no_call_measured(window: AdaptiveBatchWindow) -> None:
    window.cost = CallCost()


@pytest.mark.parametrize(
    ("state", "now", "waiting"),
    [
        (lambda window: window.forget(2), 10.0, (1,)),  # it rests, and there is nobody else
        (lambda window: None, 10.2, (1,)),  # it is late
        (long_simulation, 10.0, (1,)),
        (costs_more_than_it_brings, 10.0, (1, 2, 3)),
        (byte_by_byte, 10.0, (1,)),
        (no_gain_from_batches, 10.0, (1,)),
        (no_call_measured, 10.0, (1,)),
    ],
)
def test_when_nobody_is_waited_for(
    window: AdaptiveBatchWindow, state: Any, now: float, waiting: tuple[int, ...]
) -> None:
    state(window)
    assert wait(window, now, *waiting) == 0


# ---------------------------------------------------------------- calls that go wrong


async def _ask(batcher: Batcher, count: int) -> list[Any]:
    asks = (batcher.infer(number, {"n": number}) for number in range(count))
    return await asyncio.gather(*asks, return_exceptions=True)


def batcher_of(answer: Any, queue: int = 64) -> Batcher:
    async def call(observations: Sequence[Any], sessions: Sequence[int]) -> Sequence[Any]:
        await asyncio.sleep(1)
        found: Sequence[Any] = answer([o["n"] for o in observations])
        return found

    return Batcher(call, 8, queue)


def test_too_few_answers_are_asked_for_again_one_by_one() -> None:
    batcher = batcher_of(lambda numbers: numbers[:1])
    assert [found[0] for found in run(_ask(batcher, 4))] == [0, 1, 2, 3]


def test_no_answer_at_all_is_an_error_of_every_request() -> None:
    found = run(_ask(batcher_of(lambda numbers: []), 3))
    assert all("gave 0 answers to 1 request" in str(error) for error in found)


def test_one_bad_sample_spares_the_others() -> None:
    def answer(numbers: list[int]) -> list[int]:
        if 2 in numbers:
            raise RuntimeError("bad sample")
        return numbers

    found = run(_ask(batcher_of(answer), 4))
    assert isinstance(found[2], RuntimeError)
    assert [f[0] for n, f in enumerate(found) if n != 2] == [0, 1, 3]


def test_a_client_that_goes_in_the_middle_of_a_batch_spares_the_others() -> None:
    async def main() -> list[Any]:
        batcher = batcher_of(lambda numbers: numbers)
        tasks = [asyncio.create_task(batcher.infer(n, {"n": n})) for n in range(3)]
        await asyncio.sleep(0.5)
        tasks[1].cancel()
        return await asyncio.gather(*tasks, return_exceptions=True)

    first, gone, last = run(main())
    assert (first[0], last[0]) == (0, 2)
    assert isinstance(gone, asyncio.CancelledError)


def test_a_client_that_goes_before_its_batch_is_not_computed() -> None:
    seen: list[int] = []

    async def main() -> None:
        batcher = batcher_of(lambda numbers: seen.extend(numbers) or numbers)
        first = asyncio.create_task(batcher.infer(0, {"n": 0}))
        await asyncio.sleep(0.5)
        second = asyncio.create_task(batcher.infer(1, {"n": 1}))
        await asyncio.sleep(0.1)
        second.cancel()
        await first
        await asyncio.sleep(3)

    run(main())
    assert seen == [0]


def test_a_full_queue_is_said_at_once() -> None:
    found = run(_ask(batcher_of(lambda numbers: numbers, queue=2), 4))
    assert [isinstance(error, QueueFull) for error in found] == [False, False, True, True]


def test_the_timing_tells_wait_call_and_batch() -> None:
    def clock() -> float:
        return asyncio.get_running_loop().time()

    found = run(_ask(Batcher(batcher_of(lambda numbers: numbers).call, 2, 64, clock), 4))
    times = [timing for _, timing in found]
    assert [t["batch"] for t in times] == [2, 2, 2, 2]
    assert times[0] == {"queue_ms": 0, "infer_ms": 1000, "batch": 2}
    assert times[3]["queue_ms"] == pytest.approx(1000)


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


QUICK = between(0.005, 0.015)
FULL = {
    "in step": (Pattern(between(0.01, 0.01)), 0.99),
    "jittered": (Pattern(QUICK), 0.98),
    "two": (Pattern(between(0.02, 0.03), clients=2), 0.95),
    "a slower one": (Pattern(lambda r, i, t: 0.04 if i == 0 else QUICK(r, i, t)), 0.9),
    "a straggler": (Pattern(lambda r, i, t: 0.12 if i == 0 else QUICK(r, i, t)), 0.85),
    "calls of many lengths": (Pattern(QUICK, vary=(0.6, 1.8)), 0.95),
    "half as many places": (Pattern(QUICK, size=4), 0.95),
    "more than places": (Pattern(QUICK, clients=12), 0.9),
    "a cost per item": (Pattern(between(0.02, 0.06), fixed=0.1, each=0.002), 0.9),
}
"""Pattern and the least fill that is wanted of it."""
ALL = {
    **{name: pattern for name, (pattern, _) in FULL.items()},
    "any pause": Pattern(lambda r, i, t: r.exponential(0.05)),
    "a simulation between": Pattern(between(1, 3), seconds=30),
    "now and then a long pause": Pattern(
        lambda r, i, t: 0.5 if r.random() < 0.1 else QUICK(r, i, t)
    ),
    "bursts": Pattern(lambda r, i, t: (np.ceil((t + 1e-6) / 0.2) * 0.2 - t) + r.uniform(0, 0.01)),
    "coming and going": Pattern(QUICK, rest=20),
    "nothing gained by batches": Pattern(QUICK, fixed=0.0, each=0.01),
    "a quick model": Pattern(between(0.01, 0.03), fixed=0.005, seconds=3),
    "as long as the call": Pattern(between(0.08, 0.12), fixed=0.1, each=0.002),
}


@pytest.mark.parametrize("name", FULL)
def test_batches_are_full(name: str) -> None:
    pattern, wanted = FULL[name]
    assert play(pattern).fill >= wanted


@pytest.mark.parametrize("name", ALL)
def test_waiting_never_costs_what_it_should_gain(name: str) -> None:
    pattern = ALL[name]
    ours, never = play(pattern), play(pattern, Never)
    assert ours.rate >= 0.98 * never.rate
    assert ours.latency <= 1.04 * never.latency


def test_eight_quick_clients_get_the_models_limit() -> None:
    seen = play(Pattern(QUICK, fixed=0.1, each=0.002))
    # the limit of such clients in step: the slowest of eight pauses, then the call
    assert seen.rate >= 0.95 * 8 / (0.116 + 0.015)


def test_a_lone_client_never_waits() -> None:
    assert play(Pattern(QUICK, clients=1)).longest_wait == 0


def test_nobody_waits_longer_than_two_calls() -> None:
    seen = play(Pattern(lambda r, i, t: r.exponential(0.03)))
    assert seen.longest_wait <= 0.101


def test_the_same_arrivals_give_the_same_batches() -> None:
    pattern = Pattern(lambda r, i, t: r.exponential(0.02), seconds=4)
    assert play(pattern) == play(pattern)
