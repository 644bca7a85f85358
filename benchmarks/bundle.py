"""Size and verification time of a bundle of the whole benchmark: 280 variants, 28,000 trials.

    python benchmarks/bundle.py [--trials 100] [--noise 0.001] [--out FOLDER]

Tasks, step limits and subtasks are the catalog's; seeds, records and actions are synthetic. Actions
are rest-to-rest reaches of one arm after the other, about 25 actions each, answered in chunks of 50
with the jitter of a learned policy on top: white noise of `--noise` rad on every number, which no
method compresses, rounded to the grid of executed actions. A fifth of the trials succeed, half way
to the step limit on average; the others use it up. Prints sizes by kind of file, the time of level
1 without making scenes again, and what the real scenes of a few seeds of every variant take.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import resource
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.categories import CATEGORIES
from robospa.harness.quantize import quantize
from robospa.harness.running.manifest import about_machine, group_keys, seed_hash
from robospa.harness.sim.motion import RATE
from robospa.harness.trial import task_parts
from robospa.harness.trial_identity import policy_seed
from robospa.harness.worlds import SAPIEN_NAME, TASK_PARTS
from robospa.leaderboard.card import to_card
from robospa.leaderboard.evidence import announced
from robospa.leaderboard.packing import sizes_of, write_bundle
from robospa.leaderboard.rules import Reference, first_wrong, shipped
from robospa.leaderboard.traces import durations
from robospa.leaderboard.trial_rows import trace_hash
from robospa.leaderboard.verify import verify
from robospa.results.records.run_io import Run
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import tasks
from robospa.tasks.seeds import accepted
from robospa.trial import TrialKey

REACH = 25
"""Actions of one reach."""
FILM = 60_000
"""Bytes of a video, as measured for trials of a minute."""
CARD: dict[str, Any] = {
    "name": "Synthetic",
    "team": "benchmarks/bundle.py",
    "licence": "MIT",
    "parameters": 0,
    "link": "https://example.org",
    "training": {"tasks": "multi", "scenes": "clean", "demonstrations": [50] * 5},
    "actions": {"space": "joint", "chunk": 50, "rate": 50.0},
    "checkpoints": {"all": {"reference": "https://example.org", "sha256": "0" * 64}},
}


def actions(random: np.random.Generator, count: int, noise: float) -> NDArray[np.float32]:
    """`count` actions, float32 (count, 14)."""
    reaches = -(-count // REACH) + 1
    goals = np.cumsum(random.normal(0, 0.3, (reaches + 1, 14)), axis=0)
    goals[:, (6, 13)] = random.integers(0, 2, (reaches + 1, 2))
    still = np.arange(reaches + 1) % 2 == 0
    goals[1:, :7][still[1:]] = goals[:-1, :7][still[1:]]
    goals[1:, 7:][~still[1:]] = goals[:-1, 7:][~still[1:]]
    s = np.linspace(0, 1, REACH, endpoint=False)
    blend = (10 * s**3 - 15 * s**4 + 6 * s**5)[:, None]
    path = (goals[:-1, None] + blend * (goals[1:, None] - goals[:-1, None])).reshape(-1, 14)
    jitter = random.normal(0, noise, (count, 14))
    return (np.clip(path[:count], -3, 3) + jitter).astype(np.float32)


class Traces:
    """The synthetic actions of every trial, made when asked for."""

    def __init__(self, steps: dict[TrialKey, int], noise: float) -> None:
        self._steps, self._noise = steps, noise

    def __call__(self, key: TrialKey) -> NDArray[np.float32]:
        seed = [int.from_bytes(hashlib.sha256(key.slug.encode()).digest()[:8], "big")]
        return quantize(actions(np.random.default_rng(seed), self._steps[key], self._noise))


def parts(key: TrialKey) -> SimpleNamespace:
    """A made-up scene and sentence."""
    name = hashlib.sha256(key.slug.encode()).hexdigest()
    sentence = f"Pick up the block that is the {name[:12]}, then put it where it belongs."
    return SimpleNamespace(scene=SimpleNamespace(digest=name[:16]), instruction=sentence)


def record(
    key: TrialKey, facts: Any, actions: NDArray[np.float32], success: bool, digest: str
) -> TrialRecord:
    """A record of realistic length."""
    total, name = facts.subtasks, hashlib.sha256(key.slug.encode()).hexdigest()
    steps, physics = len(actions), int(durations(key.embodiment, "joint", actions)[0].sum())
    done = total if success else int(name[0], 16) % total
    kinds = [("approached", -1), ("closed", -1), ("grasped", -1), ("approached", -1)]
    kinds += [("subtask_done", n) for n in range(done)] + [("success", -1)] * success
    seen = [
        {"time": physics / RATE * n / len(kinds), "kind": kind, "object": "object_3"}
        | {"index": index, "note": "", "step": steps * n // len(kinds)}
        for n, (kind, index) in enumerate(kinds, 1)
    ]
    found = parts(key)
    return TrialRecord(
        key=key,
        category=facts.category,
        instruction=found.instruction,
        scene_digest=found.scene.digest,
        end="success" if success else "step_limit",
        success=success,
        done=done,
        best=done,
        total=total,
        candidates=facts.candidates,
        steps=steps,
        physics_steps=physics,
        policy_calls=steps // 50 + 1,
        digest=name,
        actions_digest=digest,
        wall_time=1e-3 * (physics + steps),
        policy_seed=policy_seed(key),
        events=tuple(seen),
        latency=dict.fromkeys(("p50", "p95", "p99", "max"), 0.1234567890123456 + steps),
        timing=dict.fromkeys(
            ("loading", "waiting", "recording", "rendering", "goal", "physics"),
            0.0123456789 * steps,
        ),
        diagnostics={"idle_progress": 0.0, "wrong_lifts": 0, "drops": 1, "presses": 3},
    )


def make(path: Path, trials: int, noise: float) -> tuple[Reference, float, int]:
    """Write the bundle; the reference to verify it against, seconds, and bytes of raw actions."""
    seeds = tuple(range(100_000, 100_000 + trials))
    known = [t for t in tasks().values() if t.category in CATEGORIES]
    facts = shipped().facts
    steps, random = {}, np.random.default_rng(0)
    wins: dict[TrialKey, bool] = {}
    for key in (TrialKey(t.name, n, s) for t in known for n in t.levels for s in seeds):
        limit, wins[key] = facts(key.task, key.level).steps, bool(random.random() < 0.2)
        steps[key] = int(limit * random.uniform(0.2, 0.8)) if wins[key] else limit
    traces = Traces(steps, noise)
    keys = sorted(steps)
    spec = {"name": "synthetic", "action": "joint", "horizon": 50, "privileged": False}
    settings = {
        "embodiment": ["aloha-agilex"],
        "mode": ["clean"],
        "split": ["heldout"],
        "policy": {"spec": spec},
        "privileged": False,
        "run_seed": 0,
        "step_scale": 1.0,
        "world": {"name": SAPIEN_NAME, "control": "rest_to_rest"},
    }
    manifest = {
        "format": 1,
        "suite": shipped().suite,
        "settings": settings,
        "seed_hash": seed_hash(keys),
        "categories": {t.name: t.category for t in known},
        "trials": group_keys(keys),
        "about": about_machine({}),
    }
    start_time = time.perf_counter()
    records = {}
    for key in keys:
        made = traces(key)
        own = facts(key.task, key.level)
        records[key] = record(key, own, made, wins[key], trace_hash(made))
    run = Run(path.parent, manifest, tuple(keys), records)
    films = {f"videos/{key.slug}.mp4": b"\0\0\0\x18ftyp" + os.urandom(FILM)
             for key in announced(shipped().suite, keys)}  # fmt: skip
    write_bundle(path, run, to_card(CARD), shipped().suite, traces, films)
    spent = time.perf_counter() - start_time
    whole = shipped()
    reference = Reference(
        lambda task, level, robot, mode: seeds,
        whole.facts,
        whole.members,
        parts="bundle:parts",
        durations=durations,
    )
    return reference, spent, 56 * sum(steps.values())


def main(words: Sequence[str] | None = None) -> None:
    """Print sizes and times."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--noise", type=float, default=0.001)
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as folder:
        path = (chosen.out or Path(folder)) / "bundle.zip"
        reference, spent, raw = make(path, chosen.trials, chosen.noise)
        print(f"made in {spent:.1f} s (actions are made twice)")
        size = path.stat().st_size
        kinds = ", ".join(f"{k} {v / 1e6:.1f}" for k, v in sizes_of(path).items() if v > 1e5)
        print(f"{size / 1e6:.1f} MB: {kinds}; raw actions {raw / 1e6:.1f} MB")
        start_time, cpu = time.perf_counter(), time.process_time()
        valid = verify(path, reference, workers=1)
        wall, cpu = time.perf_counter() - start_time, time.process_time() - cpu
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        print(
            f"level 1 of {len(valid.keys)} trials: {wall:.1f} s ({cpu:.1f} s of processor time, "
            f"{memory:.0f} MB of memory), load {os.getloadavg()[0]:.1f}"
        )
        each = scene_seconds()
        print(f"scenes: {1e3 * each:.1f} ms each, {28_000 * each:.0f} s of processor time for all")


def scene_seconds(seeds: int = 1) -> float:
    """Processor time [s] of making a scene and its sentence, over `seeds` of every variant."""
    keys = [
        TrialKey(task.name, level, seed)
        for task in tasks().values()
        if task.category in CATEGORIES
        for level in task.levels
        for seed in accepted(task.name, level)[:seeds]
    ]
    first_wrong(TASK_PARTS, [(keys[0], "", "")])  # imports
    started = time.process_time()
    for key in keys:
        found = task_parts(key)
        assert found.scene.digest and found.instruction
    return (time.process_time() - started) / len(keys)


if __name__ == "__main__":
    main()
