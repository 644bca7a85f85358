"""Policy hosting: runs policies off the event loop, with a session for every connection.

Three ways to hand over a policy, by what it knows about sessions:

    policy_factory   makes one policy object per connection: right for every policy that remembers
                     anything between calls. Weights belong in the closure.
    `infer_batch`    a policy with this member serves all connections, and keeps what belongs to a
                     trial by session number, if anything (`OptionalMembers`).
    any other policy one object, hence one connection at a time; a second one is refused, because
                     two trials would share its state unnoticed.

It is called from `threads` threads, one by default: then it need not be thread-safe.
"""

import asyncio
import contextlib
import itertools
import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from queue import SimpleQueue
from typing import TypeVar

from robospa.observation import Observation
from robospa.protocol.batching import Answer, Batcher
from robospa.protocol.errors import DecodeError
from robospa.protocol.policy import USAGE, Policy, PolicySpec, TrialInfo, has

T = TypeVar("T")
PolicyFactory = Callable[[], Policy]
log = logging.getLogger("robospa.server")


class PolicyThreads:
    """`count` threads that take calls from one queue, so that the event loop keeps answering.

    Like an executor, but its threads are daemons, so that a model that hangs cannot keep the
    process from ending, and a result goes straight to the event loop, which saves 20 us a request.
    """

    def __init__(self, count: int) -> None:
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._count = count
        for number in range(count):
            name = f"robospa-policy-{number}"
            threading.Thread(target=self._work, name=name, daemon=True).start()

    async def run(self, call: Callable[..., T], *args: object) -> T:
        """`call(*args)` in one of the threads; raises what it raises."""
        loop = asyncio.get_running_loop()
        future: asyncio.Future[T] = loop.create_future()

        def deliver(set_outcome: Callable[[], None]) -> None:
            if not future.done():
                set_outcome()

        def job() -> None:
            try:
                answer = call(*args)
                outcome = lambda: future.set_result(answer)  # noqa: E731
            except BaseException as error:
                # SystemExit must end neither thread nor server; no future takes StopIteration
                taken = isinstance(error, Exception) and not isinstance(error, StopIteration)
                text = f"the policy raised {type(error).__name__}: {error}"
                failure = error if taken else RuntimeError(text)
                outcome = lambda: future.set_exception(failure)  # noqa: E731
            with contextlib.suppress(RuntimeError):  # the loop is closed: nobody waits
                loop.call_soon_threadsafe(deliver, outcome)

        self._jobs.put(job)
        return await future

    def post(self, call: Callable[..., object], *args: object) -> None:
        """The same without waiting, for a model that may hang; a failure is logged."""

        def job() -> None:
            try:
                call(*args)
            except BaseException as error:
                log.error("a policy failed while it was closed", exc_info=error)

        self._jobs.put(job)

    def close(self) -> None:
        """End the threads after the calls that are queued already."""
        for _ in range(self._count):
            self._jobs.put(None)

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()
            del job  # an idle thread must not keep the last observation alive


class PolicySession:
    """The policy as one connection sees it: here an object that serves this one alone. Every call
    raises what the policy raises.

    `lock` is held while it is called, because a client may leave, and the next one or `close`
    follow, while a call runs in another thread.
    """

    def __init__(
        self, threads: PolicyThreads, policy: Policy, lock: threading.Lock, close: bool
    ) -> None:
        self._threads, self._policy, self._lock, self._close = threads, policy, lock, close

    def request_began(self) -> None:
        """The first bytes of a request have arrived."""

    async def reset(self, trial: TrialInfo) -> None:
        await self._threads.run(self._call, self._policy.reset, trial)

    async def infer(self, observation: Observation) -> Answer:
        return await self._threads.run(self._call, self._timed, time.perf_counter(), observation)

    def _call(self, method: Callable[..., T], *args: object) -> T:
        with self._lock:
            return method(*args)

    def _timed(self, asked: float, observation: Observation) -> Answer:
        start = time.perf_counter()
        answer = self._policy.infer(observation)
        end = time.perf_counter()
        times = {"queue_ms": (start - asked) * 1e3, "infer_ms": (end - start) * 1e3, "batch": 1.0}
        return answer, {**times, **self.usage}

    @property
    def usage(self) -> Mapping[str, float]:
        """What the policy says of what the trial has used so far."""
        said = self._policy.last_timing if has(self._policy, "last_timing") else {}
        return {name: said[name] for name in USAGE if name in said}

    async def end(self, outcome: Mapping[str, object]) -> None:
        if has(self._policy, "end"):
            await self._threads.run(self._call, self._policy.end, outcome)

    def close(self) -> None:
        if self._close and has(self._policy, "close"):
            self._threads.post(self._call, self._policy.close)


def spec_of(policy: Policy) -> PolicySpec:
    """What `policy` reads and answers; ValueError, saying what to write, if it does not say,
    says what cannot be, or lacks a method."""
    found, name = getattr(policy, "spec", None), type(policy).__name__
    if not isinstance(found, PolicySpec):
        raise ValueError(
            f"{name}.spec is no PolicySpec but {type(found).__name__}: a policy says what it reads "
            f'and answers, at least spec = robospa.PolicySpec("{name}")'
        )
    for method in () if has(policy, "infer_batch") else ("reset(trial)", "infer(observation)"):
        if not callable(getattr(policy, method.partition("(")[0], None)):
            raise ValueError(f"{name} has no method {method}, which every policy needs")
    try:
        PolicySpec.from_json(found.to_json())  # the rules are those of the wire
    except DecodeError as error:
        raise ValueError(f"{name}.{error}") from None
    return found


class PolicyHost:
    """Owns the policy or its factory, and the threads that it runs in.

    `max_sessions`: how many connections the policy can serve at once, None for any number.
    """

    def __init__(
        self,
        policy: Policy | None = None,
        policy_factory: PolicyFactory | None = None,
        *,
        threads: int = 1,
        queue: int = 256,
    ) -> None:
        first = policy if policy_factory is None else policy_factory()
        if first is None or (policy is not None and policy_factory is not None):
            raise ValueError("give either a policy or a policy_factory")
        self._policy, self._factory = policy, policy_factory
        self._spare = first if policy is None else None
        self.spec = spec_of(first)
        batched = has(policy, "infer_batch")
        self.max_sessions = 1 if policy is not None and not batched else None
        self._threads = PolicyThreads(threads)
        self._lock = threading.Lock()
        self._numbers = itertools.count(1)
        self._batcher = Batcher(self._infer_batch, self.spec.batch, queue) if batched else None

    async def open(self) -> PolicySession:
        """A session for a new connection."""
        if self._policy is not None and self._batcher is not None:
            return _BatchedSession(self._threads, self._policy, self._batcher, next(self._numbers))
        if self._policy is not None:
            return PolicySession(self._threads, self._policy, self._lock, close=False)
        policy, self._spare = self._spare, None
        if policy is None:
            assert self._factory is not None
            policy = await self._threads.run(self._factory)
        return PolicySession(self._threads, policy, threading.Lock(), close=True)

    async def _infer_batch(
        self, observations: Sequence[Observation], sessions: Sequence[int]
    ) -> Sequence[object]:
        assert has(self._policy, "infer_batch")
        return await self._threads.run(self._policy.infer_batch, observations, sessions)

    def close(self) -> None:
        self._threads.close()


class _BatchedSession(PolicySession):
    """One session of a policy that serves many at once."""

    def __init__(
        self, threads: PolicyThreads, policy: Policy, batcher: Batcher, number: int
    ) -> None:
        self._threads, self._policy, self._batcher, self._number = threads, policy, batcher, number

    def request_began(self) -> None:
        self._batcher.request_began(self._number)

    async def reset(self, trial: TrialInfo) -> None:
        self._batcher.forget(self._number)
        if has(self._policy, "reset_session"):
            await self._threads.run(self._policy.reset_session, self._number, trial)
        else:
            await self._threads.run(self._policy.reset, trial)

    async def infer(self, observation: Observation) -> Answer:
        return await self._batcher.infer(self._number, observation)

    async def end(self, outcome: Mapping[str, object]) -> None:
        self._batcher.forget(self._number)

    def close(self) -> None:
        self._batcher.forget(self._number)
        if has(self._policy, "end_session"):
            self._threads.post(self._policy.end_session, self._number)
