"""The official world: its parts, suites, settings, and its 11 seconds."""

from __future__ import annotations

import os
import pickle
from collections.abc import Collection
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from checkouts import write_checkout

from robospa.harness.official import layout as layout_module
from robospa.harness.official import official_world
from robospa.harness.official.layout import (
    BUILTIN_SUITE,
    SUITE,
    OfficialLayout,
    OfficialOptions,
    official_world_parts,
    parse_official,
)
from robospa.harness.official.sentences import SEEN, UNSEEN
from robospa.harness.running import evaluate
from robospa.harness.running.policy_probe import ProbedPolicy
from robospa.harness.running.request import make_request
from robospa.harness.running.worker import load_parts
from robospa.harness.settings import EvaluationSettings, SettingsError, updated
from robospa.harness.trial import task_parts
from robospa.harness.world import SceneUnstable
from robospa.protocol.policy import PolicySpec
from robospa.tasks.scene import SUITE as OURS
from robospa.trial import TrialKey

TASK = "Rank_Blocks_Color"
KEY = TrialKey(TASK, 2, 100000)
BUILTIN = OfficialLayout(False, "all")


def test_without_switches_and_objects_only_the_suite_differs() -> None:
    made = official_world_parts(KEY, OfficialLayout(False, "none"), {})
    plain = task_parts(KEY)
    assert made.instruction == plain.instruction
    assert {**made.scene.to_json(), "suite": OURS} == plain.scene.to_json()
    assert made.scene.suite == BUILTIN_SUITE and made.scene.digest != plain.scene.digest


def test_colours_are_named_by_their_words_and_shown_pure() -> None:
    made, plain = official_world_parts(KEY, BUILTIN, {}), task_parts(KEY)
    assert made.instruction == plain.instruction
    colors = {tuple(o.params["color"]) for o in made.scene.objects}
    assert colors == {(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)}


def test_objects_are_of_the_archive_where_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def load(path: str) -> Any:
        if path == layout_module.PACK:
            return lambda name: SimpleNamespace(digest=lambda: f"hash of {name}")
        return lambda scene, name: SimpleNamespace(scene=scene, name=name)

    monkeypatch.setattr(layout_module, "load", load)
    options, layout = parse_official("official")
    assert (options, layout.suite, layout.digest) == (OfficialOptions(), SUITE, "hash of official")
    assert layout.manifest_settings().assets == "official"
    assert layout.warnings(official_sentences=True) == []
    (said,) = layout.warnings(official_sentences=False)
    assert "add --instructions CHECKOUT" in said
    packed: Any = layout.pack(task_parts(KEY).scene)
    assert packed.name == "official"
    assert parse_official("official?assets=builtin")[1].suite == BUILTIN_SUITE


def test_the_archive_that_is_named_is_found_by_workers_with_its_textures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("ROBOSPA_ASSETS", "ROBOSPA_TEXTURES"):
        monkeypatch.setenv(name, "before")
        monkeypatch.delenv(name)
    (tmp_path / "background_texture").mkdir()
    archive = SimpleNamespace(root=tmp_path)
    opened = SimpleNamespace(digest=lambda: "h", archive=archive)
    monkeypatch.setattr(layout_module, "load", lambda path: lambda name: opened)
    made = request(tmp_path, assets=str(tmp_path), world="official")
    assert made.config.parts_arguments["layout"].digest == "h"
    assert os.environ["ROBOSPA_ASSETS"] == str(tmp_path)
    assert os.environ["ROBOSPA_TEXTURES"] == str(tmp_path / "background_texture")
    with pytest.raises(SettingsError, match="add --world official"):
        request(tmp_path, assets=str(tmp_path), world="sapien")
    with pytest.raises(SettingsError, match="there is no folder"):
        request(tmp_path, assets=str(tmp_path / "no"))


def test_without_an_archive_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(path: str) -> Any:
        def opened(name: str) -> Any:
            raise ValueError("there is no archive")

        return opened

    monkeypatch.setattr(layout_module, "load", missing)
    _, layout = parse_official("official?switches=pure-colors")
    assert layout.suite == BUILTIN_SUITE and layout.manifest_settings().switches == ["pure-colors"]
    (said,) = layout.warnings(official_sentences=False)
    assert said.startswith("objects are built in") and "no archive" in said
    with pytest.raises(SettingsError, match="no official objects: there is no archive"):
        parse_official("official?assets=official")
    for wrong in ("switches=gap", "settle=long", "speed=2"):
        with pytest.raises(SettingsError, match=r"--world official\?"):
            parse_official(f"official?{wrong}")


def test_an_archive_that_is_named_has_to_be_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody who names one wants our own objects instead."""
    monkeypatch.setenv("ROBOSPA_ASSETS", "before")
    with pytest.raises(SettingsError, match="holds none of objects, embodiments"):
        request(tmp_path, assets=str(tmp_path), world="official")


def test_an_archive_that_lacks_what_a_task_needs_is_refused_at_the_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def faults(tasks: Collection[str]) -> dict[str, str]:
        return {task: "a file is missing" for task in tasks if task != TASK}

    torn = SimpleNamespace(name="x", has=str, model=str, digest=lambda: "h", faults=faults)
    monkeypatch.setattr(layout_module, "load", lambda path: lambda name: torn)
    assert parse_official("official", tasks=[TASK])[1].packed
    with pytest.raises(SettingsError, match=r"1 of 2 tasks cannot run .*, Other because"):
        parse_official("official", tasks=[TASK, "Other"])


def request(folder: Path, **more: object) -> Any:
    given = {
        "policy": ["hold"], "tasks": TASK, "levels": "2", "trials": 2, "out": folder / "run",
        "world": "official?assets=builtin&settle=official", **more,
    }  # fmt: skip
    return make_request(updated(EvaluationSettings(), given))


def test_a_run_is_of_its_own_suite_and_says_what_is_switched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = request(write_checkout(tmp_path), instructions=str(tmp_path))
    assert made.config.world_arguments["settle"] == "official"
    assert {key.split for key in made.keys} == {UNSEEN}
    parts = load_parts(pickle.loads(pickle.dumps(made.config)))
    assert parts(made.keys[1]).instruction == "sort this pair by hue, red first"
    monkeypatch.setattr(evaluate, "probe_world", lambda *_: {})
    policy = ProbedPolicy("hold", PolicySpec(name="hold", cameras=()), {}, {})
    manifest = evaluate.make_manifest(made, {TASK: policy}).to_json()
    assert manifest["suite"] == BUILTIN_SUITE
    assert manifest["settings"]["layout"]["assets"] == "builtin"
    assert "gap-under-wall" in manifest["settings"]["layout"]["switches"]
    with pytest.raises(SettingsError, match="leave it out"):
        request(tmp_path, parts="run_fakes:parts")


def test_our_sentences_are_those_of_our_splits(tmp_path: Path) -> None:
    made = request(tmp_path, split="train,indirect")
    assert [key.split for key in made.keys[::2]] == ["train", "indirect"]
    parts = load_parts(made.config)
    assert parts(made.keys[0]).instruction == task_parts(made.keys[0]).instruction
    assert SEEN not in {key.split for key in made.keys}


class Spinning:
    """Physics of one object that turns by `rate` [rad] a step from step `since` on."""

    def __init__(self, rate: float, since: int) -> None:
        self.rows = {"top": 0}
        self.rate, self.since, self.steps = rate, since, 0

    def moving(self) -> dict[str, object]:
        return {"top": None}

    def step(self) -> None:
        self.steps += 1

    def packed(self) -> bytes:
        angle = self.rate * max(0, self.steps - self.since)
        row = [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2), 0.0, 0.0, 0.74]
        return np.array(row, dtype=np.float32).tobytes()


def test_eleven_seconds_pass_and_what_still_turns_is_no_seed() -> None:
    assert official_world.FLOATS == 7
    early: Any = Spinning(0.0, 0)
    official_world._wait(early, "here")
    assert early.steps == 2750 and early.steps / 250 == 11.0
    slow: Any = Spinning(np.radians(2.9) / 200, 2550)
    official_world._wait(slow, "here")
    fast: Any = Spinning(np.radians(3.2) / 200, 2550)
    with pytest.raises(SceneUnstable, match="object 'top' of here still turns after 11 s"):
        official_world._wait(fast, "here")
