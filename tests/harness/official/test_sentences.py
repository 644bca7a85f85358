"""Official sentences of a made-up checkout: which fit, how they are filled, what is refused."""

import json
from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import pytest
from checkouts import TEMPLATES, write_checkout

from robospa.geometry import Pose
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
from robospa.tasks.catalog import tasks
from robospa.tasks.scene import Scene, SceneObject

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
