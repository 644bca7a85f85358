"""Parallel efficiency: `robospa eval` with 1, 2, ... workers against one server of a still policy.

    python benchmarks/parallel.py [--workers 1,2] [--trials 12] [--json]

Nothing is drawn and the policy costs nothing, so the simulator is the bottleneck. For every number
of workers the run is done with `--trials` and with three times as many trials: the difference is
free of the time that processes take to start. Efficiency is the rate per worker beside that of one
worker; independent runs of one worker at once say how much of the loss is the machine's.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from frame import Figure, Result, main

COMMAND = [sys.executable, "-m", "robospa"]


def evaluate(url: str, folder: Path, trials: int, workers: int) -> subprocess.Popen[bytes]:
    """Start an evaluation of `trials` trials of one variant."""
    words = f"eval {url} --tasks Pick_Blocks_Size --levels 3 --seeds 100000-{99_999 + trials}"
    words += f" --trials {trials} --workers {workers} --video none"
    command = [*COMMAND, *words.split(), "--out", str(folder)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def seconds(url: str, trials: int, workers: int, runs: int) -> float:
    """Wall time [s] of `runs` simultaneous evaluations."""
    with tempfile.TemporaryDirectory() as scratch:
        began = time.perf_counter()
        started = [evaluate(url, Path(scratch) / str(i), trials, workers) for i in range(runs)]
        for process in started:
            if process.wait(timeout=900) != 0:
                raise SystemExit(f"an evaluation ended with {process.returncode}")
        return time.perf_counter() - began


def rate(url: str, trials: int, workers: int, runs: int = 1) -> float:
    """Trials per second once everything runs."""
    short = seconds(url, trials, workers, runs)
    return 2 * trials * runs / (seconds(url, 3 * trials, workers, runs) - short)


def measure(workers: str = "1,2", trials: int = 12) -> Result:
    """All figures of one run."""
    counts = [int(word) for word in workers.split(",")]
    most = max(counts)
    command = [*COMMAND, "serve", "hold", "--port", "0"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    try:
        found = next(filter(None, (re.search(r"ws://\S+?:\d+", x) for x in server.stdout)), None)
        if found is None:
            raise SystemExit("the server ended before it listened")
        rates = {n: rate(found.group(), trials * n, n) for n in counts}
        alone = rate(found.group(), trials, 1, runs=most)
    finally:
        server.terminate()
        server.wait(10)
    one = rates[min(counts)] / min(counts)
    figures = [
        Figure(f"{n} workers, of {n} times one worker", round(rates[n] / n / one, 3), at_least=0.9)
        for n in counts
        if n > min(counts)
    ]
    beside = f"{most} workers beside {most} independent runs at once"
    figures += [Figure(beside, round(rates[most] / alone, 3))]
    figures += [Figure(f"{n} workers", round(rates[n], 2), "trials/s") for n in counts]
    return Result(
        "Parallel efficiency",
        figures,
        text="The driver and the server share the cores with the workers; runs that know nothing "
        "of each other say what the cores themselves give.",
    )


if __name__ == "__main__":
    main(parallel=measure)
