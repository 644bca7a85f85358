"""What a soak does to a run: one function a kind of interruption.

Each returns True if it took place; False if the moment was wrong (no worker yet, run just over).
"""

from __future__ import annotations

import random
import resource
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from soak_run import PATIENCE, Finding, Run, kill, wait_gone

from robospa.harness.running.atomic_file import PARTIAL
from robospa.results.records.runs import ACTIONS


def _signal_driver(run: Run, number: int, code: int) -> bool:
    if not run.alive() or run.driver is None:
        return False
    workers = run.workers()
    kill(run.driver.pid, number)
    got = run.wait()
    if got not in (code, 0):
        raise Finding(f"exit code {got} instead of {code} after signal {number}: {run.said()}")
    wait_gone(workers)
    return got == code


def driver_killed(run: Run, rng: random.Random) -> bool:
    """kill -9, at any moment: also while it starts."""
    return _signal_driver(run, signal.SIGKILL, -signal.SIGKILL)


def driver_terminated(run: Run, rng: random.Random) -> bool:
    """SIGTERM, as a scheduler sends it before it takes the machine away."""
    return _in_flight(run) and _signal_driver(run, signal.SIGTERM, 130)


def driver_interrupted(run: Run, rng: random.Random) -> bool:
    """Ctrl-C: the whole group gets it."""
    if not _in_flight(run) or run.driver is None:
        return False
    workers = run.workers()
    for pid in workers:
        kill(pid, signal.SIGINT)
    return _signal_driver(run, signal.SIGINT, 130)


def driver_stopped(run: Run, rng: random.Random) -> bool:
    """Ctrl-Z for longer than a worker may be silent, then on: nobody is to blame."""
    if not _in_flight(run) or run.driver is None:
        return False
    with _kept_stopped(run):
        time.sleep(6.0)
    return True


@contextmanager
def _kept_stopped(run: Run) -> Iterator[None]:
    assert run.driver is not None
    everybody = [run.driver.pid, *run.workers()]
    for pid in everybody:
        kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in everybody:
            kill(pid, signal.SIGCONT)


def worker_killed(run: Run, rng: random.Random) -> bool:
    """kill -9 of a worker, at any moment."""
    workers = run.workers()
    if not workers:
        return False
    kill(rng.choice(workers), signal.SIGKILL)
    return True


def worker_killed_writing(run: Run, rng: random.Random) -> bool:
    """kill -9 of all workers just when one of them puts a trial on disk."""
    until = time.monotonic() + 5.0
    while run.alive() and time.monotonic() < until:
        if any((run.folder / ACTIONS).glob(PARTIAL)):
            time.sleep(rng.choice((0.0, 0.0, 0.001, 0.003)))
            workers = run.workers()
            for pid in workers:
                kill(pid, signal.SIGKILL)
            return bool(workers)
    return False


def worker_stopped(run: Run, rng: random.Random) -> bool:
    """SIGSTOP of a worker: alive, and silent for ever. The watchdog has to end it."""
    if not _in_flight(run):
        return False
    workers = run.workers()
    victim = rng.choice(workers)
    kill(victim, signal.SIGSTOP)
    return _replaced(run, victim)


def worker_stuck(run: Run, rng: random.Random) -> bool:
    """A worker inside native code that never lets go of the interpreter."""
    if not _in_flight(run):
        return False
    before = run.said().count("did not advance")
    run.mark.touch()
    until = time.monotonic() + PATIENCE
    while run.alive():
        if run.said().count("did not advance") > before:
            return True
        if time.monotonic() > until:
            raise Finding("a worker that is stuck in native code stays")
        time.sleep(0.05)
    if run.mark.exists():
        run.mark.unlink()
        return False
    return run.said().count("did not advance") > before


def orphan_stopped(run: Run, rng: random.Random) -> bool:
    """SIGSTOP of a worker, then kill -9 of the driver: the worker must not survive it."""
    if not _in_flight(run):
        return False
    kill(rng.choice(run.workers()), signal.SIGSTOP)
    return _signal_driver(run, signal.SIGKILL, -signal.SIGKILL)


def server_killed(run: Run, rng: random.Random) -> bool:
    """kill -9 of the policy's server, and another one at its address after up to a second."""
    if not run.alive() or run.server is None:
        return False
    run.server.kill()
    time.sleep(rng.uniform(0.0, 1.0))
    run.server.start()
    return True


def disk_full(run: Run, rng: random.Random) -> bool:
    """Not a byte is left on the run's file system until the driver has given up."""
    filler = run.folder.with_name("filler")
    if not _in_flight(run):
        return False
    try:
        with filler.open("wb", buffering=0) as file:
            try:
                for size in (2**16, 4096):
                    while True:
                        file.write(bytes(size))
            except OSError:
                pass
        return _stops_for_space(run)
    finally:
        filler.unlink(missing_ok=True)


def file_too_large(run: Run, rng: random.Random) -> bool:
    """A worker that may write its record only in part (a quota, a limit on file sizes)."""
    if not _in_flight(run):
        return False
    sizes = [p.stat().st_size for p in (run.folder / "trials").glob("*.jsonl")]
    limit = max([2048, *sizes]) + rng.randrange(1200)
    for pid in run.workers():
        try:
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (limit, limit))
        except ProcessLookupError:
            continue
    return _stops_for_space(run)


def second_driver(run: Run, rng: random.Random) -> bool:
    """Somebody starts the same run a second time."""
    if not _in_flight(run):
        return False
    words = [*run.words, "--resume"]
    with _kept_stopped(run):  # so that it is still there when the second one asks
        done = subprocess.run(
            words, env=run.environment, capture_output=True, text=True, timeout=PATIENCE
        )
    if done.returncode != 1 or "is running the run" not in done.stderr:
        raise Finding(f"a second driver got in: {done.returncode} {done.stderr}")
    return True


def _in_flight(run: Run) -> bool:
    """Whether workers are at trials."""
    return run.alive() and run.lines() > 0 and len(run.workers()) > 0


def _replaced(run: Run, victim: int) -> bool:
    until = time.monotonic() + PATIENCE
    while run.alive() and victim in run.workers():
        if time.monotonic() > until:
            raise Finding(f"a stopped worker stays: {run.said()}")
        time.sleep(0.05)
    return "did not advance" in run.said()


def _stops_for_space(run: Run) -> bool:
    code, said = run.wait(), run.said()
    if code == 0:
        return False  # the last trial was already written
    last = said.strip().splitlines()[-1]
    if code != 1 or "make room" not in last or "--resume" not in last or "Traceback" in said:
        raise Finding(f"a full disk ends in {code}: {said}")
    return True


KINDS: dict[str, Callable[[Run, random.Random], bool]] = {
    "driver killed": driver_killed,
    "driver terminated": driver_terminated,
    "driver interrupted": driver_interrupted,
    "driver and workers stopped for a while": driver_stopped,
    "worker killed": worker_killed,
    "workers killed while writing": worker_killed_writing,
    "worker stopped": worker_stopped,
    "worker stuck in native code": worker_stuck,
    "worker stopped and driver killed": orphan_stopped,
    "server killed": server_killed,
    "disk full": disk_full,
    "file too large": file_too_large,
    "second driver": second_driver,
}
ENDS_DRIVER = (
    "driver killed",
    "driver terminated",
    "driver interrupted",
    "worker stopped and driver killed",
    "disk full",
    "file too large",
)


class Trouble:
    """Interrupts one run until it is finished, or `most` times."""

    def __init__(self, run: Run, rng: random.Random, kinds: list[str], most: int) -> None:
        self.run = run
        self.rng = rng
        self.kinds = kinds
        self.most = most
        self.done: Counter[str] = Counter()

    def until_done(self) -> None:
        """Drive the run to its end through all of it; raises Finding."""
        while True:
            self.run.start()
            while self.run.alive() and self.done.total() < self.most:
                self._one()
            if not self.run.alive() or self.done.total() >= self.most:
                code = self.run.wait()
                if code == 0:
                    return
                if code == 1 and "make room" not in self.run.said():
                    raise Finding(f"the driver gave up: {self.run.said()}")

    def _one(self) -> None:
        kind = self.rng.choice(self.kinds)
        if kind == "driver killed" and self.rng.random() < 0.4:
            time.sleep(self.rng.uniform(0.0, 4.0))  # also before there is anything
        else:
            lines = self.run.lines()
            wanted = self.rng.randrange(1, 9)
            until = time.monotonic() + PATIENCE
            while self.run.alive() and self.run.lines() - lines < wanted:
                if time.monotonic() > until:
                    raise Finding(f"the run does not go on: {self.run.said()}")
                time.sleep(0.005)
            time.sleep(self.rng.uniform(0.0, 0.3))
        if KINDS[kind](self.run, self.rng):
            self.done[kind] += 1
