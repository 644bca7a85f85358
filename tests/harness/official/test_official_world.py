"""The official world: its parts, suites, settings, and its 11 seconds."""

import json
import os
import pickle
from collections.abc import Iterator, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checkouts import TEMPLATES, write_checkout
from command_line import robospa
from made_archive import make_archive, official_pack_in

from robospa.baselines.oracle import create
from robospa.geometry import Pose
from robospa.harness.official import official_world
from robospa.harness.official.layout import (
    BUILTIN_SUITE,
    IDS,
    SUITE,
    SWITCHES,
    OfficialLayout,
    OfficialOptions,
    chosen,
    official_world_parts,
    parse_official,
    switched,
)
from robospa.harness.official.sentences import (
    SEEN,
    UNSEEN,
    CheckoutError,
    OfficialSentences,
    Texts,
    overlap,
    read_checkout,
)
from robospa.harness.official.slots import SLOTS, NoOfficialSentence, official_values
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
from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.colors import NAMED
from robospa.tasks.objects import object_model
from robospa.tasks.official import official_model
from robospa.tasks.scene import SUITE as OURS
from robospa.tasks.scene import Scene, SceneObject
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
    with pytest.raises(SettingsError, match="--world official"):
        request(cans, assets=str(cans), world="sapien")
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


# ----------------- sentences of a made-up checkout: which fit, how they are filled, what is refused


ORDER = ("Click_Objects_Order", 2)
SIZE = ("Pick_Blocks_Size", 2)


@pytest.fixture
def said(tmp_path: Path) -> OfficialSentences:
    return read_checkout(write_checkout(tmp_path), TEMPLATES)


def clicks(seed: int = 1, look: int = 0, pack: str = "") -> Scene:
    params = {"look": look, **({"pack": pack} if pack else {})}
    items = (
        SceneObject("object_0", "stapler", Pose((0.2, 0.0, 0.74))),
        SceneObject("object_1", "alarm_clock", Pose((-0.2, 0.0, 0.74)), params),
    )
    facts = {"order": ["object_1", "object_0"]}
    return Scene(*ORDER, seed, "aloha-agilex", "clean", items, facts)


def test_things_without_an_official_model_go_by_their_plain_name(said: OfficialSentences) -> None:
    found = {said.instruction(clicks(seed), UNSEEN) for seed in range(30)}
    assert found == {
        "poke the clock and thereafter the stapler",
        "use the left arm on the clock and the right arm on the stapler",
    }
    trained = {said.instruction(clicks(seed), SEEN) for seed in range(30)}
    assert trained == {
        "first tap the clock, next tap the stapler",
        "tap the clock by the left arm, then the stapler by the right arm",
    }


def test_a_thing_of_the_official_pack_goes_by_its_descriptions(said: OfficialSentences) -> None:
    looks = {"round", "red", "old", "square", "clock"}

    def names(look: int, split: str) -> set[str]:
        scenes = [clicks(seed, look, "official") for seed in range(30)]
        words = {word.strip(",") for s in scenes for word in said.instruction(s, split).split()}
        return (words & looks) - {"clock"}

    assert names(0, SEEN) == {"round", "red"}
    assert names(0, UNSEEN) == {"old"}
    assert names(1, UNSEEN) == {"square"}  # has none to test with


def test_a_sentence_follows_from_the_key_alone(tmp_path: Path, said: OfficialSentences) -> None:
    again = read_checkout(write_checkout(tmp_path / "again"), [ORDER])
    for seed in range(5):
        other = replace(clicks(seed), embodiment="piper", mode="randomized")
        assert again.instruction(other, UNSEEN) == said.instruction(clicks(seed), UNSEEN)
    drawn = {said.instruction(clicks(1), UNSEEN, salt=str(n)) for n in range(20)}
    assert len(drawn) == 2
    path = tmp_path / "again/description/task_instruction/Click_Objects_Order_2.json"
    path.write_text(path.read_text().replace("poke", "prod"))
    assert read_checkout(tmp_path / "again", [ORDER]).digest != again.digest


def test_a_scene_without_fitting_template_is_named(said: OfficialSentences) -> None:
    only = {ORDER: Texts(("{Z}",), ("{Z}",))}
    with pytest.raises(NoOfficialSentence, match=r"no official_unseen template of .*\{A\}"):
        replace(said, templates=only).instruction(clicks(), UNSEEN)
    with pytest.raises(NoOfficialSentence, match="no official split 'heldout'"):
        said.instruction(clicks(), "heldout")
    fewer = {name: texts for name, texts in said.descriptions.items() if "stapler" not in name}
    with pytest.raises(CheckoutError, match="does not describe 048_stapler/base0"):
        replace(said, descriptions=fewer).instruction(clicks(), UNSEEN)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "cannot be read"),
        ("[1]", "a map"),
        ('{"seen": [], "unseen": []}', "has no sentences"),
        ('{"seen": ["a"], "unseen": "b"}', "unseen"),
        ('{"seen": ["a\\u001b[0m"], "unseen": ["b"]}', "no line"),
        (json.dumps({"seen": ["x" * 501], "unseen": ["b"]}), "length <= 500"),
        ("[" * 10_000, "cannot be read"),
        (" " * (2**20 + 1), "more than 1048576 bytes"),
    ],
)
def test_a_broken_file_is_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    folder = write_checkout(tmp_path)
    path = folder / "description/task_instruction/Pick_Blocks_Size_2.json"
    path.write_text(text)
    with pytest.raises(CheckoutError, match=sentence) as caught:
        read_checkout(folder, [SIZE])
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_what_is_missing_or_has_no_end_is_named(tmp_path: Path) -> None:
    with pytest.raises(CheckoutError, match="no checkout of RoboSPA"):
        read_checkout(tmp_path, [SIZE])
    path = write_checkout(tmp_path) / "description" / "task_instruction" / "Pick_Blocks_Size_2.json"
    path.unlink()
    with pytest.raises(CheckoutError, match=r"Size_2\.json does not exist"):
        read_checkout(tmp_path, [SIZE])
    path.symlink_to("/dev/zero")
    with pytest.raises(CheckoutError, match=r"Size_2\.json cannot be read"):
        read_checkout(tmp_path, [SIZE])
    model = tmp_path / "description/objects_description/048_stapler/base0.json"
    model.write_text('{"seen": ["small"]}')
    with pytest.raises(CheckoutError, match="describes no object"):
        read_checkout(tmp_path, [])


def test_the_overlap_counts_equal_and_alike_templates() -> None:
    tests = ("lift  the cup.", "press {B} twice!", "do something else entirely")
    found = overlap(Texts(("Lift the cup.", "Press {A} twice."), tests))
    assert (found.tests, found.equal, found.near) == (3, 1, 2)
    assert found.examples == ("lift  the cup.",)


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
    monkeypatch.setattr(evaluate, "probe_world", lambda *_: {})
    policy = ProbedPolicy("hold", PolicySpec(name="hold", cameras=()), {}, {})
    manifest = evaluate.make_manifest(made, {"Rank_Blocks_Color": policy}).to_json()
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


# ------------------------------ what the official placeholders stand for, in scenes written by hand


THINGS = {
    "left can": ("can", -0.1, {}),
    "right bell": ("bell", 0.1, {}),
    "stapler": ("stapler", 0.2, {}),
    "clock": ("alarm_clock", -0.2, {}),
    "brown mug": ("mug", 0.0, {"tint": "brown"}),
    "white pills": ("pill_bottle", 0.0, {"tint": "white"}),
    "red": ("block", 0.0, {"half": [0.01] * 3, "color": [1.0, 0.0, 0.0]}),
    "sign": ("payment_sign", 0.0, {}),
    "tea": ("tea_box", 0.0, {}),
}


def scene(task: str, level: int, **facts: Any) -> Scene:
    objects = tuple(
        SceneObject(name, asset, Pose((x, 0.0, 0.74)), params)
        for name, (asset, x, params) in THINGS.items()
    )
    return Scene(task, level, 1, "aloha-agilex", "clean", objects, facts)


def plain(found: Mapping[str, str | SceneObject]) -> dict[str, str]:
    return {k: v if isinstance(v, str) else f"<{v.name}>" for k, v in found.items()}


RIGHT, BELL = "right bell", "<right bell>"
CASES = [
    (scene("Pick_Blocks_Area", 4, target="red", area_rank=3), {"A": "3rd"}),
    (scene("Pick_Blocks_Distance", 3, reference="red", distance_rank=1),
     {"A": "red block", "B": "1st"}),
    (scene("Pick_Mugs_Distance", 3, reference="brown mug", distance_rank=2),
     {"A": "brown mug", "B": "2nd"}),
    (scene("Pick_Pill_Bottles_Distance", 3, reference="white pills", distance_rank=2),
     {"A": "white pillbottle", "B": "2nd"}),
    (scene("Pick_Mixed_Objects_Distance_A", 5, reference="sign", distance_rank=2),
     {"A": "paymentsign", "B": "2nd"}),
    (scene("Pick_Mixed_Objects_Distance_B", 5, reference="tea", distance_rank=2),
     {"A": "tea box", "B": "2nd"}),
    (scene("Pick_Cups_Canonical", 1, column=2, column_direction="right_to_left"),
     {"C": "2nd", "col_dir": "from right to left"}),
    (scene("Pick_Cups_Canonical", 4, column=2, column_direction="left_to_right", row=3,
           row_direction="far_to_near"),
     {"C": "2nd", "R": "3rd row", "col_dir": "from left to right",
      "row_dir": "from far to near"}),
    (scene("Pick_Soaps_Relational", 1, relation="front", reference_label="back"),
     {"R": "in front of the back soap bar"}),
    (scene("Pick_Cans_Relational", 5, relation="back", reference_label="center"),
     {"R": "directly at the back of the center can"}),
    (scene("Pick_Mixed_Objects_Relational_A", 5, relation="left",
           reference_label="middle_right"),
     {"R": "directly to the left of the middle-right object"}),
    (scene("Pick_Tea_Box_Relational", 5, relation="front_left", reference_label="back_right"),
     {"R": "to the front-left of the back-right tea box"}),
    (scene("Pick_Seals_Multi_View", 2, position="backmost", viewpoint="robot"),
     {"P": "the backmost object", "V": "robot's"}),
    (scene("Click_Bell_Repeat", 1, bell=RIGHT, count=1), {"A": BELL, "a": "right"}),
    (scene("Lift_Pot_Repeat", 4, thing=RIGHT, count=4), {"A": BELL, "B": "4"}),
    (scene("Put_Bottles_Dustbin", 1, dustbin=RIGHT, bottles=["left can"]),
     {"A": "<left can>", "B": BELL}),
    (scene("Put_Bottles_Dustbin", 2, dustbin=RIGHT, bottles=["left can"] * 2), {"A": BELL}),
    (scene("Move_Blocks_Apart", 1, right=[], left=["red"], left_color="red"),
     {"A": "red block", "B": "left"}),
    (scene("Move_Blocks_Apart", 2, right_color="red", left_color="cyan"),
     {"A": "red", "B": "cyan"}),
    (scene("Move_Playing_Cards_Away", 1, boxes=[RIGHT]), {"A": BELL}),
    (scene("Move_Playing_Cards_Away", 2, boxes=[RIGHT, "tea"]), {}),
    (scene("Place_Bowls_Plates", 1, plate=RIGHT, bowls=["left can"]),
     {"A": BELL, "B": "<left can>", "a": "left"}),
    (scene("Place_Bowls_Plates", 2, plate=RIGHT, bowls=["left can", "tea"]),
     {"A": "<left can>", "C": BELL}),
    (scene("Separate_Fries_Bread", 1, forward=[], backward=["left can"], forward_kind="bread",
           backward_kind="fries"),
     {"A": "fries", "B": "backward", "a": "left"}),
    (scene("Hit_Blocks_Hammer_Order", 1, hammer=RIGHT), {"A": BELL, "a": "right"}),
    (scene("Click_Objects_Order", 2, order=["clock", "stapler"]),
     {"A": "<clock>", "B": "<stapler>", "a": "left", "b": "right"}),
    (scene("Stamp_Seals_Order", 2, seal="tea", colors=["red", "cyan"]),
     {"A": "<tea>", "B": "Red", "C": "Cyan"}),
    (scene("Click_Bell_Clockwise_Order", 4, order=[RIGHT]), {"B": BELL}),
    (scene("Click_Bell_Clockwise_Order", 5, order=[RIGHT]), {"B": "top bell"}),
    (scene("Hang_Mug_Stack_Blocks", 3, mug="brown mug", rack="tea"),
     {"A": "<brown mug>", "B": "<tea>", "C": "red block", "D": "green block"}),
    (scene("Place_Burger_Fries_Click_Bell", 3, burger="tea", tray="sign", fries="red",
           bell=RIGHT),
     {"A": "<tea>", "B": "<sign>", "C": "<red>", "D": BELL, "a": "left", "b": "right",
      "d": "right"}),
    (scene("Place_Bottle_Cup", 4, dustbin="tea", bottle_0="sign", cup_0="red", coaster_0=RIGHT),
     {"A": "<tea>", "B": "<red>", "C": BELL}),
    (scene("Remember_Color_Cover", 2, colors=["red", "blue"]), {"A": "red, blue"}),
    (scene("Press_Stapler_Memory", 2, counts=[3, 1]), {"A": "3", "B": "1"}),
    (scene("Rank_Blocks_Size", 5, order=["red"]), {}),
]  # fmt: skip


@pytest.mark.parametrize(("made", "expected"), CASES, ids=lambda v: getattr(v, "task", ""))
def test_placeholders_of(made: Scene, expected: dict[str, str]) -> None:
    assert plain(official_values(made)) == expected


def test_every_official_task_has_placeholders_and_no_other() -> None:
    fitting = {n for n in tasks() if any(fnmatchcase(n, pattern) for pattern in SLOTS)}
    assert fitting == {name for name, task in tasks().items() if task.dimension != "basic"}


# ------------------------ official quirks switched back: each changes what it says and nothing else


def block(name: str, word: str, x: float = 0.0, **more: Any) -> SceneObject:
    params = {"half": [0.02] * 3, "color": list(NAMED[word])}
    return SceneObject(name, "block", Pose((x, 0.0, 0.76)), params, **more)


def scene_switches(task: str, *objects: SceneObject, level: int = 4, **facts: Any) -> Scene:
    return Scene(task, level, 100000, "aloha-agilex", "clean", objects, facts)


def test_switches_are_chosen_by_name() -> None:
    assert chosen("all") == SWITCHES and chosen("none") == ()
    assert {task for switch in SWITCHES for task in switch.tasks} <= set(tasks())
    assert [s.name for s in chosen("pure-colors,gap-under-wall")] == [
        "gap-under-wall", "pure-colors"
    ]  # fmt: skip
    with pytest.raises(ValueError, match="no switch 'gap'; there are extreme-by-episode"):
        chosen("gap")


def test_other_tasks_and_other_halves_of_the_switches_change_nothing() -> None:
    made = scene_switches("Press_Stapler_Repeat", block("object_0", "red"))
    assert switched(made, 3, SWITCHES) is made
    assert switched(made, 3, chosen("pure-colors")) is made
    assert switched(made, 3, SWITCHES, unsaid=True).objects[0].params["color"] == [1.0, 0.0, 0.0]


def test_the_extreme_asked_for_follows_the_episode() -> None:
    places = {"west": (-0.2, 0.0), "east": (0.2, 0.0), "far": (0.0, 0.1), "near": (0.0, -0.1)}
    items = [SceneObject(n, "seal", Pose((*at, 0.74)), {"look": 0}) for n, at in places.items()]
    made = scene_switches("Pick_Seals_Multi_View", *items, target="far", extreme="frontmost",
                 viewpoint="left", position="leftmost")  # fmt: skip
    found = [switched(made, n, chosen("extreme-by-episode")).facts for n in range(8)]
    assert [f["target"] for f in found] == ["west", "east", "far", "near"] * 2
    assert [f["extreme"] for f in found[:4]] == ["leftmost", "rightmost", "frontmost", "backmost"]
    for views in (found[:4], found[4:]):
        assert {f["viewpoint"] for f in views} == {"robot", "opposite", "left", "right"}
    assert {f["position"] for f in found if f["viewpoint"] == "robot"} <= {
        f["extreme"] for f in found if f["viewpoint"] == "robot"
    }


@pytest.mark.parametrize(("task", "asset"), [
    ("Pick_Cans_Relational", "can"), ("Pick_Soaps_Relational", "soap"),
    ("Pick_Sauce_Can_Multi_View", "sauce_can"), ("Pick_Breads_Multi_View", "bread"),
])  # fmt: skip
def test_the_model_follows_the_episode(task: str, asset: str) -> None:
    items = [SceneObject(f"object_{i}", asset, Pose((0.1 * i, 0, 0.74)), {"look": 0})
             for i in range(3)]  # fmt: skip
    made = scene_switches(task, *items)
    for episode in range(2 * len(IDS[task])):
        looks = {
            o.params["look"] for o in switched(made, episode, chosen("model-by-episode")).objects
        }
        assert len(looks) == 1
        model = official_model(asset, looks.pop())
        assert model is not None and model.model == str(IDS[task][episode % len(IDS[task])])


def test_the_thing_farther_left_moves() -> None:
    items = block("a", "red", 0.2), block("b", "blue", -0.1)
    for one, other in (("a", "b"), ("b", "a")):
        made = scene_switches(
            "Click_Bell_Open_Microwave_Place_Object", *items, object=one, reference=other
        )
        facts = switched(made, 0, chosen("left-thing-moves")).facts
        assert (facts["object"], facts["reference"]) == ("b", "a")
    early = scene_switches("Click_Bell_Open_Microwave_Place_Object", *items, level=1, bell="a")
    assert switched(early, 0, SWITCHES) is early


@pytest.mark.parametrize("mode", ["clean", "randomized"])
def test_the_wall_leaves_a_gap_and_the_stand_is_pale(mode: str) -> None:
    """Also where the table stands lower."""
    made = build_scene("Observe_Blocks_Move_Memory", 1, 100000, mode=mode)
    assert (made.table_rise == 0.0) is (mode == "clean")
    said = switched(made, 0, SWITCHES)
    wall = said.object(said.facts["wall"])
    assert [o for o in said.objects if o != wall] == [
        o for o in made.objects if o.name != wall.name
    ]
    assert wall.pose.position[2] - wall.params["half"][2] == pytest.approx(made.table_top + 0.01)
    assert replace(said, objects=()) == replace(made, objects=())
    shown = switched(said, 0, SWITCHES, unsaid=True)
    greys = [o for o in shown.objects if o.params.get("color") == [0.85] * 3]
    assert len(greys) == 1 and greys[0].fixed and greys[0].name != wall.name
    assert shown.object(wall.name) == wall


def test_colours_are_the_pure_ones_of_their_task() -> None:
    items = block("a", "purple"), block("b", "red"), SceneObject("c", "mug", Pose((0, 0, 0)), {})
    for task, purple in (("Rank_Blocks_Color", [1.0, 0.0, 1.0]), ("Move_Blocks_Apart",
                          [0.5, 0.0, 0.5])):  # fmt: skip
        found = switched(scene_switches(task, *items), 0, SWITCHES, unsaid=True).objects
        assert [o.params.get("color") for o in found] == [purple, [1.0, 0.0, 0.0], None]
        assert found[0].params["half"] == [0.02] * 3


def test_the_microwave_floats() -> None:
    items = block("a", "red"), SceneObject("m", "microwave", Pose((0.0, 0.1, 0.74)), fixed=True)
    made = scene_switches("Click_Bell_Open_Microwave_Place_Object", *items, microwave="m")
    found = switched(made, 0, chosen("floating-microwave"))
    assert found.objects[0] is items[0]
    assert found.objects[1].pose.position == pytest.approx((0.0, 0.1, 0.80))
