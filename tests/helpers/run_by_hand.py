"""Runs on disk, written by hand: what the tests of comparison and lint read."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fake_records import trial_record

from robospa.results.records.run_io import Run, read_run, to_line
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.scene import SUITE
from robospa.trial import TrialKey

CATEGORIES = {"Pick_Blocks_Size": "GAC", "Pick_Mugs_Distance": "SDE", "Put_Bottles_Dustbin": "OFE"}


def record(
    task: str, level: int, seed: int, done: int, total: int = 1, **other: Any
) -> TrialRecord:
    """A believable result."""
    success = done == total
    name = f"{task}{level}{seed}"
    made = trial_record(
        TrialKey(task, level, seed),
        success,
        category=CATEGORIES.get(task, "GAC"),
        scene_digest=f"scene {name}",
        done=done,
        best=done,
        total=total,
        candidates=level + 1,
        steps=10,
        physics_steps=1000,
        policy_calls=2,
        digest=f"end {name} {done} {other.pop('who', '')}",
        actions_digest=f"actions {name} {done}",
        wall_time=3.0,
    )
    return replace(made, **other)


def outcomes(task: str, level: int, successes: Iterable[int], **other: Any) -> list[TrialRecord]:
    """One record per 0 or 1, on seeds from 0."""
    return [record(task, level, seed, done, **other) for seed, done in enumerate(successes)]


def write(
    folder: Path,
    records: Sequence[TrialRecord],
    also_listed: Sequence[TrialKey] = (),
    **settings: Any,
) -> Run:
    """A run of these records in `folder`, read back."""
    (folder / "trials").mkdir(parents=True)
    (folder / "trials" / "0000.jsonl").write_text("".join(to_line(r) for r in records))
    rows = [
        {
            "task": k.task,
            "level": k.level,
            "embodiment": k.embodiment,
            "mode": k.mode,
            "split": k.split,
            "seeds": [k.seed],
        }
        for k in [*dict.fromkeys(r.key for r in records), *also_listed]
    ]
    known = {"suite": SUITE, "categories": CATEGORIES, "about": {}}
    manifest = {"trials": rows, **known, **settings}
    (folder / "run.json").write_text(json.dumps(manifest))
    return read_run(folder)
