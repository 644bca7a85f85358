"""What runs on a node of a Ray cluster: an actor that looks after one worker process.

The worker is the same process as on one machine, with a folder of its own on the node. The actor
passes messages on, and hands over what the worker wrote (actions, video, output) together with the
record: nobody else sees the node's disk. The worker process dies with its actor, and is in no
danger from it: a crash of the simulator leaves the actor, which still has the crash's stack.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any

from robospa.harness.running.code_hash import code_hash
from robospa.harness.running.executor import Message
from robospa.harness.running.local_workers import LocalExecutor
from robospa.harness.running.ray_messages import Heard, pack_heard, unpack_config, unpack_order
from robospa.harness.running.store import ACTIONS, VIDEOS
from robospa.harness.running.worker import LOGS, describe
from robospa.protocol.errors import DecodeError

LOG_BYTES = 64_000
"""Most of a worker's output that travels at once."""


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

    def __init__(self, packed: bytes, name: str) -> None:
        """`packed` is the worker's configuration; raises DecodeError if it is none."""
        config = unpack_config(packed)
        self._folder, self._lock = _own_folder()
        self._log = self._folder / LOGS / f"{name}.log"
        self._read = 0
        self._trouble = ""
        self._executor = LocalExecutor(replace(config, folder=self._folder), 1)
        with _without_main():
            self._hand = self._executor.hire(name)

    def send(self, packed: bytes) -> None:
        """Tell the worker; what cannot be read ends it, and `hear` says why."""
        try:
            self._hand.send(unpack_order(packed))
        except DecodeError as error:
            self._trouble = f"it was sent what cannot be read: {error}"
            self._hand.process.kill()

    def hear(self, seconds: float) -> bytes:
        """Wait until the worker says something of weight or ends, `seconds` at most."""
        try:
            return pack_heard(self._hear(seconds))
        except Exception as error:  # Ray would pickle it
            traceback.print_exc()
            return pack_heard(Heard((), b"", describe(error)))

    def _hear(self, seconds: float) -> Heard:
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
            gone and (self._trouble or gone),
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
    before = {name: getattr(main, name, None) for name in ("__spec__", "__file__")}
    vars(main).update(dict.fromkeys(before))
    try:
        yield
    finally:
        vars(main).update(before)


def actor_class() -> type:
    """The actor. Made inside a function, so that Ray carries its code to nodes that lack robospa,
    and they can say so."""

    class RobospaWorker:
        """Takes and gives plain values: Ray pickles all others, exceptions too. A node of another
        version reads nothing but its versions."""

        def begin(self, wanted: dict[str, str], config: bytes, name: str) -> list[str]:
            try:
                from robospa.harness.running import ray_node
            except ImportError as error:
                return ["unfit", f"robospa cannot be imported there ({error})"]
            trouble = ray_node.misfit(wanted)
            if trouble:
                return ["unfit", trouble]
            try:
                self.worker = ray_node.NodeWorker(config, name)
            except Exception as error:
                return ["failed", f"{type(error).__name__}: {error}"]
            return ["placed"]

        def send(self, order: bytes) -> None:
            self.worker.send(order)

        def hear(self, seconds: float) -> bytes:
            return self.worker.hear(seconds)

    return RobospaWorker
