"""Requests that arrive together become one call of the model, without anything to tune.

While a call runs, requests gather. When it is over, the batcher may still wait for those that are
about to arrive, if that raises the number of answers per second, at most for as long as one call
takes (`robospa.protocol.batch_window`). So a lone client never waits, eight clients in step share
one call, and a client in the middle of a long simulation delays nobody. With a fixed number of
clients more answers per second are also shorter waits on average: there is one goal, not two.

If a call of several observations fails, each is tried alone: one bad sample must not fail the
others.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field

from robospa.observation import Observation
from robospa.protocol.batch_window import AdaptiveBatchWindow

BatchCall = Callable[[Sequence[Observation], Sequence[int]], Awaitable[Sequence[object]]]
Answer = tuple[object, dict[str, float]]
"""What a policy answered, which is not checked yet, and its times [ms]."""


class QueueFull(Exception):
    """More requests wait than the server allows."""


@dataclass
class _Request:
    session: int
    observation: Observation
    arrival: float
    future: asyncio.Future[Answer]


@dataclass
class Batcher:
    """Gathers requests for `call`, which takes at most `size` observations at once."""

    call: BatchCall
    size: int
    queue: int
    clock: Callable[[], float] = time.perf_counter
    _pending: list[_Request] = field(default_factory=list)
    _window: AdaptiveBatchWindow = field(default_factory=AdaptiveBatchWindow)
    _arrived: asyncio.Event = field(default_factory=asyncio.Event)
    _task: asyncio.Task[None] | None = None

    @property
    def waiting(self) -> int:
        """Requests that no call has taken yet."""
        return len(self._pending)

    async def infer(self, session: int, observation: Observation) -> Answer:
        """The answer to one observation and its timing; raises what the model raised."""
        if len(self._pending) >= self.queue:
            raise QueueFull(f"{self.queue} requests are waiting already")
        now = self.clock()
        self._window.arrived(session, now)
        future: asyncio.Future[Answer] = asyncio.get_running_loop().create_future()
        request = _Request(session, observation, now, future)
        self._pending.append(request)
        self._arrived.set()
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._run())
        try:
            return await future
        finally:
            if request in self._pending:
                self._pending.remove(request)
                self._arrived.set()

    def request_began(self, session: int) -> None:
        """The first bytes of a request of `session` have come."""
        self._window.request_began(session, self.clock())

    def forget(self, session: int) -> None:
        """The session pauses (trial over, connection closed): it is not waited for any more."""
        self._window.forget(session)
        self._arrived.set()

    async def _run(self) -> None:
        while self._pending:
            await self._gather()
            batch, self._pending = self._pending[: self.size], self._pending[self.size :]
            if batch:
                await self._answer(batch)

    async def _gather(self) -> None:
        while self._pending and (pause := self.wait_for(self.clock())) > 0:
            # A request that arrives ends the pause. If the expected one is late, look again.
            self._arrived.clear()
            timer = asyncio.get_running_loop().call_later(pause, self._arrived.set)
            await self._arrived.wait()
            timer.cancel()

    def wait_for(self, now: float) -> float:
        """Seconds to wait for more requests before looking again; 0 to call the model now."""
        waiting = {request.session for request in self._pending}
        if not waiting or len(self._pending) >= self.size:
            return 0.0
        return self._window.wait_for(now, waiting, self._pending[0].arrival, self.size)

    async def _answer(self, batch: list[_Request]) -> None:
        start = self.clock()
        outcomes = await self._call(batch)
        end = self.clock()
        self._window.answered([request.session for request in batch], start, end)
        for request, outcome in zip(batch, outcomes, strict=True):
            if request.future.done():
                continue
            if isinstance(outcome, Exception):
                request.future.set_exception(outcome)
                continue
            timing = {
                "queue_ms": (start - request.arrival) * 1e3,
                "infer_ms": (end - start) * 1e3,
                "batch": float(len(batch)),
            }
            request.future.set_result((outcome, timing))

    async def _call(self, batch: list[_Request]) -> list[object]:
        try:
            answers = await self.call([r.observation for r in batch], [r.session for r in batch])
            if len(answers) != len(batch):
                raise ValueError(
                    f"infer_batch gave {len(answers)} answers to {len(batch)} requests"
                )
            return list(answers)
        except Exception as error:
            if len(batch) == 1:
                return [error]
        return [(await self._call([request]))[0] for request in batch]
