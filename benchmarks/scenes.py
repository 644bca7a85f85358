"""Time to build a scene: p50, p99 and the longest, for every variant.

    python benchmarks/scenes.py [--scenes 1000] [--first 200] [--tasks A,B] [--levels 1,5] [--json]

CPU time of `build_scene` alone, without simulator, after WARM scenes that fill the caches: a task's
layout pool and the models of an object's looks are made once per process; "first" says what the
first scene costs. The bar is 5 ms at the 99th percentile. Every variant builds `--first` scenes;
those whose p99 lies above half the bar build `--scenes`. Draws are bounded everywhere: a seed that
finds no layout is refused with LayoutError or RuntimeError and counted here, never tried for ever.
"""

from __future__ import annotations

import gc
import time

import numpy as np
from common import Json, Metric, Result, argument_parser, finish

from robospa.tasks import catalog

FIRST_SEED = 500_000
WARM = 100
BAR = 5.0
SHOWN = 12


def measure(name: str, level: int, scenes: int) -> Json:
    """Milliseconds of CPU per scene of one variant."""
    start_time = time.process_time()
    catalog.build_scene(name, level, FIRST_SEED - 1)
    first = 1000 * (time.process_time() - start_time)
    for seed in range(FIRST_SEED - WARM, FIRST_SEED - 1):
        catalog.build_scene(name, level, seed)
    spent, refused = [], 0
    for seed in range(FIRST_SEED, FIRST_SEED + scenes):
        start_time = time.process_time()
        try:
            catalog.build_scene(name, level, seed)
        except RuntimeError:  # LayoutError is one
            refused += 1
        spent.append(1000 * (time.process_time() - start_time))
    p50, p99 = (float(v) for v in np.percentile(spent, [50, 99]))
    return {
        "task": name,
        "level": level,
        "scenes": scenes,
        "p50": p50,
        "p99": p99,
        "max": max(spent),
        "first": first,
        "refused": refused,
    }


def result(found: list[Json]) -> Result:
    """The figures of all variants."""
    found = sorted(found, key=lambda row: -row["p99"])
    over = sum(row["p99"] >= BAR for row in found)
    slow, middle = found[0], float(np.median([row["p50"] for row in found]))
    first = max(found, key=lambda row: row["first"])
    rows = [
        Metric(f"variants with p99 of {BAR:g} ms or more", over, f"of {len(found)}", at_most=0),
        Metric("slowest variant: p99", round(slow["p99"], 2), "ms",
            note=f"{slow['task']} level {slow['level']}, of {slow['scenes']} scenes"),
        Metric("median variant: p50", round(middle, 2), "ms"),
        Metric("slowest first scene of a process", round(first["first"], 0), "ms",
            note=f"{first['task']} level {first['level']}: its pool of layouts"),
        Metric("seeds refused", sum(row["refused"] for row in found),
            f"of {sum(row['scenes'] for row in found):,}"),
    ]  # fmt: skip
    rows += [
        Metric(f"{row['task']} level {row['level']}: p99", round(row["p99"], 2), "ms",
            note=f"p50 {row['p50']:.2f}, longest {row['max']:.2f}")
        for row in found[:SHOWN]
    ]  # fmt: skip
    data = {f"{r['task']} {r['level']}": [round(r[k], 3) for k in ("p50", "p99")] for r in found}
    text = "A scene is a value, built without simulator. The slowest variants are listed."
    return Result("scenes", "Building scenes", tuple(rows), text=text, data={"p50, p99": data})


def main() -> None:
    """Measure and print."""
    parser = argument_parser(__doc__)
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--first", type=int, default=200)
    parser.add_argument("--tasks", default="", help="comma separated; default all")
    parser.add_argument("--levels", default="1,2,3,4,5")
    options = parser.parse_args()
    names = [w for w in options.tasks.split(",") if w] or list(catalog.tasks())
    levels = [int(n) for n in options.levels.split(",")]
    gc.disable()  # its pauses belong to no scene
    found = []
    for name in names:
        for level in levels:
            row = measure(name, level, options.first)
            if row["p99"] > BAR / 2:
                row = {**measure(name, level, options.scenes), "first": row["first"]}
            found.append(row)
    finish(result(found), options)


if __name__ == "__main__":
    main()
