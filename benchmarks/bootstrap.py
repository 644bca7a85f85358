"""Time of the paper's bootstrap for four models, beside resampling every episode.

python benchmarks/bootstrap.py [--repeat 5] [--json]
"""

from __future__ import annotations

import time
from collections.abc import Callable

from frame import Figure, Result, main

from robospa.results.paper.published import LEVELS, load
from robospa.results.statistics import bootstrap, significance
from robospa.results.statistics.samples import RESAMPLES, Sample, draw, rate, resample_episodes


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


def measure(repeat: int = 5) -> Result:
    """All figures of one run."""
    data = load()
    models: list[list[Sample]] = [
        [
            rate(round(values[place]), data.trials)
            for values in data.per_task[model, "sr"].rows.values()
            for place in range(len(LEVELS))
        ]
        for model in data.models
    ]
    count, table = len(models[0]), [list(row) for row in zip(*models, strict=True)]
    share = [1 / count] * count
    few = RESAMPLES // 100
    first, best = seconds(lambda: [draw(samples, share) for samples in models], repeat)
    part = seconds(lambda: [resample_episodes(m, share, resamples=few) for m in models], 1)[1]
    marks = seconds(lambda: significance.supported_best(table), repeat)[1]
    size = f"{len(models)} models x {count} variants x {RESAMPLES:,}"
    figures = [
        Figure(f"the paper's bootstrap: {size}", round(best, 3), "s", at_most=0.5,
            note=f"the first time {first:.3f} s"),
        Figure("the same episode by episode", round(100 * part, 1), "s",
            note=f"from {few} resamples"),
        Figure(f"marks of the best in {count} rows", round(marks, 4), "s"),
    ]  # fmt: skip
    return Result("Statistics", figures)


if __name__ == "__main__":
    main(bootstrap=measure)
