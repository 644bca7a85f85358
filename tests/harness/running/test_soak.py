"""Kill a real `robospa eval`, its workers or its server at random, resume, compare with a calm run.

In the end every run must hold exactly the trials that it was to hold, each once, with records and
actions equal to those of an undisturbed run, and nothing else in its folder. What is done follows
from a seed, its moments also from the machine. `ROBOSPA_SOAK=200` makes that many interruptions.
"""

import os
import random
import signal
import socket
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from command_line import ROBOSPA

from robospa.harness.running.atomic_file import PARTIAL
from robospa.harness.running.record_store import read_trace
from robospa.harness.trial import actions_digest
from robospa.results.records.runs import ACTIONS, TRIALS, action_path, finished, read_file, read_run
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

UNDECIDED = ("wall_time", "timing", "latency", "attempts", "retries", "video")
"""Fields of a record that may differ from one run to the next."""
TRIALS_PER_LEVEL = 12
PATIENCE = 180.0


def until(condition: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.01)


def read_of(pid: int, name: str) -> str:
    """A file of /proc about a process; empty if it is gone."""
    with suppress(OSError):
        return " ".join(p.read_text(errors="replace") for p in Path(f"/proc/{pid}").glob(name))
    return ""


def kill(*pids: int) -> None:
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


class Server:
    """A policy server as a process of its own, always at the same port."""

    def __init__(self) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port: int = probe.getsockname()[1]
        self.start()

    def start(self) -> None:
        words = [*ROBOSPA, "serve", "soak_fakes:SoakPolicy", "--port", str(self.port)]
        quiet = subprocess.DEVNULL
        self.process = subprocess.Popen(words, stdout=quiet, stderr=quiet, start_new_session=True)

    def stop(self) -> None:
        self.process.kill()
        self.process.wait()


class Run:
    """One run's folder and the drivers that work on it, one after the other."""

    def __init__(self, folder: Path, server: Server) -> None:
        self.folder, self.server = folder, server
        self.log = folder.with_name(folder.name + ".log")
        self.words = [
            *(*ROBOSPA, "eval", f"ws://127.0.0.1:{server.port}", "--tasks", "Pick_Blocks_Size"),
            *("--levels", "1-2", "--run-seed", "1", "--trials", str(TRIALS_PER_LEVEL)),
            *("--seeds", f"100000-{99_999 + TRIALS_PER_LEVEL}", "--workers", "2"),
            *("--world", "soak_fakes:SoakWorld", "--parts", "run_fakes:parts"),
            *("--backoff", "0.05", "--attempts", "10", "--wait", "60", "--out", str(folder)),
        ]

    def start(self) -> None:
        """A driver, which starts the run or goes on with it."""
        resume = ["--resume"] if (self.folder / "run.json").exists() else []
        quiet = subprocess.DEVNULL
        with self.log.open("ab") as log:
            self.driver = subprocess.Popen(
                [*self.words, *resume], stdout=quiet, stderr=log, start_new_session=True
            )

    def alive(self) -> bool:
        return self.driver.poll() is None

    def workers(self) -> list[int]:
        """Process ids of the driver's workers."""
        found = map(int, read_of(self.driver.pid, "task/*/children").split())
        return [pid for pid in found if "robospa.harness.pool" in read_of(pid, "cmdline")]

    def lines(self) -> int:
        """Whole records on disk."""
        return sum(p.read_bytes().count(b"\n") for p in (self.folder / TRIALS).glob("*.jsonl"))

    def finish(self, rng: random.Random, most: int) -> int:
        """Drive the run to its end through `most` interruptions; how many there were."""
        done = 0
        while True:
            self.start()
            while self.alive() and done < most:
                wanted = self.lines() + rng.randrange(1, 9)
                until(lambda: not self.alive() or self.lines() >= wanted, "no trial ends")  # noqa: B023
                time.sleep(rng.uniform(0.0, 0.3))
                done += self.alive() and INTERRUPTIONS[done % len(INTERRUPTIONS)](self, rng)
            code = self.driver.wait(PATIENCE)
            assert code in (0, -signal.SIGKILL), self.log.read_text()
            if code == 0:
                return done


def driver_killed(run: Run, rng: random.Random) -> bool:
    """Its workers end with it."""
    workers = run.workers()
    kill(run.driver.pid)
    run.driver.wait()
    until(lambda: not any(read_of(pid, "cmdline") for pid in workers), "a worker stays")
    return True


def workers_killed_writing(run: Run, rng: random.Random) -> bool:
    """All of them, just when one puts a trial on disk; False if that moment did not come."""
    end = time.monotonic() + 5.0
    while run.alive() and time.monotonic() < end:
        if any((run.folder / ACTIONS).glob(PARTIAL)):
            time.sleep(rng.choice((0.0, 0.0, 0.001, 0.003)))
            kill(*(workers := run.workers()))
            return bool(workers)
    return False


def server_killed(run: Run, rng: random.Random) -> bool:
    """And another one at its address after up to a second."""
    run.server.stop()
    time.sleep(rng.uniform(0.0, 1.0))
    run.server.start()
    return True


INTERRUPTIONS = (driver_killed, workers_killed_writing, server_killed)


def problems(folder: Path, reference: Mapping[TrialKey, TrialRecord]) -> list[str]:
    """What is wrong with a finished run; empty if it is equal to one in peace."""
    found = read_run(folder)
    wrong = [f"missing: {key.slug}" for key in found.missing]
    if set(found.keys) != set(reference):
        wrong.append("the list of trials is another one")
    count: Counter[TrialKey] = Counter()
    for path in (folder / TRIALS).glob("*.jsonl"):
        count.update(record.key for record in read_file(path) if finished(record))
    wrong += [f"{n} results of {key.slug}" for key, n in count.items() if n != 1]
    for key in set(count) & set(reference):
        record, wanted = found.records[key], decided(reference[key])
        wrong += [f"{key.slug}: {n} differs" for n, v in decided(record).items() if v != wanted[n]]
        actions = read_trace(action_path(folder, key)).actions
        refused = record.end == "policy_error" and len(actions) == record.steps - 1  # not kept
        if not refused and actions_digest(list(actions)) != record.actions_digest:
            wrong.append(f"{key.slug}: the actions on disk are not those of the record")
    wrong += [f"left behind: {p}" for p in folder.rglob(PARTIAL)]
    traces = {p.name for p in (folder / ACTIONS).iterdir()}
    return wrong + [f"strange: {n}" for n in traces - {f"{k.slug}.npz" for k in reference}]


def decided(record: TrialRecord) -> dict[str, Any]:
    return {k: v for k, v in asdict(record).items() if k not in UNDECIDED}


def test_a_run_interrupted_at_random_equals_one_in_peace(tmp_path: Path) -> None:
    left, rng, server = int(os.environ.get("ROBOSPA_SOAK", "4")), random.Random(4), Server()
    run = Run(tmp_path / "peace", server)
    try:
        assert run.finish(rng, 0) == 0
        reference = dict(read_run(run.folder).records)
        assert problems(run.folder, reference) == []
        while left > 0:
            run = Run(tmp_path / f"run{left}", server)
            left -= run.finish(rng, left)
            assert problems(run.folder, reference) == [], run.log.read_text()
    finally:
        kill(run.driver.pid)
        server.stop()
