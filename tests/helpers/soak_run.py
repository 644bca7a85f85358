"""The processes of a soak: a policy server, drivers on a run's folder, and what a run must be."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from robospa.harness.running.atomic_file import PARTIAL
from robospa.harness.running.record_store import read_actions
from robospa.harness.trial import actions_digest
from robospa.results.records.runs import ACTIONS, TRIALS, action_path, finished, read_file, read_run
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

ROBOSPA = [sys.executable, "-m", "robospa.harness.cli.main"]
HELPERS = Path(__file__).resolve().parent
UNDECIDED = ("wall_time", "timing", "latency", "attempts", "retries", "video")
"""Fields of a record that may differ from one run to the next."""
STUCK_SECONDS = 3.0
PATIENCE = 180.0


class Finding(Exception):
    """Something that must not be."""


class Server:
    """A policy server as a process of its own, always at the same port."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port: int = probe.getsockname()[1]
        self._environment = dict(environment)
        self.start()

    def start(self) -> None:
        """Listen (again)."""
        words = [*ROBOSPA, "serve", "soak_fakes:SoakPolicy", "--port", str(self.port)]
        self.process = subprocess.Popen(
            words,
            env=self._environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def kill(self) -> None:
        """As the kernel does when memory runs out."""
        self.process.kill()
        self.process.wait()


class Run:
    """One run's folder and the drivers that work on it, one after the other."""

    def __init__(self, folder: Path, words: list[str], environment: Mapping[str, str]) -> None:
        self.folder = folder
        self.words = [*words, "--out", str(folder)]
        self.mark = folder.with_name(folder.name + ".stuck")
        self.environment = {**environment, "SOAK_STUCK": str(self.mark)}
        self.log = folder.with_name(folder.name + ".log")
        self.server: Server | None = None
        self.driver: subprocess.Popen[bytes] | None = None
        self.starts = 0

    def command(self) -> list[str]:
        """Start, or go on with, the run."""
        return [*self.words, *(["--resume"] if (self.folder / "run.json").exists() else [])]

    def start(self) -> None:
        """A driver; its output is added to the log."""
        self.starts += 1
        self.offset = self.log.stat().st_size if self.log.exists() else 0
        with self.log.open("ab") as log:
            self.driver = subprocess.Popen(
                self.command(),
                env=self.environment,
                stdout=subprocess.DEVNULL,
                stderr=log,
                start_new_session=True,
            )

    def alive(self) -> bool:
        """Whether a driver is at work."""
        return self.driver is not None and self.driver.poll() is None

    def wait(self) -> int:
        """Exit code of the driver."""
        assert self.driver is not None
        try:
            return self.driver.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise Finding(f"the driver does not end; it said: {self.said()}") from None

    def said(self) -> str:
        """What the last driver has printed."""
        with self.log.open("rb") as log:
            log.seek(self.offset)
            return log.read().decode(errors="replace")

    def errors(self) -> str:
        """The end of all drivers' output."""
        return self.log.read_text(errors="replace")[-4000:] if self.log.exists() else ""

    def workers(self) -> list[int]:
        """Process ids of the driver's workers."""
        return (
            [p for p in children(self.driver.pid) if "robospa.harness.pool" in command_of(p)]
            if (self.driver is not None)
            else []
        )

    def lines(self) -> int:
        """Whole records on disk."""
        return sum(p.read_bytes().count(b"\n") for p in (self.folder / TRIALS).glob("*.jsonl"))

    def end(self) -> None:
        """Nothing of it stays alive."""
        if self.driver is not None and self.driver.poll() is None:
            for pid in [*self.workers(), self.driver.pid]:
                kill(pid, signal.SIGKILL)
            self.driver.wait()


class Bench:
    """Everything that the runs of one soak share."""

    def __init__(self, base: Path, trials: int, workers: int, real: bool) -> None:
        self.base = base
        path = os.pathsep.join(filter(None, (str(HELPERS), os.environ.get("PYTHONPATH"))))
        self.environment = {**os.environ, "PYTHONPATH": path, "NO_COLOR": "1"}
        self.environment["OMP_NUM_THREADS"] = "1"
        self.server = None if real else Server(self.environment)
        per = max(1, trials // 2)
        policy = f"ws://127.0.0.1:{self.server.port}" if self.server else "oracle"
        self.words = [*ROBOSPA, "eval", policy, "--tasks", "Pick_Blocks_Size", "--levels", "1-2"]
        self.words += ["--trials", str(per), "--workers", str(workers), "--backoff", "0.05"]
        self.words += ["--seeds", f"100000-{100000 + per - 1}", "--attempts", "10"]
        if not real:
            self.words += ["--world", "soak_fakes:SoakWorld", "--parts", "soak_fakes:parts"]
            self.words += ["--stuck-timeout", str(STUCK_SECONDS), "--wait", "60"]
        else:
            self.words += ["--stuck-timeout", "60"]

    def new_run(self, number: int) -> Run:
        """A fresh folder."""
        run = Run(self.base / f"run{number}", self.words, self.environment)
        run.server = self.server
        return run

    def reference(self) -> dict[TrialKey, TrialRecord]:
        """The records of a run in peace."""
        run = self.new_run(0)
        run.start()
        if run.wait() != 0:
            raise SystemExit(f"soak: the run in peace failed: {run.errors()}")
        found = read_run(run.folder)
        if problems := check_run(run, dict(found.records)):
            raise SystemExit(f"soak: the run in peace is not whole: {problems}")
        return dict(found.records)

    def close(self) -> None:
        """End the server."""
        if self.server is not None:
            self.server.kill()


def check_run(run: Run, reference: Mapping[TrialKey, TrialRecord]) -> list[str]:
    """What is wrong with a finished run; empty if it is equal to one in peace."""
    found = read_run(run.folder)
    wrong = [f"missing: {key.slug}" for key in found.missing]
    if set(found.keys) != set(reference):
        wrong.append("the list of trials is another one")
    count: Counter[TrialKey] = Counter()
    for path in (run.folder / TRIALS).glob("*.jsonl"):
        count.update(record.key for record in read_file(path) if finished(record))
    wrong += [f"{n} results of {key.slug}" for key, n in count.items() if n != 1]
    for key in set(count) & set(reference):
        wrong += _differences(run.folder, found.records[key], reference[key])
    wrong += [f"left behind: {p}" for p in run.folder.rglob(PARTIAL)]
    traces = {p.name for p in (run.folder / ACTIONS).iterdir()}
    wrong += [f"strange: {name}" for name in traces - {f"{k.slug}.npz" for k in reference}]
    return wrong


def _differences(folder: Path, record: TrialRecord, wanted: TrialRecord) -> list[str]:
    ours, theirs = _decided(record), _decided(wanted)
    wrong = [f"{record.key.slug}: {n} differs" for n in ours if ours[n] != theirs[n]]
    actions, _ = read_actions(action_path(folder, record.key))
    refused = record.end == "policy_error" and len(actions) == record.steps - 1  # not kept
    whole = len(actions) == record.steps and actions_digest(list(actions)) == record.actions_digest
    if not whole and not refused:
        wrong.append(f"{record.key.slug}: the actions on disk are not those of the record")
    return wrong


def _decided(record: TrialRecord) -> dict[str, Any]:
    return {k: v for k, v in asdict(record).items() if k not in UNDECIDED}


def children(pid: int) -> list[int]:
    """Child processes of `pid`."""
    try:
        text = " ".join(p.read_text() for p in Path(f"/proc/{pid}/task").glob("*/children"))
    except OSError:
        return []
    return [int(word) for word in text.split()]


def command_of(pid: int) -> str:
    """The command line of `pid`; empty if it is gone."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_text(errors="replace")
    except OSError:
        return ""


def kill(pid: int, number: int) -> None:
    """Send a signal to a process that may be gone."""
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


def wait_gone(pids: list[int]) -> None:
    """Finding unless all of `pids` are gone (or zombies) soon."""
    until = time.monotonic() + 30.0
    for pid in pids:
        while command_of(pid):
            if time.monotonic() > until:
                kill(pid, signal.SIGKILL)
                raise Finding(f"process {pid} outlives its driver")
            time.sleep(0.02)


__all__ = ["Bench", "Finding", "Run", "Server", "check_run", "kill", "wait_gone"]
