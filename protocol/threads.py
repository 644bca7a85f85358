"""Threads in which policies run, so that the event loop keeps answering meanwhile.

An executor, but for one thing: its threads are daemons, so that a model that hangs cannot keep the
server's process from ending (the threads of `ThreadPoolExecutor` are waited for at exit).
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any, TypeVar

T = TypeVar("T")
log = logging.getLogger("robospa.server")


class PolicyThreads:
    """`count` threads that take calls from one queue."""

    def __init__(self, count: int) -> None:
        self._jobs: SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = SimpleQueue()
        self._count = count
        for number in range(count):
            name = f"robospa-policy-{number}"
            threading.Thread(target=self._work, name=name, daemon=True).start()

    async def run(self, call: Callable[..., T], *args: Any) -> T:
        """`call(*args)` in one of the threads; raises what it raises."""
        return await asyncio.wrap_future(self._submit(call, *args))

    def post(self, call: Callable[..., object], *args: Any) -> None:
        """`call(*args)` in one of the threads, without waiting; a failure is logged."""
        self._submit(call, *args).add_done_callback(_log_failure)

    def close(self) -> None:
        """End the threads after the calls that are queued already."""
        for _ in range(self._count):
            self._jobs.put(None)

    def _submit(self, call: Callable[..., T], *args: Any) -> Future[T]:
        future: Future[T] = Future()
        self._jobs.put((future, lambda: call(*args)))
        return future

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            future, call = job
            if future.set_running_or_notify_cancel():
                try:
                    future.set_result(call())
                except BaseException as error:
                    future.set_exception(_as_exception(error))
            del job, future, call  # an idle thread must not keep the last observation alive


def _as_exception(error: BaseException) -> Exception:
    """An error that a future can carry: SystemExit must end neither thread nor server."""
    if isinstance(error, Exception) and not isinstance(error, StopIteration):
        return error
    return RuntimeError(f"the policy raised {type(error).__name__}: {error}")


def _log_failure(done: Future[Any]) -> None:
    if (error := done.exception()) is not None:
        log.error("a policy failed while it was closed", exc_info=error)
