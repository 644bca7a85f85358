"""Records and runs without a simulator: the one builder for all tests."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import to_builtins

from robospa.results.records.manifest import RunManifest, trial_groups
from robospa.results.records.runs import Run, finished, read_file, read_records, to_line
from robospa.results.records.trial_record import TrialRecord
from robospa.results.run import LoadedRun, load_run
from robospa.schema import read
from robospa.tasks.scene import SUITE
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Fake", 1, 100000)
EVIL = "<script>alert(1)</script>"
CATEGORIES = {
    "Pick_Blocks_Size": "GAC",
    "Pick_Mugs_Distance": "SDE",
    "Put_Bottles_Dustbin": "OFE",
    "Press_Stapler_Repeat": "RPF",
    "Pick_It": "GAC",
    "Press_It": "RPF",
}


def trial_record(key: TrialKey = KEY, success: bool = False, **fields: Any) -> TrialRecord:
    """The record of a short trial of one subtask, with some of its fields given."""
    made = TrialRecord(
        key=key,
        category="GAC",
        instruction="go",
        scene_digest="",
        end="success" if success else "step_limit",
        success=success,
        done=int(success),
        best=int(success),
        total=1,
        candidates=2,
        steps=1,
        physics_steps=50,
        policy_calls=1,
        digest="",
        actions_digest="",
        wall_time=1.0,
    )
    return replace(made, **fields)


RECORD = trial_record(
    success=True,
    instruction="pick “it”",
    scene_digest="s",
    steps=3,
    physics_steps=15,
    digest="d",
    actions_digest="a",
    wall_time=0.5,
    events=({"time": 0.1, "kind": "success", "object": "", "index": -1, "note": ""},),
    latency={"p50": 1.0},
)


def other(seed: int) -> TrialRecord:
    return replace(RECORD, key=replace(KEY, seed=seed))


def record(
    task: str, level: int, seed: int, done: int, total: int = 1, **other: Any
) -> TrialRecord:
    """A believable result: `done` of `total` subtasks."""
    name = f"{task}{level}{seed}"
    fields = {
        "category": CATEGORIES.get(task, "GAC"),
        "scene_digest": f"scene {name}",
        "done": done,
        "best": done,
        "total": total,
        "candidates": level + 1,
        "steps": 10,
        "physics_steps": 1000,
        "policy_calls": 2,
        "digest": f"end {name} {done} {other.pop('who', '')}",
        "actions_digest": f"actions {name} {done}",
        "wall_time": 3.0,
    }
    return trial_record(TrialKey(task, level, seed), done == total, **{**fields, **other})


def outcomes(task: str, level: int, successes: Iterable[int], **other: Any) -> list[TrialRecord]:
    """One record per 0 or 1, on seeds from 0."""
    return [record(task, level, seed, done, **other) for seed, done in enumerate(successes)]


def shown(task: str, level: int, seed: int, success: bool, **changes: Any) -> TrialRecord:
    """A result with all that a report shows: latency, timing, an instruction."""
    fields = {
        "category": "GAC" if task.startswith("Pick") else "RPF",
        "instruction": "take it",
        "total": 1 if task.startswith("Pick") else 2,
        "candidates": 4,
        "steps": 10,
        "physics_steps": 500,
        "policy_calls": 2,
        "wall_time": 2.0,
        "latency": {"p50": 5.0, "p95": 6.0, "p99": 7.0, "max": 8.0},
        "timing": {"physics": 1.0, "waiting": 0.5},
    }
    return trial_record(TrialKey(task, level, seed), success, **{**fields, **changes})


RECORDS = [shown("Pick_It", 1, n, n < 3) for n in range(4)] + [
    shown("Press_It", 2, n, False, done=1, message=EVIL) for n in range(2)
]
KNOWN = [shown("Pick_Blocks_Size", 1, n, n < 3, candidates=2) for n in range(4)] + [
    shown("Press_Stapler_Repeat", 2, n, False, done=1, message=EVIL, instruction=EVIL)
    for n in range(2)
]


def events(*rows: Sequence[Any]) -> tuple[dict[str, Any], ...]:
    """Time, kind, object, index and note of each event, of which the last may be left out."""
    names, usual = ("time", "kind", "object", "index", "note"), ("", -1, "")
    return tuple(
        {**dict(zip(names, (*row, *usual[len(row) - 2 :]), strict=True)), "step": 3} for row in rows
    )


def run_of(records: Iterable[TrialRecord], name: str = "run", **manifest: Any) -> Run:
    """A run of these records that lies in no folder; `manifest` are entries of its run.json."""
    found = {record.key: record for record in records}
    return Run(Path(name), read(RunManifest, manifest, name), tuple(found), found)


def write(
    folder: Path,
    records: Sequence[TrialRecord],
    also_listed: Sequence[TrialKey] = (),
    **changes: Any,
) -> LoadedRun:
    """A run of these records in `folder`, read back; `changes` are entries of its run.json."""
    (folder / "trials").mkdir(parents=True)
    (folder / "trials" / "0000.jsonl").write_text("".join(to_line(r) for r in records))
    keys = [*dict.fromkeys(r.key for r in records), *also_listed]
    listed = {"trials": to_builtins(trial_groups(keys)), "categories": CATEGORIES}
    data = {**listed, "suite": SUITE, "about": {}, **changes}
    (folder / "run.json").write_text(json.dumps(data))
    return load_run(folder)


def make_run(
    folder: Path,
    records: Sequence[TrialRecord],
    lost: int = 0,
    settings: Mapping[str, Any] | None = None,
    **changes: Any,
) -> LoadedRun:
    """A run with text that must stay text, and `lost` more listed trials of the first variant."""
    more = [replace(records[0].key, seed=900 + n) for n in range(lost)]
    said = {"policy": {"spec": {"name": f"model {EVIL}"}}, **(settings or {})}
    about = {"versions": {"robospa": "1.0"}}
    return write(folder, records, more, **{"settings": said, "about": about, **changes})


def lines(folder: Path) -> list[TrialRecord]:
    """All records on disk, those of losses too."""
    files = sorted((folder / "trials").glob("*.jsonl"))
    return [record for file in files for record in read_file(file)]


def results(folder: Path) -> list[TrialRecord]:
    """Those of them that count."""
    return [record for record in lines(folder) if finished(record)]


def digests(folder: Path) -> dict[TrialKey, tuple[str, str]]:
    """How every trial of a run ended, and by which actions."""
    return {k: (r.digest, r.actions_digest) for k, r in read_records(folder).items()}


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
