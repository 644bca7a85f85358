"""Interrupt a real `robospa eval` at random, resume, compare with a run in peace.

Drivers, workers and policy servers are real processes. In the end every run must hold exactly the
trials it was to hold, each once, with records and actions equal to those of an uninterrupted run,
and nothing else in its folder. The sequence follows from the seed, the moments also from the
machine. `ROBOSPA_SOAK=200` makes that many interruptions.
"""

from __future__ import annotations

import os
import random
import resource
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
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
UNDECIDED = ("wall_time", "timing", "latency", "attempts", "retries", "video")
"""Fields of a record that may differ from one run to the next."""
PATIENCE = 180.0


class Finding(Exception):
    """Something that must not be."""


# ---------------------------------------------------------------- processes


def kill(pid: int, number: int) -> None:
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


def command_of(pid: int) -> str:
    """The command line of `pid`; empty if it is gone."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_text(errors="replace")
    except OSError:
        return ""


def children(pid: int) -> list[int]:
    try:
        text = " ".join(p.read_text() for p in Path(f"/proc/{pid}/task").glob("*/children"))
    except OSError:
        return []
    return [int(word) for word in text.split()]


def until(condition: Callable[[], bool], finding: Callable[[], str], seconds: float) -> None:
    """Return once `condition()` holds; Finding if that takes too long."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise Finding(finding())
        time.sleep(0.01)


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
        quiet = subprocess.DEVNULL
        self.process = subprocess.Popen(
            words, env=self._environment, stdout=quiet, stderr=quiet, start_new_session=True
        )

    def kill(self) -> None:
        """As the kernel does when memory runs out."""
        self.process.kill()
        self.process.wait()


class Run:
    """One run's folder and the drivers that work on it, one after the other."""

    def __init__(
        self, folder: Path, words: list[str], environment: Mapping[str, str], server: Server
    ) -> None:
        self.folder, self.server = folder, server
        self.words = [*words, "--out", str(folder)]
        self.environment = environment
        self.log = folder.with_name(folder.name + ".log")
        self.starts = 0

    def start(self) -> None:
        """A driver, which starts the run or goes on with it; its output is added to the log."""
        self.starts += 1
        self.offset = self.log.stat().st_size if self.log.exists() else 0
        resume = ["--resume"] if (self.folder / "run.json").exists() else []
        with self.log.open("ab") as log:
            self.driver = subprocess.Popen(
                [*self.words, *resume],
                env=self.environment,
                stdout=subprocess.DEVNULL,
                stderr=log,
                start_new_session=True,
            )

    def alive(self) -> bool:
        """Whether the driver is at work."""
        return self.driver.poll() is None

    def wait(self) -> int:
        """Exit code of the driver."""
        try:
            return self.driver.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise Finding(f"the driver does not end; it said: {self.said()}") from None

    def said(self) -> str:
        """What the last driver has printed."""
        with self.log.open("rb") as log:
            log.seek(self.offset)
            return log.read().decode(errors="replace")

    def workers(self) -> list[int]:
        """Process ids of the driver's workers."""
        found = children(self.driver.pid)
        return [pid for pid in found if "robospa.harness.pool" in command_of(pid)]

    def lines(self) -> int:
        """Whole records on disk."""
        return sum(p.read_bytes().count(b"\n") for p in (self.folder / TRIALS).glob("*.jsonl"))

    def in_flight(self) -> bool:
        """Whether workers are at trials."""
        return self.alive() and self.lines() > 0 and len(self.workers()) > 0

    def end(self) -> None:
        """Nothing of it stays alive."""
        if self.alive():
            for pid in [*self.workers(), self.driver.pid]:
                kill(pid, signal.SIGKILL)
            self.driver.wait()


class Bench:
    """Everything that the runs of one soak share."""

    def __init__(self, base: Path, trials: int, workers: int) -> None:
        self.base = base
        self.environment = {**os.environ, "NO_COLOR": "1"}
        self.environment["OMP_NUM_THREADS"] = "1"
        self.server = Server(self.environment)
        per = max(1, trials // 2)
        self.words = [*ROBOSPA, "eval", f"ws://127.0.0.1:{self.server.port}"]
        self.words += ["--tasks", "Pick_Blocks_Size", "--levels", "1-2", "--run-seed", "1"]
        self.words += ["--trials", str(per)]
        self.words += ["--workers", str(workers), "--backoff", "0.05", "--attempts", "10"]
        self.words += ["--seeds", f"100000-{100000 + per - 1}"]
        self.words += ["--world", "soak_fakes:SoakWorld", "--parts", "soak_fakes:parts"]
        self.words += ["--stuck-timeout", "3", "--wait", "60"]

    def new_run(self, number: int) -> Run:
        """A fresh folder."""
        return Run(self.base / f"run{number}", self.words, self.environment, self.server)

    def reference(self) -> dict[TrialKey, TrialRecord]:
        """The records of a run in peace."""
        run = self.new_run(0)
        run.start()
        if run.wait() != 0:
            raise Finding(f"the run in peace failed: {run.said()}")
        found = dict(read_run(run.folder).records)
        assert check_run(run, found) == []
        return found


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


# ---------------------------------------------------------------- kinds of interruption
# Each is done to a run whose workers are at trials. It returns True if it took place; False if the
# moment was wrong (the run was just over).


def driver_killed(run: Run, rng: random.Random) -> bool:
    """kill -9 of the driver, and its workers end with it."""
    workers = run.workers()
    kill(run.driver.pid, signal.SIGKILL)
    code = run.wait()
    if code not in (-signal.SIGKILL, 0):
        raise Finding(f"exit code {code} after a kill: {run.said()}")
    gone = lambda: not any(map(command_of, workers))  # noqa: E731
    until(gone, lambda: f"one of {workers} outlives its driver", 30.0)
    return code != 0


@contextmanager
def kept_stopped(run: Run) -> Iterator[None]:
    everybody = [run.driver.pid, *run.workers()]
    for pid in everybody:
        kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in everybody:
            kill(pid, signal.SIGCONT)


def worker_killed_writing(run: Run, rng: random.Random) -> bool:
    """kill -9 of all workers just when one of them puts a trial on disk."""
    end = time.monotonic() + 5.0
    while run.alive() and time.monotonic() < end:
        if any((run.folder / ACTIONS).glob(PARTIAL)):
            time.sleep(rng.choice((0.0, 0.0, 0.001, 0.003)))
            workers = run.workers()
            for pid in workers:
                kill(pid, signal.SIGKILL)
            return bool(workers)
    return False


def server_killed(run: Run, rng: random.Random) -> bool:
    """kill -9 of the policy's server, and another one at its address after up to a second."""
    run.server.kill()
    time.sleep(rng.uniform(0.0, 1.0))
    run.server.start()
    return True


def file_too_large(run: Run, rng: random.Random) -> bool:
    """A worker that may write its record only in part (a quota, a limit on file sizes)."""
    sizes = [p.stat().st_size for p in (run.folder / TRIALS).glob("*.jsonl")]
    limit = max([2048, *sizes]) + rng.randrange(1200)
    for pid in run.workers():
        try:
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (limit, limit))
        except ProcessLookupError:
            continue
    code, said = run.wait(), run.said()
    if code == 0:
        return False  # the last trial was already written
    last = said.strip().splitlines()[-1]
    if code != 1 or "make room" not in last or "--resume" not in last or "Traceback" in said:
        raise Finding(f"a full disk ends in {code}: {said}")
    return True


def second_driver(run: Run, rng: random.Random) -> bool:
    """Somebody starts the same run a second time."""
    words = [*run.words, "--resume"]
    with kept_stopped(run):  # so that it is still there when the second one asks
        done = subprocess.run(
            words, env=run.environment, capture_output=True, text=True, timeout=PATIENCE
        )
    if done.returncode != 1 or "is running the run" not in done.stderr:
        raise Finding(f"a second driver got in: {done.returncode} {done.stderr}")
    return True


KINDS: dict[str, Callable[[Run, random.Random], bool]] = {
    "driver killed": driver_killed,
    "workers killed while writing": worker_killed_writing,
    "server killed": server_killed,
    "file too large": file_too_large,
    "second driver": second_driver,
}


def interrupt(run: Run, kind: str, rng: random.Random) -> bool:
    """Do this once a few more trials are on disk; a driver may also be killed while it starts."""
    if kind == "driver killed" and rng.random() < 0.4:
        time.sleep(rng.uniform(0.0, 2.0))
        return run.alive() and KINDS[kind](run, rng)
    wanted = run.lines() + rng.randrange(1, 9)
    until(
        lambda: not run.alive() or run.lines() >= wanted,
        lambda: f"the run does not go on: {run.said()}",
        PATIENCE,
    )
    time.sleep(rng.uniform(0.0, 0.3))
    return run.in_flight() and KINDS[kind](run, rng)


def until_done(run: Run, rng: random.Random, left: list[str], most: int) -> Counter[str]:
    """Drive a run to its end through `most` interruptions, those in `left` first and then all
    KINDS again; raises Finding."""
    done: Counter[str] = Counter()
    while True:
        run.start()
        while run.alive() and done.total() < most:
            left.extend(() if left else rng.sample(list(KINDS), len(KINDS)))
            if interrupt(run, left[-1], rng):
                done[left.pop()] += 1
        code = run.wait()
        if code == 0:
            return done
        if code == 1 and "make room" not in run.said():
            raise Finding(f"the driver gave up: {run.said()}")


def test_a_run_interrupted_at_random_equals_one_in_peace(tmp_path: Path) -> None:
    most, rng = int(os.environ.get("ROBOSPA_SOAK", "5")), random.Random(4)
    bench = Bench(tmp_path, trials=24, workers=2)
    done: Counter[str] = Counter()
    left: list[str] = []
    try:
        reference = bench.reference()
        for number in range(1, most + 1):
            run = bench.new_run(number)
            try:
                done += until_done(run, rng, left, most - done.total())
                assert check_run(run, reference) == []
            finally:
                run.end()
            if done.total() >= most:
                break
    finally:
        bench.server.kill()
    assert done.total() == most
