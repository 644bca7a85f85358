"""What runs on a node of a Ray cluster: an actor that looks after one worker process.

The worker is the same process as on one machine, with a folder of its own on the node. The actor
passes messages on, and hands over what the worker wrote (actions, output) together with the
record, because nobody else sees the node's disk. The worker process dies with its actor; a crash of
the simulator leaves the actor, which still has the crash's output.
"""

from __future__ import annotations

import pickle
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import metadata
from pathlib import Path

from robospa.harness.running.code_hash import code_hash
from robospa.harness.running.executor import LocalExecutor
from robospa.harness.running.log_file import LOGS
from robospa.harness.running.messages import Command, Heartbeat, Message, Ready, TrialDone
from robospa.harness.running.worker import WorkerConfig
from robospa.results.records.run_io import ACTIONS

LOG_BYTES = 64_000
"""Most of a worker's output that travels at once."""


@dataclass(frozen=True)
class Report:
    """What one worker sent since its last report, the `files` of a trial that is done (by path
    within the run's folder), its `output`, and how it ended (None while it runs)."""

    messages: tuple[Message, ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
    output: bytes = b""
    exit_status: str | None = None


def versions() -> dict[str, str]:
    """What has to be the same on every node for records to be the same."""
    found = {"python": sys.version.split()[0], "code": code_hash()}
    for package in ("robospa", "numpy", "sapien"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "missing"
    return found


def version_differences(driver: Mapping[str, str]) -> str:
    """Why this node cannot take part in a run whose driver has the versions `driver`, or empty."""
    here = versions()
    differ = [
        f"{name} {here.get(name)} instead of {version}"
        for name, version in driver.items()
        if here.get(name) != version
    ]
    return f"it has {', '.join(differ)}" if differ else ""


class WorkerActor:
    """The actor: one worker process and its folder."""

    def start(self, driver: Mapping[str, str], config: bytes, name: str) -> str:
        """Start the worker; returns why this node cannot be used, or nothing.

        `driver` holds the driver's versions; `config` is a pickled WorkerConfig, which another
        version could not read.
        """
        if differences := version_differences(driver):
            return differences
        unpickled: WorkerConfig = pickle.loads(config)
        self._folder = tempfile.TemporaryDirectory(prefix="robospa-", ignore_cleanup_errors=True)
        self._path = Path(self._folder.name)
        self._log = self._path / LOGS / f"{name}.log"
        self._read = 0
        self._executor = LocalExecutor(replace(unpickled, folder=self._path), 1)
        self._worker = self._executor.start(name)
        return ""

    def send(self, command: Command) -> None:
        """Pass `command` on to the worker."""
        self._worker.send(command)

    def report(self, seconds: float) -> Report:
        """Wait until the worker sends more than heartbeats or ends, `seconds` at most."""
        until = time.monotonic() + seconds
        beats: list[Message] = []
        others: list[Message] = []
        exit_status: str | None = None
        while exit_status is None and not others and time.monotonic() < until:
            self._executor.wait([self._worker], until - time.monotonic())
            exit_status = self._worker.exit_status()
            for message in self._worker.messages():
                (beats if isinstance(message, Heartbeat) else others).append(message)
        files = self._take_files() if any(isinstance(m, TrialDone) for m in others) else {}
        others = [Ready(None) if isinstance(m, Ready) else m for m in others]
        return Report((*beats[-1:], *others), files, self._new_output(), exit_status)

    def close(self) -> None:
        """End the worker and remove its folder."""
        self._worker.kill()
        self._folder.cleanup()

    def _take_files(self) -> dict[str, bytes]:
        """What the trial left beside its record, which is then removed here."""
        found: dict[str, bytes] = {}
        for path in sorted((self._path / ACTIONS).glob("[!.]*")):
            found[f"{ACTIONS}/{path.name}"] = path.read_bytes()
            path.unlink()
        return found

    def _new_output(self) -> bytes:
        try:
            with self._log.open("rb") as file:
                file.seek(self._read)
                text = file.read(LOG_BYTES)
        except OSError:
            return b""
        self._read += len(text)
        return text
