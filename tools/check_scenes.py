"""Look at thousands of scenes of every variant, without a simulator.

    python tools/check_scenes.py --scenes 10000 --out build/scenes.json [--tasks A,B] [--levels 1]
    python tools/check_scenes.py --scenes 2000 --mode randomized --out build/randomized.json

Every scene is built once and all rules of `tools/scene_checks.py` are asked: no overlap, all
in view, all in reach, one answer, neutral names. What was drawn for the question (ranks, rows,
directions, colours, which object) is counted: `off` is how far the rarest or commonest value is
from an even share. A variant that is in the file with as many scenes is not looked at again, so the
command can be stopped and repeated. Ends with 1 if a rule is broken anywhere.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from typing import Any

from rich.progress import track

from robospa.harness.pool import JobProcess, Pool
from robospa.harness.selection import parse_levels, parse_tasks
from robospa.tasks import catalog

Job = tuple[str, int, int, str]
"""Task, level, number of scenes and scene mode."""
FIRST_SEED = 10_000_000
"""Seeds that nothing was ever tuned on."""
SHOWN = 5
"""Broken scenes that are named, for each variant."""


def look(name: str, level: int, scenes: int, mode: str) -> dict[str, Any]:
    """The findings in `scenes` scenes of one variant in a scene mode."""
    from scene_answers import drawn
    from scene_checks import RULES

    start_time = time.process_time()
    broken: Counter[str] = Counter()
    examples: list[str] = []
    values: dict[str, Counter[str]] = {}
    refused = 0
    for seed in range(FIRST_SEED, FIRST_SEED + scenes):
        try:
            scene = catalog.build_scene(name, level, seed, mode=mode)
        except RuntimeError:  # LayoutError is one: the seed is not valid
            refused += 1
            continue
        for key, value in drawn(scene).items():
            values.setdefault(key, Counter())[str(value)] += 1
        for rule, check in RULES.items():
            for text in check(scene):
                broken[rule] += 1
                if len(examples) < SHOWN:
                    examples.append(f"seed {seed}: {text}")
    return {
        "task": name,
        "level": level,
        "mode": mode,
        "scenes": scenes,
        "refused": refused,
        "broken": dict(broken),
        "examples": examples,
        "drawn": {key: dict(sorted(counts.items())) for key, counts in values.items()},
        "seconds": round(time.process_time() - start_time, 1),
    }


def looker(_: None) -> Callable[[Job], dict[str, Any]]:
    """`look` in a process of its own."""
    return lambda job: look(*job)


def off(counts: dict[str, int]) -> float:
    """Largest deviation of a value's frequency from an even share, relative to that share."""
    even = sum(counts.values()) / len(counts)
    return max(abs(count - even) for count in counts.values()) / even


def main() -> int:
    """Look at what is not in the file yet and sum up."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=10_000)
    parser.add_argument("--tasks", default="all,basic")
    parser.add_argument("--levels", default="1-5")
    parser.add_argument("--mode", default="clean")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("build/scenes.json"))
    arguments = parser.parse_args()
    known = json.loads(arguments.out.read_text()) if arguments.out.exists() else []
    rows = {
        (r["task"], r["level"]): r
        for r in known
        if r["scenes"] >= arguments.scenes and r.get("mode", "clean") == arguments.mode
    }
    names = parse_tasks(arguments.tasks)
    wanted = [(name, level) for level in parse_levels(arguments.levels) for name in names]
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    from check_scenes import looker  # by the name that its process finds it by

    start = partial(JobProcess, looker, None, name="scenes")
    with Pool[Job, dict[str, Any]](start, arguments.workers) as pool:
        jobs = [
            pool.submit((*v, arguments.scenes, arguments.mode)) for v in wanted if v not in rows
        ]
        for job in track(as_completed(jobs), total=len(jobs), description="variants"):
            row = job.result()
            rows[row["task"], row["level"]] = row
            later = arguments.out.with_suffix(".tmp")
            later.write_text("[\n" + ",\n".join(json.dumps(r) for r in rows.values()) + "\n]\n")
            later.replace(arguments.out)
    return summary([rows[v] for v in wanted])


def summary(rows: list[dict[str, Any]]) -> int:
    """Print what stands out; 1 if a rule is broken."""
    total = sum(r["scenes"] for r in rows)
    broken = [r for r in rows if r["broken"]]
    for row in broken:
        print(row["task"], row["level"], row["broken"], *row["examples"], sep="\n    ")
    uneven = [
        (off(counts), r["task"], r["level"], key, counts)
        for r in rows
        for key, counts in r["drawn"].items()
    ]
    print("\nfarthest from even shares:")
    for share, *where, counts in sorted(uneven, key=lambda u: -u[0])[:20]:
        print(f"{100 * share:6.1f} %", *where, counts if len(counts) < 9 else "")
    refused = sum(r["refused"] for r in rows)
    seconds = sum(r["seconds"] for r in rows)
    print(
        f"\n{total} scenes of {len(rows)} variants, {refused} seeds refused, "
        f"{sum(sum(r['broken'].values()) for r in rows)} rules broken in {len(broken)} variants, "
        f"{1000 * seconds / total:.2f} ms of CPU a scene"
    )
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
