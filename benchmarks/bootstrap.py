"""Time of the statistics: the paper's bootstrap for four models, marks of its tables, intervals.

    python benchmarks/bootstrap.py [--repeat 5]

The bootstrap is measured against resampling every episode, for the same cells and resamples.
"""

from __future__ import annotations

import argparse
import platform
import time
from collections.abc import Callable

import numpy as np

from robospa.results import bootstrap, significance
from robospa.results.bootstrap import RESAMPLES, Sample, draw, rate, resample_episodes
from robospa.results.intervals import METHODS, interval_of
from robospa.results.published import LEVELS, load


def seconds(work: Callable[[], object], repeat: int) -> tuple[float, float]:
    """Time [s] of the first call with empty caches, and the best of `repeat` later ones."""
    for module in (bootstrap, significance):
        for found in vars(module).values():
            if hasattr(found, "cache_clear"):
                found.cache_clear()
    times = []
    for _ in range(repeat + 1):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return times[0], min(times[1:])


def main() -> None:
    """Print one line a measurement."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=5)
    repeat = parser.parse_args().repeat
    data = load()
    models: dict[str, list[Sample]] = {
        model: [
            rate(round(values[place]), data.trials)
            for values in data.per_task[model, "sr"].rows.values()
            for place in range(len(LEVELS))
        ]
        for model in data.models
    }
    count = len(next(iter(models.values())))
    share = [1 / count] * count
    table = [list(row) for row in zip(*models.values(), strict=True)]
    print(f"{platform.machine()}, Python {platform.python_version()}, numpy {np.__version__}")
    size = f"{len(models)} models x {count} variants"

    def fast() -> None:
        for samples in models.values():
            draw(samples, share)

    def slow() -> None:
        for samples in models.values():
            resample_episodes(samples, share, resamples=RESAMPLES // 100)

    first, best = seconds(fast, repeat)
    print(f"bootstrap, {size} x {RESAMPLES}: first {first:.3f} s, then {best:.3f} s")
    part = seconds(slow, 1)[1]
    print(f"the same by episodes: {100 * part:.0f} s (measured on {RESAMPLES // 100} resamples)")
    for method in METHODS:
        first, best = seconds(lambda m=method: [interval_of([s], method=m) for s in table[0]], 1)
        print(
            f"{method}, {len(models)} cells: first {1e3 * first:.2f} ms, then {1e3 * best:.2f} ms"
        )
    first, best = seconds(lambda: significance.separable(table), repeat)
    print(f"marks of the best in {count} rows: first {first:.3f} s, then {best:.3f} s")


if __name__ == "__main__":
    main()
