"""Runs policies off the event loop and keeps the trials of different connections apart.

Three ways to hand over a policy, by what it knows about sessions:

    policy_factory   a function that makes one policy object per connection: right for every
                     policy that remembers anything between calls. Weights belong in the closure.
    BatchPolicy      one object for all connections, asked through `infer_batch(observations,
                     sessions)`. It keeps per-trial state by session number, or none at all; if it
                     has `reset_session(session, trial)` and `end_session(session)`, these are
                     called instead of `reset(trial)`.
    any other policy one object, hence one connection at a time; a second one is refused, because
                     two trials would share its state unseen.

A policy may have `end(outcome)` and `close()`. It is called from `threads` threads, one by default:
then it need not be thread-safe.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeVar

from robospa.protocol.batching import Batcher
from robospa.protocol.policy import Observation, Policy, PolicySpec, TrialInfo
from robospa.protocol.threads import PolicyThreads

T = TypeVar("T")
PolicyFactory = Callable[[], Policy]
Answer = tuple[Any, dict[str, float]]


class PolicySession(Protocol):
    """The policy as one connection sees it. Every call raises what the policy raises."""

    async def reset(self, trial: TrialInfo) -> None: ...

    async def infer(self, observation: Observation) -> Answer: ...

    async def end(self, outcome: Mapping[str, Any]) -> None: ...

    def coming(self) -> None:
        """The first bytes of a request are here."""

    def close(self) -> None: ...


class PolicyHost:
    """Owns the policy or its factory, and the threads that it runs in."""

    def __init__(
        self,
        policy: Policy | None = None,
        policy_factory: PolicyFactory | None = None,
        *,
        threads: int = 1,
        queue: int = 256,
    ) -> None:
        if (policy is None) == (policy_factory is None):
            raise ValueError("give either a policy or a policy_factory")
        self._factory = policy_factory
        self._spare: Policy | None = policy_factory() if policy_factory is not None else policy
        assert self._spare is not None
        self.spec: PolicySpec = self._spare.spec
        self._shared = self._spare if policy is not None else None
        self._batched = policy is not None and hasattr(policy, "infer_batch")
        self.max_sessions = None if self._factory is not None or self._batched else 1
        self._threads = PolicyThreads(threads)
        self._alone = threading.Lock()
        self._numbers = itertools.count(1)
        self._batcher = Batcher(self._infer_batch, self.spec.batch, queue)

    async def run(self, call: Callable[..., T], *args: Any) -> T:
        """`call(*args)` in a policy thread."""
        return await self._threads.run(call, *args)

    async def open(self) -> PolicySession:
        """A session for a new connection."""
        number = next(self._numbers)
        if self._factory is None:
            assert self._shared is not None
            if self._batched:
                return _SharedSession(self, self._shared, self._batcher, number)
            return _OwnSession(self, self._shared, self._alone, keep=True)
        policy, self._spare = self._spare, None
        if policy is None:
            policy = await self.run(self._factory)
        return _OwnSession(self, policy, threading.Lock(), keep=False)

    def post(self, call: Callable[..., object], *args: Any) -> None:
        """The same without waiting: a hanging model must not hold up a closing connection."""
        self._threads.post(call, *args)

    async def _infer_batch(
        self, observations: Sequence[Observation], sessions: Sequence[int]
    ) -> Sequence[Any]:
        policy: Any = self._shared
        answers: Sequence[Any] = await self.run(policy.infer_batch, observations, sessions)
        return answers

    def close(self) -> None:
        """Let go of the threads."""
        self._threads.close()


class _OwnSession:
    """A policy object of its own. `alone`: held while it is called, because a client may leave,
    and the next one or `close` come, while a call is under way in another thread."""

    def __init__(self, host: PolicyHost, policy: Policy, alone: threading.Lock, keep: bool) -> None:
        self._host, self._policy, self._alone, self._keep = host, policy, alone, keep

    def coming(self) -> None:
        return None

    async def reset(self, trial: TrialInfo) -> None:
        await self._host.run(self._call, self._policy.reset, trial)

    async def infer(self, observation: Observation) -> Answer:
        return await self._host.run(self._call, self._timed, time.perf_counter(), observation)

    def _call(self, method: Callable[..., T], *args: Any) -> T:
        with self._alone:
            return method(*args)

    def _timed(self, asked: float, observation: Observation) -> Answer:
        start = time.perf_counter()
        answer = self._policy.infer(observation)
        end = time.perf_counter()
        times = {"queue_ms": (start - asked) * 1e3, "infer_ms": (end - start) * 1e3, "batch": 1.0}
        return answer, times

    async def end(self, outcome: Mapping[str, Any]) -> None:
        method = getattr(self._policy, "end", None)
        if method is not None:
            await self._host.run(self._call, method, outcome)

    def close(self) -> None:
        if not self._keep and hasattr(self._policy, "close"):
            self._host.post(self._call, self._policy.close)


class _SharedSession:
    """One session of a policy that serves many at once."""

    def __init__(self, host: PolicyHost, policy: Any, batcher: Batcher, number: int) -> None:
        self._host, self._policy, self._batcher, self._number = host, policy, batcher, number

    def coming(self) -> None:
        self._batcher.coming(self._number)

    async def reset(self, trial: TrialInfo) -> None:
        self._batcher.forget(self._number)
        if hasattr(self._policy, "reset_session"):
            await self._host.run(self._policy.reset_session, self._number, trial)
        else:
            await self._host.run(self._policy.reset, trial)

    async def infer(self, observation: Observation) -> Answer:
        return await self._batcher.infer(self._number, observation)

    async def end(self, outcome: Mapping[str, Any]) -> None:
        self._batcher.forget(self._number)

    def close(self) -> None:
        self._batcher.forget(self._number)
        if hasattr(self._policy, "end_session"):
            self._host.post(self._policy.end_session, self._number)
