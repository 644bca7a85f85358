"""Where workers live, as the driver of a run sees it: a handle for each, and what starts them;
those that are processes of this machine.

What a worker is sent and what it answers is the same everywhere, see `harness.running.messages`.
"""

from __future__ import annotations

from collections.abc import Sequence
from multiprocessing.connection import Connection, wait
from typing import Protocol

from robospa.harness import pool
from robospa.harness.running.messages import Command, Message, Stop
from robospa.harness.running.worker import WorkerConfig, main


class RunAborted(Exception):
    """The run cannot go on; what is finished is kept, and the run can be resumed."""


class WorkerHandle(Protocol):
    """One worker, from the moment that it was asked for, or its place for one more trial."""

    name: str
    """The same for all places of a worker."""

    def another(self) -> WorkerHandle | None:
        """A place for one more trial in the same worker, which is ready; None if there is none."""

    def send(self, command: Command) -> None:
        """Send it a command; nothing happens if it has ended."""

    def messages(self) -> list[Message]:
        """What it has sent since the last call; also after it has ended."""

    def exit_status(self) -> str | None:
        """How it ended, in a few words; None while it runs."""

    def pending(self) -> bool:
        """Whether it waits for a node to run on, so that it need not be ready soon."""

    def kill(self) -> None:
        """End it now; `exit_status` is known when this returns."""

    def join(self, seconds: float) -> None:
        """Wait until it has ended, `seconds` at most."""

    def close(self) -> None:
        """Free what is left of it; it has ended."""


class Executor(Protocol):
    """Starts workers and waits for them."""

    def capacity(self) -> int:
        """How many workers there can be now; may change while a run goes on."""

    def start(self, name: str) -> WorkerHandle:
        """Start one more worker."""

    def wait(self, workers: Sequence[WorkerHandle], seconds: float) -> None:
        """Return as soon as one of `workers` has sent something or ended, after `seconds` at most.

        Raises RunAborted if there will never be workers again.
        """

    def notes(self) -> list[str]:
        """Lines for the user about the executor itself since the last call."""

    def close(self) -> None:
        """End everything that this executor started; all of its workers have ended."""


class LocalWorker:
    """One worker process and the pipe of one trial that it may hold; `spare` are those of more."""

    def __init__(
        self, process: pool.Child, pipe: Connection, name: str, spare: Sequence[Connection] = ()
    ) -> None:
        self.process, self.pipe, self.name = process, pipe, name
        self._spare = list(spare)

    def another(self) -> LocalWorker | None:
        """A place for one more trial; None if there is none."""
        return LocalWorker(self.process, self._spare.pop(), self.name) if self._spare else None

    def send(self, command: Command) -> None:
        """Send it a command; nothing happens if it has ended. To stop it stops unused places."""
        for pipe in [self.pipe, *(self._spare if isinstance(command, Stop) else ())]:
            try:
                pipe.send(command)
            except OSError:
                return  # it has just died, which `exit_status` reports

    def messages(self) -> list[Message]:
        """What it has sent since the last call; also after it has ended."""
        received: list[Message] = []
        try:
            while self.pipe.poll():
                received.append(self.pipe.recv())
        except (EOFError, OSError):
            self.process.join(0.1)  # closed: it is dying
        return received

    def exit_status(self) -> str | None:
        """How it ended; None while it runs."""
        return self.process.exit_status()

    def pending(self) -> bool:
        """Never: a process starts at once."""
        return False

    def kill(self) -> None:
        """End it now."""
        self.process.kill()

    def join(self, seconds: float) -> None:
        """Wait until it has ended, `seconds` at most."""
        self.process.join(seconds)

    def close(self) -> None:
        """Free what is left of it."""
        self.process.close()


class LocalExecutor:
    """At most `workers` processes on this machine, which hold up to `held` trials each."""

    def __init__(self, config: WorkerConfig, workers: int, held: int = 1) -> None:
        self._config = config
        self.workers = workers
        self._held = held

    def capacity(self) -> int:
        """As many as were asked for."""
        return self.workers

    def start(self, name: str) -> LocalWorker:
        """Start one more process."""
        process = pool.Child(main, (self._config, name), name, pipes=self._held)
        first, *spare = process.pipes
        return LocalWorker(process, first, name, spare)

    def wait(self, workers: Sequence[WorkerHandle], seconds: float) -> None:
        """Return as soon as one of `workers` has sent something or ended, or after `seconds`."""
        wait([worker.pipe for worker in workers if isinstance(worker, LocalWorker)], seconds)

    def notes(self) -> list[str]:
        """None: nothing ever happens to one machine."""
        return []

    def close(self) -> None:
        """Nothing is left once the workers have ended."""
