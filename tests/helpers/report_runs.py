"""Small runs written by hand, with text that must stay text, and a film."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from fake_records import trial_record

from robospa.results.records.run_io import Run, read_run, to_line
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.scene import SUITE
from robospa.trial import TrialKey

EVIL = "<script>alert(1)</script>"
CATEGORY_OF = {"Pick_Blocks_Size": "GAC", "Press_Stapler_Repeat": "RPF"}


def record(task: str, level: int, seed: int, success: bool, **changes: object) -> TrialRecord:
    made = trial_record(
        TrialKey(task, level, seed),
        success,
        category="GAC" if task.startswith("Pick") else "RPF",
        instruction="take it",
        total=1 if task.startswith("Pick") else 2,
        candidates=4,
        steps=10,
        physics_steps=500,
        policy_calls=2,
        wall_time=2.0,
        latency={"p50": 5.0, "p95": 6.0, "p99": 7.0, "max": 8.0},
        timing={"physics": 1.0, "waiting": 0.5},
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def make_run(folder: Path, records: list[TrialRecord], lost: int = 0) -> Run:
    """A run on disk with `records`, and `lost` more listed trials of the first variant."""
    rows = [
        {
            "task": r.key.task,
            "level": r.key.level,
            "embodiment": r.key.embodiment,
            "mode": r.key.mode,
            "split": r.key.split,
            "seeds": [r.key.seed],
        }
        for r in records
    ]
    extra = {**rows[0], "seeds": [900 + n for n in range(lost)]}
    manifest = {
        "settings": {"policy": {"spec": {"name": f"model {EVIL}"}}, "privileged": False},
        "categories": {**CATEGORY_OF, "Pick_It": "GAC", "Press_It": "RPF"},
        "suite": SUITE,
        "trials": [*rows, extra],
        "about": {"versions": {"robospa": "1.0"}},
    }
    (folder / "trials").mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps(manifest))
    (folder / "trials" / "0000.jsonl").write_text("".join(map(to_line, records)))
    return read_run(folder)


RECORDS = [record("Pick_It", 1, n, n < 3) for n in range(4)] + [
    record("Press_It", 2, n, False, done=1, message=EVIL) for n in range(2)
]
KNOWN = [record("Pick_Blocks_Size", 1, n, n < 3, candidates=2) for n in range(4)] + [
    record("Press_Stapler_Repeat", 2, n, False, done=1, message=EVIL, instruction=EVIL)
    for n in range(2)
]


def write_film(path: Path, seconds: int) -> None:
    """A film of grey frames, ten a second."""
    import av

    with av.open(str(path), "w") as file:
        stream: Any = file.add_stream("libx264", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for number in range(10 * seconds):
            image = np.full((48, 64, 3), 2 * number, np.uint8)
            file.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        file.mux(stream.encode())
