"""Parallel efficiency: `robospa eval` with 1, 2, ... workers against one server of a still policy.

    python benchmarks/parallel.py [--workers 1,2] [--trials 12] [--json]

Nothing is drawn and the policy costs nothing, so the simulator is the bottleneck. For every number
of workers the run is done with `--trials` and with three times as many trials: the difference is
free of the time that processes take to start. Efficiency is the rate per worker beside that of one
worker; where the cores share caches or clock, `alone` (as many independent runs of one worker at
once) says how much of the loss is the machine's.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import Metric, Result, argument_parser, finish

COMMAND = [sys.executable, "-c", "from robospa.harness.cli.main import main; main()"]
FIRST_SEED = 100_000


def evaluate(url: str, folder: Path, trials: int, workers: int) -> subprocess.Popen[bytes]:
    """Start an evaluation of `trials` trials of one variant."""
    seeds = f"{FIRST_SEED}-{FIRST_SEED + trials - 1}"
    words = ["eval", url, "--tasks", "Pick_Blocks_Size", "--levels", "3", "--seeds", seeds]
    words += ["--trials", str(trials)]
    words += ["--workers", str(workers), "--video", "none", "--out", str(folder)]
    return subprocess.Popen([*COMMAND, *words], stdout=subprocess.DEVNULL)


def seconds(url: str, scratch: Path, trials: int, workers: int, runs: int) -> float:
    """Wall time [s] of `runs` simultaneous evaluations."""
    began = time.perf_counter()
    started = [
        evaluate(url, scratch / f"{workers}-{trials}-{runs}-{i}-{began}", trials, workers)
        for i in range(runs)
    ]
    for process in started:
        if process.wait(timeout=900) != 0:
            raise SystemExit(f"an evaluation ended with {process.returncode}")
    return time.perf_counter() - began


def rate(url: str, scratch: Path, trials: int, workers: int, runs: int = 1) -> float:
    """Trials per second once everything runs."""
    short = seconds(url, scratch, trials, workers, runs)
    long = seconds(url, scratch, 3 * trials, workers, runs)
    return 2 * trials * runs / (long - short)


def main() -> None:
    """Measure and print."""
    parser = argument_parser(__doc__)
    parser.add_argument("--workers", default="1,2")
    parser.add_argument("--trials", type=int, default=12)
    options = parser.parse_args()
    counts = [int(w) for w in options.workers.split(",")]
    server = subprocess.Popen(
        [*COMMAND, "serve", "hold", "--port", "0"], stdout=subprocess.PIPE, text=True
    )
    try:
        assert server.stdout is not None
        found = None
        while found is None:
            line = server.stdout.readline()
            if not line:
                raise SystemExit("the server ended before it listened")
            found = re.search(r"ws://\S+?:\d+", line)
        url = found.group(0)
        with tempfile.TemporaryDirectory() as scratch:
            rates = {n: rate(url, Path(scratch), options.trials * n, n) for n in counts}
            most = max(counts)
            alone = rate(url, Path(scratch), options.trials, 1, runs=most)
    finally:
        server.terminate()
        server.wait(10)
    one = rates[min(counts)] / min(counts)
    rows = [
        Metric(f"{n} workers, of {n} times one worker", round(rates[n] / n / one, 3), at_least=0.9)
        for n in counts
        if n > min(counts)
    ]
    rows.append(
        Metric(
            f"{most} workers beside {most} independent runs at once", round(rates[most] / alone, 3)
        )
    )
    rows += [Metric(f"{n} workers", round(rates[n], 2), "trials/s") for n in counts]
    text = (
        "The driver and the server share the cores with the workers; runs that know nothing of "
        "each other say what the cores themselves give."
    )
    finish(Result("parallel", "Parallel efficiency", tuple(rows), text=text), options)


if __name__ == "__main__":
    main()
