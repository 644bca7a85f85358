"""Sentences of a made-up checkout: which fit, how they are filled, what is refused."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path

import pytest
from checkouts import TEMPLATES, write_checkout

from robospa.geometry import Pose
from robospa.harness.cli.main import main
from robospa.harness.official.sentences import (
    SEEN,
    UNSEEN,
    CheckoutError,
    OfficialSentences,
    Texts,
    overlap,
    read_checkout,
)
from robospa.harness.official.slots import NoOfficialSentence
from robospa.harness.running import evaluate
from robospa.harness.running.policy_probe import ProbedPolicy
from robospa.harness.running.request import make_request
from robospa.harness.running.worker import load_parts, task_finder
from robospa.harness.settings import EvaluationSettings, Selection, SettingsError, updated
from robospa.harness.worlds import SPOKEN_PARTS
from robospa.protocol.policy import PolicySpec
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.sentences import instruction as own_instruction

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


def request(folder: Path, **more: object):  # type: ignore[no-untyped-def]
    given = {
        "policy": ["hold"], "tasks": "Rank_Blocks_Color", "levels": "2", "trials": 1,
        "instructions": str(folder), "out": folder / "run", **more,
    }  # fmt: skip
    return make_request(updated(EvaluationSettings(), given))


def test_a_run_has_official_splits_sentences_and_their_hash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = request(write_checkout(tmp_path), split="heldout,train")
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
    made = request(write_checkout(tmp_path))
    scene = load_parts(made.config)(made.keys[0]).scene
    with pytest.raises(ValueError, match="no instruction split 'official_unseen'"):
        own_instruction(scene, made.keys[0].split)
    with pytest.raises(SettingsError, match="split indirect has no official sentences"):
        Selection(instructions=tmp_path, split="train,indirect")
    with pytest.raises(SettingsError, match="parts has scenes and sentences of its own"):
        request(tmp_path, parts="run_fakes:parts")


def test_the_command_shows_what_fits_and_what_is_trained_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_checkout(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["official", "instructions", str(tmp_path), "--tasks", "Rank_Blocks_Color",
              "--levels", "2"])  # fmt: skip
    shown = capsys.readouterr().out
    assert ended.value.code == 0
    assert "Rank_Blocks_Color 2: fit 1 of 1, 1 of 1; 0 equal, 0 alike of 1" in shown
    assert "sort this pair by hue, red first" in shown
