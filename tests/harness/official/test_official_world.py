"""The official world: its parts, suites, settings, and its 11 seconds."""

import os
import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checkouts import write_checkout
from command_line import robospa
from made_archive import make_archive, official_pack_in

from robospa.baselines.oracle import create
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
from robospa.harness.running import api, evaluate
from robospa.harness.running.policy_probe import ProbedPolicy
from robospa.harness.running.request import make_request
from robospa.harness.running.worker import load_parts, task_finder
from robospa.harness.settings import EvaluationSettings, Selection, SettingsError, updated
from robospa.harness.trial import run_trial, task_parts
from robospa.harness.world import SceneUnstable
from robospa.harness.worlds import SPOKEN_PARTS
from robospa.protocol.policy import PolicySpec
from robospa.registry import UnknownName
from robospa.tasks import packs
from robospa.tasks.objects import object_model
from robospa.tasks.scene import SUITE as OURS
from robospa.tasks.sentences import instruction as own_instruction
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


@pytest.fixture
def cans(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of cans and seals, whose environment is as before afterwards."""
    root = make_archive(tmp_path / "assets", ["can", "seal"], ("objects", "background_texture"))
    monkeypatch.setenv("ROBOSPA_TEXTURES", "before")
    monkeypatch.delenv("ROBOSPA_TEXTURES")
    with official_pack_in(root, tmp_path / "cache", monkeypatch):
        yield root


def test_objects_are_of_the_archive_where_there_is_one(cans: Path) -> None:
    options, layout = parse_official("official", tasks=["Pick_Cans_Relational"])
    assert (options, layout.suite) == (OfficialOptions(), SUITE)
    assert layout.digest == packs.pack("official").digest()
    assert layout.manifest_settings().assets == "official"
    assert layout.warnings(official_sentences=True) == []
    (said,) = layout.warnings(official_sentences=False)
    assert "--instructions" in said
    scene = official_world_parts(TrialKey("Pick_Cans_Relational", 2, 100000), layout, {}).scene
    assert {item.params["pack"] for item in scene.objects} == {"official"}
    assert parse_official("official?assets=builtin")[1].suite == BUILTIN_SUITE
    with pytest.raises(SettingsError, match=r"1 of 2 tasks cannot run .*Press_Stapler_Repeat"):
        parse_official("official", tasks=["Pick_Cans_Relational", "Press_Stapler_Repeat"])


def test_the_archive_that_is_named_is_found_by_workers_with_its_textures(cans: Path) -> None:
    os.environ["ROBOSPA_ASSETS"] = "elsewhere"
    made = request(cans, assets=str(cans), world="official")
    assert made.config.parts_arguments["layout"].digest
    assert os.environ["ROBOSPA_ASSETS"] == str(cans)
    assert os.environ["ROBOSPA_TEXTURES"] == str(cans / "background_texture")
    for world in ("sapien", "official?assets=builtin"):
        with pytest.raises(SettingsError, match="--world official"):
            request(cans, assets=str(cans), world=world)
    with pytest.raises(SettingsError, match="there is no folder"):
        request(cans, assets=str(cans / "no"))
    with pytest.raises(SettingsError, match="holds none of objects"):
        request(cans, assets=str(cans / "objects"), world="official")  # nobody wants ours instead


def test_folders_of_one_evaluation_are_not_those_of_the_next(
    cans: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ROBOSPA_ASSETS")
    seen = []

    def fake_run(made: object) -> None:
        seen.append(packs.pack("official").archive.root)  # type: ignore[attr-defined]
        raise RuntimeError(os.environ["ROBOSPA_TEXTURES"])

    monkeypatch.setattr("robospa.harness.running.api.run_request", fake_run)
    with pytest.raises(RuntimeError, match="background_texture"):
        api.evaluate("hold", world="official", assets=cans, tasks="Pick_Cans_Relational", trials=1)
    assert seen == [cans] and not {"ROBOSPA_ASSETS", "ROBOSPA_TEXTURES"} & set(os.environ)
    with pytest.raises((ValueError, UnknownName), match="no folder of official assets is known"):
        packs.pack("official")


def test_an_empty_folder_of_textures_counts_as_none(cans: Path) -> None:
    for file in (cans / "background_texture").glob("*/*"):
        file.unlink()
    parse_official("official")
    assert "ROBOSPA_TEXTURES" not in os.environ


def test_without_an_archive_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with official_pack_in(tmp_path, tmp_path, monkeypatch):
        _, layout = parse_official("official?switches=pure-colors")
        with pytest.raises(SettingsError, match="no official objects"):
            parse_official("official?assets=official")
    assert layout.suite == BUILTIN_SUITE and layout.manifest_settings().switches == ["pure-colors"]
    (said,) = layout.warnings(official_sentences=False)
    assert said.startswith("objects are built in") and str(tmp_path) in said
    with pytest.raises(SettingsError, match="options are written official"):
        parse_official("official:settle=official")
    for wrong in ("switches=gap", "settle=long", "speed=2"):
        with pytest.raises(SettingsError, match=r"--world official\?"):
            parse_official(f"official?{wrong}")


@pytest.mark.sim
def test_a_trial_with_the_archives_objects_is_solved_in_its_own_suite(cans: Path) -> None:
    pytest.importorskip("trimesh", reason="meshes need trimesh: pip install 'robospa[assets]'")
    options, layout = parse_official("official?assets=official&settle=official")
    key = TrialKey("Pick_Seals_Multi_View", 2, 100000)
    parts = official_world_parts(key, layout, {})
    assert parts.scene.suite == "official-1" and layout.digest
    item = parts.scene.objects[0]
    assert object_model(item.asset, item.params).shapes != object_model(item.asset).shapes
    world = official_world.OfficialWorld(render=False, settle=options.settle)
    record = run_trial(world, create(), key, policy_seed=0, parts=lambda _: parts)
    assert record.success, record.message


def request(folder: Path, **more: object) -> Any:
    given = {
        "policy": ["hold"], "tasks": TASK, "levels": "2", "trials": 2, "out": folder / "run",
        "world": "official?assets=builtin&settle=official", **more,
    }  # fmt: skip
    return make_request(updated(EvaluationSettings(), given))


def manifest_of(made: Any, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    monkeypatch.setattr(evaluate, "probe_world", lambda *_: {})
    policy = ProbedPolicy("hold", PolicySpec(name="hold", cameras=()), {}, {})
    return evaluate.make_manifest(made, {TASK: policy}).to_json()


def test_a_run_is_of_its_own_suite_and_says_what_is_switched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = request(write_checkout(tmp_path), instructions=str(tmp_path))
    assert made.config.world_arguments["settle"] == "official"
    assert {key.split for key in made.keys} == {UNSEEN}
    parts = load_parts(pickle.loads(pickle.dumps(made.config)))
    assert parts(made.keys[1]).instruction == "sort this pair by hue, red first"
    manifest = manifest_of(made, monkeypatch)
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
        self.rows, self.moving = {"top": 0}, {"top": None}
        self.rate, self.since, self.steps = rate, since, 0

    def step(self) -> None:
        self.steps += 1

    def packed(self) -> bytes:
        angle = self.rate * max(0, self.steps - self.since)
        row = [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2), 0.0, 0.0, 0.74]
        return np.array(row, dtype=np.float32).tobytes()


def test_eleven_seconds_pass_and_what_still_turns_is_no_seed() -> None:
    early: Any = Spinning(0.0, 0)
    official_world._wait(early, "here")
    assert early.steps == 2750 and early.steps / 250 == 11.0
    slow: Any = Spinning(np.radians(2.9) / 200, 2550)
    official_world._wait(slow, "here")
    fast: Any = Spinning(np.radians(3.2) / 200, 2550)
    with pytest.raises(SceneUnstable, match="object 'top' of here still turns after 11 s"):
        official_world._wait(fast, "here")


# ------------------------------------ runs with the sentences of a checkout, in whichever world


def request_sentences(folder: Path, **more: object) -> Any:
    return request(folder, world="sapien", trials=1, instructions=str(folder), **more)


def test_a_run_has_official_splits_sentences_and_their_hash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = request_sentences(write_checkout(tmp_path), split="heldout,train")
    assert [key.split for key in made.keys] == [UNSEEN, SEEN]
    assert made.config.parts == SPOKEN_PARTS
    assert task_finder(made.config.parts)(made.keys[0]).name == "Rank_Blocks_Color"
    parts = load_parts(pickle.loads(pickle.dumps(made.config)))
    assert [parts(key).instruction for key in made.keys] == [
        "sort this pair by hue, red first",
        "line both up by hue",
    ]
    manifest = manifest_of(made, monkeypatch)
    assert list(manifest["settings"]["split"]) == [SEEN, UNSEEN]
    assert manifest["settings"]["instructions"] == manifest["about"]["instructions"]["hash"]
    assert any("0 stand in training" in text for text in manifest["about"]["warnings"])


def test_official_splits_are_none_of_ours(tmp_path: Path) -> None:
    made = request_sentences(write_checkout(tmp_path))
    scene = load_parts(made.config)(made.keys[0]).scene
    with pytest.raises(ValueError, match="no instruction split 'official_unseen'"):
        own_instruction(scene, made.keys[0].split)
    with pytest.raises(SettingsError, match="split indirect has no official sentences"):
        Selection(instructions=tmp_path, split="train,indirect")
    with pytest.raises(SettingsError, match="parts has scenes and sentences of its own"):
        request_sentences(tmp_path, parts="run_fakes:parts")


def test_the_command_shows_what_fits_and_what_is_trained_on(tmp_path: Path) -> None:
    words = ("--tasks", "Rank_Blocks_Color", "--levels", "2")
    code, shown, _ = robospa("official", "instructions", write_checkout(tmp_path), *words)
    assert code == 0
    assert "Rank_Blocks_Color 2: fit 1 of 1, 1 of 1; 0 equal, 0 alike of 1" in shown
    assert "sort this pair by hue, red first" in shown
