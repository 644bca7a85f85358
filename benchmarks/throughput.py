"""A whole run against a batching model of 100 ms + 2 ms a sample: how near to the limit it comes.

    python benchmarks/throughput.py [--workers 8] [--held 3] [--json [FILE]]

Driver, workers, wire, server and batching are the real ones. The model sleeps (a GPU that works
leaves the processor alone), the world burns processor time: as much an answer as the case says. The
limits are measured in the same run: of the model by calling full batches one after the other, of
the cores by the same run with a model that answers at once. Throughput is what the server counts
over `--seconds` once all workers run; then the run is ended.
"""

from __future__ import annotations

import contextlib
import functools
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from frame import Figure, Result, main
from numpy.typing import NDArray
from run_fakes import FakeWorld
from step import endless_trial

from robospa.harness.running.request import HELD
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.status import Status, cores, most_workers
from robospa.harness.running.worker import WorkerConfig
from robospa.harness.trial import TrialSetup
from robospa.harness.world import Poll, StepResult
from robospa.observation import Observation
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.protocol.server import ServerThread
from robospa.trial import TrialKey

BASE, ITEM, BATCH = 0.100, 0.002, 8
CALLS = 25
"""Answers that one trial takes."""
Calls = tuple[float, int]
"""When the model answered how many."""


class SimulatedModel:
    """Answers with one action each; counts when it answered how many."""

    def __init__(self, base: float, item: float) -> None:
        self.spec = PolicySpec("simulated", cameras=(), horizon=1, batch=BATCH)
        self.base, self.item = base, item
        self.calls: list[Calls] = []

    def reset(self, trial: TrialInfo) -> None:
        """Nothing is remembered."""

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        """One sample alone."""
        return self.infer_batch([observation], [0])[0]

    def infer_batch(
        self, observations: Sequence[Observation], sessions: Sequence[int]
    ) -> list[NDArray[np.float32]]:
        """Takes as long as it says."""
        if self.base:
            time.sleep(self.base + self.item * len(observations))
        self.calls.append((time.monotonic(), len(observations)))
        return [np.zeros((1, 14), np.float32) for _ in observations]


class BusyWorld(FakeWorld):
    """A world whose step takes `busy` seconds of the processor."""

    def __init__(self, busy: float) -> None:
        super().__init__()
        self.busy = busy

    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        """Compute for `busy` seconds."""
        until = time.thread_time() + self.busy
        while time.thread_time() < until:
            pass
        self.steps += 1
        return StepResult(1, poll(self.snapshot()))


def parts(key: TrialKey) -> TrialSetup:
    """A trial of CALLS steps."""
    return endless_trial(key, CALLS)


@contextlib.contextmanager
def serving(base: float, item: float) -> Iterator[tuple[str, float, Callable[[], list[Calls]]]]:
    """The model in a process of its own: its URL, its limit measured before anybody asks, and what
    ends it and says when it answered how many."""
    words = [sys.executable, __file__, "--serve", str(base), str(item)]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        url, limit = process.stdout.readline().split()
        yield url, float(limit), lambda: json.loads(process.communicate("\n", timeout=60)[0])
    finally:
        process.kill()
        process.wait()


def serve(base: float, item: float) -> None:
    """The process of `serving`."""
    model = SimulatedModel(base, item)
    start_time, rounds = time.perf_counter(), 20
    for _ in range(rounds):
        model.infer_batch([{}] * BATCH, [0] * BATCH)
    limit = BATCH * rounds / (time.perf_counter() - start_time)
    model.calls.clear()
    with ServerThread(model) as server:
        print(server.url, limit, flush=True)
        sys.stdin.readline()
    print(json.dumps(model.calls))


class Enough(Exception):
    """It was measured for long enough."""


@dataclass
class StableRun:
    """Since when the same workers have been running; ends the run after `seconds` of that."""

    seconds: float
    workers: int = 0
    start_time: float = 0.0

    def look(self, status: Status) -> None:
        """Called by the driver."""
        if status.starting or status.workers != self.workers or not status.shares:
            self.workers, self.start_time = status.workers, status.now
        elif status.now - self.start_time > self.seconds:
            raise Enough


def run(
    busy: float, workers: int, seconds: float, model: tuple[float, float], held: int
) -> tuple[float, float, int, float]:
    """Answers a second, samples a call, workers at the end, and the limit of the `model` (seconds
    of a call and of a sample); `workers` 0 for as many as the driver finds right."""
    keys = [TrialKey("Busy", 1, seed) for seed in range(1_000, 21_000)]
    watch = StableRun(seconds if workers else 3 * seconds)  # growing takes whole rounds of trials
    with tempfile.TemporaryDirectory() as folder, serving(*model) as (url, limit, ended):
        config = WorkerConfig(
            Path(folder), url, world="throughput:BusyWorld", world_arguments={"busy": busy},
            parts="throughput:parts", expects={url: SimulatedModel(*model).spec},
        )  # fmt: skip
        options = RunOptions(
            workers or cores(), most=workers or most_workers(), concurrent_trials=held
        )
        with contextlib.suppress(Enough):
            Runner(config, keys, options, on_status=watch.look).run()
        until = time.monotonic() - 0.5
        calls = [call for call in ended() if watch.start_time <= call[0] <= until]
    answers = sum(size for _, size in calls[1:])
    rate = answers / (calls[-1][0] - calls[0][0])
    return rate, answers / (len(calls) - 1), watch.workers, limit


@functools.cache
def cores_alone(busy: float, seconds: float) -> float:
    """Answers a second of a worker a core with a model that answers at once."""
    return run(busy, cores(), seconds, (0.0, 0.0), 1)[0]


def measure(workers: int = 8, held: int = HELD, seconds: float = 8.0) -> Result:
    """Every case beside both limits; `held` trials a worker, `seconds` for which each run lasts."""
    figures = []
    for what, busy, count, bar in (
        (f"{workers} workers, 1 ms of simulation an answer", 0.001, workers, 0.95),
        (f"{workers} workers, 150 ms of simulation an answer", 0.150, workers, 0.9),
        (f"{workers} workers, 30 ms: model and cores alike", 0.030, workers, 0.95),
        ("workers by default, 1 ms of simulation", 0.001, 0, 0.9),
        ("workers by default, 30 ms", 0.030, 0, 0.9),
    ):
        alone = cores_alone(busy, seconds)
        rate, batch, used, model = run(busy, count, seconds, (BASE, ITEM), held)
        note = (
            f"{rate:.1f} answers/s, {batch:.1f} samples a call, {used} workers; "
            f"model alone {model:.1f}, cores alone {alone:.1f}"
        )
        value = round(rate / min(model, alone), 3)
        figures.append(Figure(what, value, "of the limit", at_least=bar, note=note))
        print(figures[-1], file=sys.stderr, flush=True)
    return Result(
        "A run against a slow model",
        figures,
        text=f"""\
The model takes 100 ms plus 2 ms a sample, with at most 8 samples a call; a trial needs {CALLS}
answers. Driver, workers, wire, server and batching are real; the simulation is a busy loop, so that
either side can be the bottleneck. A worker holds {held} trials at once: one computes or loads while
the others wait for answers.""",
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--serve"]:
        serve(float(sys.argv[2]), float(sys.argv[3]))
    else:
        main(throughput=measure)
