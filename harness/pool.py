"""Processes of this machine: the one way in which robospa starts any, and pools of them.

A process is `python -m robospa.harness.pool` with its ends of pipes. It gets the import path of
its parent, a function and an argument, and never imports the parent's main module: so a script
needs no `__main__` guard, and may come from standard input or a notebook. It ignores Ctrl-C and
ends with its parent, however that ends.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, Pipe
from queue import SimpleQueue
from typing import Any, Generic, Protocol, TypeVar

MOST_DEATHS = 3
"""So many workers in a row that die of a job are the job's doing."""
LOWEST_PRIORITY = 19
"""The `nice` value of least weight: a seventieth of that of a process with the usual one."""
PR_SET_PDEATHSIG = 1
SAFE_PATH = ("-P",) if sys.version_info >= (3, 11) else ()
"""Without it the current folder could hide installed modules."""

A = TypeVar("A")
J = TypeVar("J")
R = TypeVar("R")
J_contra = TypeVar("J_contra", contravariant=True)
R_co = TypeVar("R_co", covariant=True)


class WorkerDied(Exception):
    """A worker ended before it answered; the message says how."""


class WorkerStuck(WorkerDied):
    """A worker did not answer in time, and was ended."""


class Child:
    """A process that runs `target` with its ends of `pipes` and `argument`; picklable both, and
    importable without the main module. `nice` lowers its priority."""

    def __init__(
        self,
        target: Callable[[Sequence[Connection], A], None],
        argument: A,
        name: str,
        *,
        pipes: int = 1,
        nice: int = 0,
    ) -> None:
        payload = pickle.dumps((target, argument))
        ours, theirs = zip(*(Pipe() for _ in range(pipes)), strict=True)
        self.pipes: list[Connection] = list(ours)
        fds = [pipe.fileno() for pipe in theirs]
        given = [name, *map(str, (os.getpid(), nice, *fds))]
        with sigint_blocked():
            self._process = subprocess.Popen(
                [sys.executable, *SAFE_PATH, "-m", "robospa.harness.pool", *given],
                stdin=subprocess.DEVNULL,
                pass_fds=fds,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
        self.pid = self._process.pid
        for pipe in theirs:
            pipe.close()
        with suppress(OSError):  # it has just died, which `exit_status` reports
            self.pipes[0].send((sys.path, os.environ.get("PYTHONPATH"), payload))

    def exit_status(self) -> str | None:
        """How it ended, in a few words; None while it runs."""
        code = self._process.poll()
        if code is None:
            return None
        return f"signal {-code}" if code < 0 else f"exit code {code}"

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()

    def join(self, seconds: float) -> None:
        """Wait until it has ended, `seconds` at most."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(max(0.0, seconds))

    def close(self) -> None:
        """Free what is left of it once it has ended."""
        self._process.wait()
        for pipe in self.pipes:
            pipe.close()


@contextmanager
def sigint_blocked() -> Iterator[None]:
    """Processes started within it do not see Ctrl-C while they are starting."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def main() -> None:
    """All that a process of ours does."""
    _, parent, nice, *fds = sys.argv[1:]
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    for fd in map(int, fds):
        os.set_inheritable(fd, False)
    _die_with_parent(int(parent), int(fds[0]))
    os.nice(int(nice))
    pipes: list[Connection] = [Connection(int(fd)) for fd in fds]
    try:
        sys.path[:], python_path, payload = pipes[0].recv()
    except EOFError:
        os._exit(1)
    os.environ.pop("PYTHONPATH")
    if python_path is not None:
        os.environ["PYTHONPATH"] = python_path
    # Nothing heavy was imported so far; this reads most of the package.
    target, argument = pickle.loads(payload)
    target(pipes, argument)


def _die_with_parent(parent: int, pipe: int) -> None:
    """End this process as soon as its parent, which has the other end of `pipe`, is gone."""
    if sys.platform == "linux":
        # The thread below never runs if this process is stopped, or stuck holding the interpreter.
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)  # it was gone before that
    closed = select.poll()
    closed.register(pipe, select.POLLHUP)

    def watch() -> None:
        closed.poll()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class JobWorker(Protocol[J_contra, R_co]):
    """Whatever does one job at a time; its methods may be called from any thread."""

    def run(self, job: J_contra) -> R_co:
        """What comes of `job`; raises WorkerDied, and what the job raised."""

    def kill(self) -> None:
        """End it now; a `run` that waits for it raises WorkerDied."""


class JobProcess(Generic[J, R]):
    """A process that calls `make` with `argument` when its first job comes, and what that returned
    with every job. A job that takes more than `seconds` is given up with its process."""

    def __init__(
        self,
        make: Callable[[A], Callable[[J], R]],
        argument: A,
        *,
        seconds: float | None = None,
        name: str = "worker",
        nice: int = 0,
    ) -> None:
        self._child = Child(_serve, (make, argument), name, nice=nice)
        self._seconds = seconds
        self.pid = self._child.pid

    def run(self, job: J) -> R:
        (pipe,) = self._child.pipes
        try:
            pipe.send(job)
            if not pipe.poll(self._seconds):
                self._child.kill()
                raise WorkerStuck(f"it took longer than {self._seconds:g} s")
            error, answer = pipe.recv()
        except (EOFError, OSError):
            self._child.join(5.0)
            raise WorkerDied(self._child.exit_status() or "it closed its pipe") from None
        if error is not None:
            raise error
        result: R = answer
        return result

    def kill(self) -> None:
        self._child.kill()


def _serve(pipes: Sequence[Connection], argument: tuple[Callable[[Any], Any], Any]) -> None:
    """All that the process of a pool does."""
    (pipe,), (make, given) = pipes, argument
    run = None
    with suppress(EOFError, OSError):  # whoever gave the jobs is gone
        while True:
            job = pipe.recv()
            result, trouble = None, None
            try:
                run = run or make(given)
                result = run(job)
            except Exception as error:
                trouble = _sendable(error)
            pipe.send((trouble, result))


def _sendable(error: Exception) -> Exception:
    """`error`, or one of its text if it cannot be sent."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


class Pool(Generic[J, R]):
    """At most `workers` workers that `start` starts as jobs come, one job at a time each; a context
    manager, at whose end all are killed and what waits is cancelled.

    A worker that dies is replaced and its job begun again. A job at which `deaths` die ends with
    what `crashed` makes of it, or in WorkerDied. After `jobs_each` jobs a worker is replaced.
    """

    def __init__(
        self,
        start: Callable[[], JobWorker[J, R]],
        workers: int,
        *,
        deaths: int = MOST_DEATHS,
        crashed: Callable[[J], R] | None = None,
        jobs_each: int | None = None,
    ) -> None:
        self.workers = 0
        self._start, self._deaths, self._crashed = start, deaths, crashed
        self._jobs_each = jobs_each
        self._waiting: SimpleQueue[tuple[J, Future[R]] | None] = SimpleQueue()
        self._alive: set[JobWorker[J, R]] = set()
        self._lock = threading.Lock()
        self._closed = False
        self._threads: list[threading.Thread] = []
        self.grow(workers)

    def grow(self, workers: int) -> None:
        """Have `workers` workers from now on, if there are fewer."""
        for _ in range(self.workers, workers):
            # A process dies with the thread that started it, so this one lasts as long as the pool.
            self._threads.append(threading.Thread(target=self._run, daemon=True))
            self._threads[-1].start()
        self.workers = max(self.workers, workers)

    def __enter__(self) -> Pool[J, R]:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all workers; what was not done is cancelled."""
        with self._lock:
            self._closed = True
            alive = list(self._alive)
        for worker in alive:
            worker.kill()
        with suppress(Exception):
            while (item := self._waiting.get_nowait()) is not None:
                item[1].cancel()
        for _ in self._threads:
            self._waiting.put(None)
        for thread in self._threads:
            thread.join()

    def submit(self, job: J) -> Future[R]:
        future: Future[R] = Future()
        self._waiting.put((job, future))
        return future

    def _run(self) -> None:
        """One worker after the other, in a thread."""
        worker: JobWorker[J, R] | None = None
        done = 0
        while (item := self._waiting.get()) is not None:
            job, future = item
            if not future.set_running_or_notify_cancel():
                continue
            for death in range(1, self._deaths + 1):
                try:
                    if worker is None or done == self._jobs_each:
                        self._end(worker)
                        worker, done = self._begin(), 0
                    done += 1
                    future.set_result(worker.run(job))
                    break
                except WorkerDied as error:
                    self._end(worker)
                    worker = None
                    if not self._closed and death < self._deaths:
                        continue
                    if self._crashed is None or self._closed:
                        future.set_exception(error)
                    else:
                        future.set_result(self._crashed(job))
                    break
                except BaseException as error:
                    future.set_exception(error)
                    break
        self._end(worker)

    def _begin(self) -> JobWorker[J, R]:
        with self._lock:
            if self._closed:
                raise WorkerDied("the pool is closed")
            worker = self._start()
            self._alive.add(worker)
        return worker

    def _end(self, worker: JobWorker[J, R] | None) -> None:
        if worker is not None:
            worker.kill()
            with self._lock:
                self._alive.discard(worker)


if __name__ == "__main__":
    from robospa.harness import pool

    pool.main()  # of the module by its name, by which what is unpickled knows it
