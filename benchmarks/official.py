"""What objects of the official archive cost beside built-in ones: loading, and physics steps.

    python benchmarks/official.py [--assets DIR] [--json]

Without `--assets` a made-up archive of the official names, sizes and frames is measured
(tests/helpers/made_archive.py). Every variant is loaded once, each model anew from the cache on
disk; then the expert's trials of some variants are run with both kinds of objects. CPU time.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from frame import Figure, Result, main
from made_archive import make_archive

from robospa.harness.factory import policy_factory
from robospa.harness.official.layout import OfficialLayout, official_world_parts
from robospa.harness.official.official_world import OfficialWorld
from robospa.harness.packs.archive import VARIABLE
from robospa.harness.seeds.attempt import ORACLE
from robospa.harness.trial import run_trial
from robospa.harness.world import SceneUnstable
from robospa.tasks import packs
from robospa.tasks.catalog import LEVELS
from robospa.tasks.official import needs
from robospa.trial import TrialKey

SEED = 100_000


def load_all(world: OfficialWorld, layout: OfficialLayout) -> tuple[list[float], int]:
    """CPU seconds of each of the variants that settle, scene and goal included, and how many do
    not."""
    pack: Any = packs.pack("official")
    spent, unstable = [], 0
    for task in needs():
        for level in LEVELS:
            pack._made.cache_clear()
            began = time.thread_time()
            try:
                world.load(official_world_parts(TrialKey(task, level, SEED), layout, {}).scene)
                spent.append(time.thread_time() - began)
            except SceneUnstable:
                unstable += 1
    return spent, unstable


def run_all(layout: OfficialLayout, keys: list[TrialKey]) -> tuple[float, int]:
    """CPU seconds of a physics step in the expert's trials, planning included, and successes."""
    world, policy = OfficialWorld(render=False), policy_factory(ORACLE)()
    parts: Callable[..., Any] = partial(official_world_parts, layout=layout, episodes={})
    steps = successes = 0
    began = time.thread_time()
    for key in keys:
        record = run_trial(world, policy, key, policy_seed=0, parts=parts)
        steps += record.physics_steps
        successes += record.success
    return (time.thread_time() - began) / steps, successes


def measure(assets: str = "", trials: int = 20) -> Result:
    """Both kinds of objects; `trials` about so many of the expert."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("ROBOSPA_CACHE", folder)
        os.environ[VARIABLE] = assets or str(make_archive(Path(folder) / "assets"))
        official, builtin = OfficialLayout(True, "all"), OfficialLayout(False, "all")
        world = OfficialWorld()
        load_all(world, official)  # fills the cache
        spent, unstable = load_all(world, official)
        ours, _ = load_all(world, builtin)
        names = [name for name, used in needs().items() if used]
        keys = [TrialKey(name, 5, SEED) for name in names[:: max(1, len(names) // trials)]]
        run_all(official, keys[:1])
        step, solved = run_all(official, keys)
        plain, _ = run_all(builtin, keys)
    times, others = (1e3 * np.array(values) for values in (spent, ours))
    figures = [
        Figure("loading a scene, the slowest", round(float(times.max()), 1), "ms", at_most=150),
        Figure("loading a scene, the median", round(float(np.median(times)), 1), "ms",
            note=f"built-in objects: {np.median(others):.1f} ms, {others.max():.1f} at most"),
        Figure("variants that do not settle", unstable, "", at_most=0, note=f"of {len(times)}"),
        Figure("a physics step in the expert's trials, beside built-in objects",
            round(step / plain, 2), "x", at_most=2,
            note=f"{1e6 * step:.0f} and {1e6 * plain:.0f} us, planning included"),
        Figure("trials that the expert solves", solved, f"of {len(keys)}"),
    ]  # fmt: skip
    return Result(
        "Objects of the official archive",
        figures,
        text="""\
`--world official` takes objects from an archive ([the official world](official-world.md)): here
from a made-up one with the official names, sizes and frames, but smaller meshes. Visual and
collision models are made from its files once and kept; loading reads these.""",
        circumstances=f"{len(times)} variants loaded once with a renderer, models from the cache "
        f"on disk; {len(keys)} trials at level 5; CPU time",
    )


if __name__ == "__main__":
    main(official=measure)
