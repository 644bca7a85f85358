"""Workers as processes of this machine, each behind a pipe."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from typing import Any

from robospa.harness.running.executor import Hand, Message
from robospa.harness.running.worker import WorkerConfig
from robospa.harness.running.worker import main as worker_main


class LocalHand:
    """One worker process."""

    def __init__(self, process: Any, pipe: Connection, name: str) -> None:
        self.process = process
        self.pipe = pipe
        self.name = name

    def send(self, message: Message) -> None:
        """Tell it something; nothing happens if it is gone."""
        try:
            self.pipe.send(message)
        except OSError:
            return  # it has just died: `gone` tells so

    def messages(self) -> list[Message]:
        """What it has said since the last call; also after it has gone."""
        heard: list[Message] = []
        try:
            while self.pipe.poll():
                heard.append(self.pipe.recv())
        except (EOFError, OSError):
            pass  # closed: it is dying
        return heard

    def gone(self) -> str | None:
        """How it ended; None while it lives."""
        if self.process.is_alive():
            return None
        code = self.process.exitcode
        return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"

    def waiting(self) -> bool:
        """Never: a process has its place at once."""
        return False

    def kill(self) -> None:
        """End it now."""
        self.process.kill()
        self.process.join()

    def join(self, seconds: float) -> None:
        """Wait until it has gone, `seconds` at most."""
        self.process.join(max(0.0, seconds))

    def close(self) -> None:
        """Free what is left of it."""
        self.process.join()
        self.pipe.close()


class LocalExecutor:
    """At most `workers` processes on this machine."""

    def __init__(self, config: WorkerConfig, workers: int) -> None:
        self.config = config
        self.workers = workers

    def room(self) -> int:
        """As many as were asked for."""
        return self.workers

    def hire(self, name: str) -> LocalHand:
        """Start one more process."""
        spawn = multiprocessing.get_context("spawn")
        ours, theirs = spawn.Pipe()
        process = spawn.Process(
            target=worker_main, args=(theirs, self.config, name), name=name, daemon=True
        )
        with deaf():
            process.start()
        theirs.close()
        return LocalHand(process, ours, name)

    def wait(self, hands: Sequence[Hand], seconds: float) -> None:
        """Return as soon as one of `hands` has spoken or gone, after `seconds` at most."""
        ours = [hand for hand in hands if isinstance(hand, LocalHand)]
        wait([source for h in ours for source in (h.pipe, h.process.sentinel)], timeout=seconds)

    def news(self) -> list[str]:
        """Nothing ever happens to one machine."""
        return []

    def close(self) -> None:
        """Nothing is left once the hands have gone."""


@contextmanager
def deaf() -> Iterator[None]:
    """Start processes that Ctrl-C does not reach, not even while they are starting."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
