"""Runs and bundles that need no simulator, and tools that forge them consistently."""

import json
import tomllib
import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import to_builtins
from run_fakes import FakePolicy, FakeWorld, parts

from robospa.harness.running.manifest import about_machine, write_manifest
from robospa.harness.running.record_store import ActionRecorder, RecordWriter, write_actions
from robospa.harness.sim.motion import RATE
from robospa.harness.trial import policy_seed, run_trial
from robospa.harness.world import ActionError, Poll, StepResult
from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import BundleError, BundleLimits
from robospa.leaderboard.card import to_card
from robospa.leaderboard.rules import Reference, manifest_of, tasks_of
from robospa.leaderboard.verify import verify
from robospa.results.records.manifest import (
    RunAbout,
    RunSettings,
    make_manifest,
    seed_hash,
    trial_groups,
)
from robospa.schema import convert
from robospa.tasks.scene import SUITE
from robospa.tasks.snapshot import Snapshot
from robospa.trial import TrialKey

REFUSED = 99
PICK, PRESS = "Pick_Blocks_Size", "Press_Stapler_Repeat"
SEEDS = tuple(range(100000, 100004))
MEMBERS = {"GAC": (PICK,), "RPF": (PRESS,)}
CARD_TEXT = """
name = "Fake 1"
team = "Nobody"
licence = "MIT"
parameters = 3
link = "https://example.org/fake"
[training]
tasks = "multi"
scenes = "clean"
demonstrations = [50, 50, 50, 50, 50]
[actions]
space = "joint"
chunk = 4
rate = 10.0
[checkpoints.all]
reference = "https://example.org/w"
sha256 = "0000000000000000000000000000000000000000000000000000000000000000"
"""
CARD_DATA: dict[str, Any] = tomllib.loads(CARD_TEXT)
CARD = to_card(CARD_DATA)
FAKES = ["--world", "bundle_fakes:World", "--parts", "run_fakes:parts"]
"""Options of the command line that stand for the fake world."""


class World(FakeWorld):
    """One physics step an action, so that no trial looks too fast; refuses one number."""

    def step(self, action: Any, space: str, poll: Poll) -> StepResult:
        if float(action[1]) == REFUSED:
            raise ActionError(f"left joint 2 is {REFUSED}")
        return StepResult(1, super().step(action, space, poll).stopped)

    def snapshot(self) -> Snapshot:
        return replace(super().snapshot(), time=self.steps / RATE)


class OtherBuild(World):
    """The same outcomes, another last bit."""

    def digest(self) -> str:
        return "other" + super().digest()


class OtherPhysics(World):
    """A world in which nothing succeeds."""

    def step(self, action: Any, space: str, poll: Poll) -> StepResult:
        return super().step(0 * action, space, poll)


class Weak(FakePolicy):
    """Fails at seeds that end in 3, with an action that the world refuses at level 2."""

    def infer(self, observation: Mapping[str, Any]) -> Any:
        assert self.trial is not None
        chunk = super().infer(observation)
        chunk[:, 2:] = self.trial.policy_seed % 997 / 300 + len(self.trial.task)
        if self.last_digit == 3:
            chunk *= 0.01
            if "level 2" in self.trial.instruction and observation["step"] >= 4:
                chunk[1, 1] = REFUSED
        return chunk


class Idle(Weak):
    """The same spec, without a single success."""

    def infer(self, observation: Mapping[str, Any]) -> Any:
        return 0 * super().infer(observation)


def seeds_of(task: str, level: int, embodiment: str, mode: str) -> Sequence[int]:
    if task not in (PICK, PRESS) or level not in range(1, 6):
        raise LookupError(task)
    return SEEDS


REFERENCE = Reference(
    seeds_of,
    tasks_of("run_fakes:parts"),
    lambda category: MEMBERS[category],
    world="bundle_fakes:World",
    parts="run_fakes:parts",
    durations=lambda robot, trace: np.ones(len(trace), int),
)


def all_keys(tasks: Sequence[str] = (PICK,)) -> list[TrialKey]:
    return [TrialKey(t, level, s) for t in tasks for level in range(1, 6) for s in SEEDS]


def make_run(
    folder: Path,
    keys: Sequence[TrialKey] = (),
    policy: FakePolicy | None = None,
    change: Callable[[dict[str, Any], dict[str, Any]], None] = lambda settings, about: None,
    skip: int = 0,
) -> Path:
    """A run of `keys` in the fake world, without its last `skip` trials."""
    keys, policy, world = list(keys) or all_keys(), policy or Weak(), World()
    settings: dict[str, Any] = {
        "embodiment": ("aloha-agilex",),
        "mode": ("clean",),
        "split": ("heldout",),
        "policy": {"spec": policy.spec.to_json(), "dialect": "in process", "options": {}},
        "world": {"name": "bundle_fakes:World"},
    }
    about = to_builtins(about_machine({}))
    about |= {"policy": {"target": "ws://secret:1"}, "arguments": {"token": 1}}
    change(settings, about)
    folder.mkdir(parents=True)
    categories = {key.task: parts(key).task.category for key in keys}
    settled, told = convert(settings, RunSettings), convert(about, RunAbout)
    write_manifest(folder, make_manifest(settled, keys, told, categories, SUITE))
    writer = RecordWriter(folder)
    for key in keys[: len(keys) - skip]:
        recorder = ActionRecorder()
        record = run_trial(
            world, policy, key, policy_seed=policy_seed(key, 0), recorder=recorder, parts=parts
        )
        writer.write(record)
        write_actions(folder, key, recorder.actions, "joint")
    writer.close()
    return folder


Files = dict[str, bytes]


def unzip(path: Path) -> Files:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def zip_up(path: Path, files: Mapping[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name)
            entry.compress_type = method
            entry.external_attr = 0o100644 << 16
            archive.writestr(entry, data)
    return path


def rows_of(files: Files) -> list[dict[str, Any]]:
    return [json.loads(line) for line in files[layout.RECORDS].splitlines()]


def claim_success(row: Any) -> None:
    """Say that the trial of `row` succeeded, and when."""
    record = row["record"]
    at = {"time": record["physics_steps"] / RATE, "step": record["steps"]}
    event = {**at, "kind": "success", "object": "", "index": -1, "note": ""}
    record.update(success=True, end="success", done=2, best=2, message="", events=[event])


def put_rows(files: Files, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write `rows` with a chain that holds."""
    previous = json.loads(files[layout.MANIFEST])["inputs"]
    lines = []
    for row in rows:
        line = json.dumps({**row, "previous": previous}, separators=(",", ":")).encode()
        previous = layout.sha256(line)
        lines.append(line + b"\n")
    files[layout.RECORDS] = b"".join(lines)


def seal(files: Files, **changes: Any) -> Files:
    """Make every hash hold again, as a forger with our code would."""
    manifest = json.loads(files[layout.MANIFEST])
    run = json.loads(files[layout.RUN])
    lines = files[layout.RECORDS].splitlines()
    manifest["files"] = {
        name: {"size": len(data), "sha256": layout.sha256(data)}
        for name, data in files.items()
        if name != layout.MANIFEST
    }
    with suppress(BundleError):  # of a run that is none
        manifest["inputs"] = layout.inputs_hash(manifest_of(run))
    manifest["chain"] = {"rows": len(lines), "last": layout.sha256(lines[-1]) if lines else ""}
    manifest.update(changes)
    manifest["bundle"] = layout.bundle_hash(manifest)
    files[layout.MANIFEST] = layout.canonical(manifest)
    return files


def relist(files: Files, keys: Sequence[TrialKey]) -> None:
    """Say that the run lists `keys`."""
    run = json.loads(files[layout.RUN])
    run["trials"], run["seed_hash"] = to_builtins(trial_groups(keys)), seed_hash(keys)
    files[layout.RUN] = layout.canonical(run)
    manifest = json.loads(files[layout.MANIFEST])
    manifest["inputs"] = layout.inputs_hash(manifest_of(run))
    files[layout.MANIFEST] = layout.canonical(manifest)


ACTIONS = layout.actions_name(PICK, 1)


def refused(path: Path, limits: BundleLimits | None = None) -> str:
    """The one sentence with which the bundle at `path` is refused."""
    with pytest.raises(BundleError) as caught:
        verify(path, REFERENCE, limits=limits)
    text = str(caught.value)
    assert text and "\n" not in text and len(text) < 400
    return text


def edit(files: Files, name: str, change: Callable[[Any], Any]) -> None:
    data = json.loads(files[name])
    files[name] = layout.canonical(change(data) or data)


def edit_row(files: Files, place: int, change: Callable[[Any], None]) -> None:
    rows = rows_of(files)
    change(rows[place])
    put_rows(files, rows)
