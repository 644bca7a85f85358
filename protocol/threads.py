"""Threads in which policies run, so that the event loop keeps answering meanwhile.

Like an executor, with two differences: the way there and back is shorter (it counts once per
request), and the threads are daemons, so a model that hangs cannot keep a server from ending.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any, TypeVar

T = TypeVar("T")
_Job = tuple[
    asyncio.AbstractEventLoop | None,
    "asyncio.Future[Any] | None",
    Callable[..., Any],
    tuple[Any, ...],
]
log = logging.getLogger("robospa.server")


class PolicyThreads:
    """`count` threads that take calls from one queue."""

    def __init__(self, count: int) -> None:
        self._jobs: SimpleQueue[_Job | None] = SimpleQueue()
        self._count = count
        for number in range(count):
            name = f"robospa-policy-{number}"
            threading.Thread(target=self._work, name=name, daemon=True).start()

    async def run(self, call: Callable[..., T], *args: Any) -> T:
        """`call(*args)` in one of the threads; raises what it raises."""
        loop = asyncio.get_running_loop()
        future: asyncio.Future[T] = loop.create_future()
        self._jobs.put((loop, future, call, args))
        return await future

    def post(self, call: Callable[..., object], *args: Any) -> None:
        """`call(*args)` in one of the threads, without waiting; a failure is logged."""
        self._jobs.put((None, None, call, args))

    def close(self) -> None:
        """End the threads after the calls that are queued already."""
        for _ in range(self._count):
            self._jobs.put(None)

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            loop, future, call, args = job
            try:
                result, error = call(*args), None
            except Exception as failure:
                result, error = None, failure
            except BaseException as failure:  # SystemExit must end neither thread nor server
                text = f"the policy raised {type(failure).__name__}: {failure}"
                result, error = None, RuntimeError(text)
            del job, call, args  # an idle thread must not keep the last observation alive
            if loop is not None and future is not None:
                with contextlib.suppress(RuntimeError):  # the loop is gone: nobody waits
                    loop.call_soon_threadsafe(_deliver, future, result, error)
            elif error is not None:
                log.error("a policy failed while it was closed", exc_info=error)
            del loop, future, result, error


def _deliver(future: asyncio.Future[Any], result: Any, error: Exception | None) -> None:
    if future.done():
        return
    if error is None:
        future.set_result(result)
    elif isinstance(error, StopIteration):  # cannot be raised into a future
        future.set_exception(RuntimeError(f"the policy raised StopIteration: {error}"))
    else:
        future.set_exception(error)
