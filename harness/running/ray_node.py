"""What runs on a node of a Ray cluster: an actor that looks after one worker process.

The worker is the same process as on one machine, with a folder of its own on the node. The actor
passes messages on, and hands over what the worker wrote (actions, video, output) together with the
record: nobody else sees the node's disk. The worker process dies with its actor, and is in no
danger from it: a crash of the simulator leaves the actor, which still has the crash's stack.
"""

from __future__ import annotations

import fcntl
import os
import pickle
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any

from robospa.harness.running.executor import Message
from robospa.harness.running.local_workers import LocalExecutor
from robospa.harness.running.manifest import code_hash
from robospa.harness.running.store import ACTIONS, VIDEOS
from robospa.harness.running.worker import LOGS, WorkerConfig

LOG_BYTES = 64_000
"""Most of a worker's output that travels at once."""


@dataclass(frozen=True)
class Heard:
    """What one worker has said: each message with the files that belong to it (folder/name: bytes),
    its output since, and how it ended (None while it lives)."""

    said: tuple[tuple[Message, Mapping[str, bytes]], ...]
    output: bytes
    gone: str | None


def versions() -> dict[str, str]:
    """What has to be the same on every node for records to be the same."""
    found = {"python": sys.version.split()[0]}
    for package in ("robospa", "numpy", "sapien"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "missing"
    return {**found, "code": code_hash()}


def misfit(wanted: Mapping[str, str]) -> str:
    """Why this node cannot take part in a run whose driver has `wanted`; empty if it can."""
    here = versions()
    differ = [
        f"{name} {here.get(name)} instead of {value}"
        for name, value in wanted.items()
        if here.get(name) != value
    ]
    return f"it has {', '.join(differ)}" if differ else ""


class NodeWorker:
    """The actor's inside: one worker process and its folder."""

    def __init__(self, config: WorkerConfig, name: str) -> None:
        self._folder, self._lock = _own_folder()
        self._log = self._folder / LOGS / f"{name}.log"
        self._read = 0
        self._executor = LocalExecutor(replace(config, folder=self._folder), 1)
        with _without_main():
            self._hand = self._executor.hire(name)

    def send(self, message: Message) -> None:
        """Tell the worker."""
        self._hand.send(message)

    def hear(self, seconds: float) -> Heard:
        """Wait until the worker says something of weight or ends, `seconds` at most."""
        until = time.monotonic() + seconds
        said: list[Message] = []
        gone: str | None = None
        while gone is None and all(m[0] == "beat" for m in said):
            left = until - time.monotonic()
            if left <= 0:
                break
            self._executor.wait([self._hand], left)
            gone = self._hand.gone()
            said += self._hand.messages()
        beats = [m for m in said if m[0] == "beat"][-1:]
        others = [m for m in said if m[0] != "beat"]
        heard = Heard(
            tuple((m, self._files() if m[0] == "done" else {}) for m in beats + others),
            self._output(),
            gone,
        )
        if gone is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
        return heard

    def _files(self) -> dict[str, bytes]:
        """What the trial left beside its record, which is then forgotten here."""
        found: dict[str, bytes] = {}
        for place in (ACTIONS, VIDEOS):
            for path in sorted((self._folder / place).glob("[!.]*")):
                found[f"{place}/{path.name}"] = path.read_bytes()
                path.unlink()
        return found

    def _output(self) -> bytes:
        try:
            with self._log.open("rb") as file:
                file.seek(self._read)
                text = file.read(LOG_BYTES)
        except OSError:
            return b""
        self._read += len(text)
        return text


def _own_folder() -> tuple[Path, int]:
    """(a new folder, the lock that says that it is in use). Those of killed actors are removed."""
    home = Path(tempfile.gettempdir()) / f"robospa-ray-{os.getuid()}"
    home.mkdir(mode=0o700, exist_ok=True)
    gate = os.open(home / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(gate, fcntl.LOCK_EX)
        for old in home.glob("worker-*"):
            if _unused(old):
                shutil.rmtree(old, ignore_errors=True)
        folder = Path(tempfile.mkdtemp(prefix="worker-", dir=home))
        lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o600)
        fcntl.flock(lock, fcntl.LOCK_EX)
        return folder, lock
    finally:
        os.close(gate)


def _unused(folder: Path) -> bool:
    try:
        lock = os.open(folder / ".lock", os.O_RDWR)
    except OSError:
        return True
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(lock)
    return True


@contextmanager
def _without_main() -> Iterator[None]:
    """Spare a new process the main module of this one, which is Ray's and would load all of Ray."""
    main: Any = sys.modules["__main__"]
    before = main.__spec__, main.__file__
    main.__spec__, main.__file__ = None, None
    try:
        yield
    finally:
        main.__spec__, main.__file__ = before


def actor_class() -> type:
    """The actor. Made inside a function, so that Ray carries its code to nodes that lack robospa,
    and they can say so."""

    class RobospaWorker:
        """Arguments and answers are packed here: a node of another version must not meet them."""

        def begin(self, wanted: dict[str, str], packed: bytes) -> tuple[str, str]:
            try:
                from robospa.harness.running import ray_node
            except ImportError as error:
                return "unfit", f"robospa cannot be imported there ({error})"
            trouble = ray_node.misfit(wanted)
            if trouble:
                return "unfit", trouble
            self.worker = ray_node.unpack(packed)
            return "placed", ""

        def send(self, packed: bytes) -> None:
            import pickle

            self.worker.send(pickle.loads(packed))

        def hear(self, seconds: float) -> bytes:
            import pickle

            return pickle.dumps(self.worker.hear(seconds))

    return RobospaWorker


def pack(config: WorkerConfig, name: str) -> bytes:
    """What `unpack` makes a worker of, in an actor of the same version."""
    return pickle.dumps((config, name))


def unpack(packed: bytes) -> NodeWorker:
    """The worker that the driver wants."""
    config, name = pickle.loads(packed)
    return NodeWorker(config, name)
