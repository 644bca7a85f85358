"""Facts of a scene: typed in the task, plain JSON in the scene."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import pytest

from robospa.geometry import Pose
from robospa.harness.robots import embodiment
from robospa.tasks import catalog
from robospa.tasks.catalog import build_scene
from robospa.tasks.events import Event, outcome
from robospa.tasks.scene import Scene
from robospa.tasks.sentences import SPLITS, instruction, sentences
from robospa.tasks.snapshot import Contact, Snapshot, snapshot_from_json, snapshot_to_json
from robospa.tasks.task import SceneFacts
from robospa.workcell import grasp_points


@dataclass(frozen=True)
class Facts(SceneFacts):
    order: tuple[str, ...]
    color: str | None
    bell: str = ""
    count: int = 0


def scene_with(facts: SceneFacts) -> Scene:
    return Scene("Any", 1, 0, "robot", "clean", (), json.loads(json.dumps(facts.to_json())))


@pytest.mark.parametrize(
    ("facts", "plain"),
    [
        (Facts(("a", "b"), "red", "c", 2),
         {"order": ["a", "b"], "color": "red", "bell": "c", "count": 2}),
        (Facts((), None), {"order": [], "color": None}),
    ],
)  # fmt: skip
def test_facts_are_plain_in_the_scene_and_come_back(facts: Facts, plain: dict[str, object]) -> None:
    assert facts.to_json() == plain
    assert Facts.of(scene_with(facts)) == facts


def test_a_base_reads_its_own_fields_only() -> None:
    @dataclass(frozen=True)
    class Ordered(SceneFacts):
        order: tuple[str, ...]

    assert Ordered.of(scene_with(Facts(("a",), "red"))) == Ordered(("a",))


@pytest.mark.parametrize("name", catalog.tasks())
def test_facts_of_built_scenes_are_what_json_gives_back(name: str) -> None:
    scene = catalog.build_scene(name, 5, 100000)
    assert json.loads(json.dumps(scene.facts)) == scene.facts
    assert Scene.from_json(scene.to_json()) == scene


GRIPPERS = embodiment("aloha-agilex").grippers
ENDS = (Pose(), Pose((1.0, 2.0, 3.0)))
SNAPSHOT = Snapshot(
    time=1.25,
    poses={"one": Pose((0.1, 0.2, 0.3), (0.6, 0.0, 0.8, 0.0))},
    gripper=(0.0, 1.0),
    end_effector=ENDS,
    grasp_points=grasp_points(GRIPPERS, ENDS),
    joints=((0.1, 0.2), (0.3, 0.4)),
    measured=((0.11, 0.21), (0.31, 0.41)),
)


def test_a_snapshot_comes_back_from_json() -> None:
    assert (
        snapshot_from_json(json.loads(json.dumps(snapshot_to_json(SNAPSHOT))), GRIPPERS) == SNAPSHOT
    )


def test_poses_are_position_then_quaternion() -> None:
    assert snapshot_to_json(SNAPSHOT)["poses"]["one"] == [0.1, 0.2, 0.3, 0.6, 0.0, 0.8, 0.0]


def test_contacts_stay_with_goals() -> None:
    touching = replace(SNAPSHOT, contacts=(Contact("a", "b", (0,) * 3),))
    assert "contacts" not in snapshot_to_json(touching)


def test_something_else_is_refused() -> None:
    with pytest.raises(KeyError):
        snapshot_from_json({"time": 0.0}, GRIPPERS)


def test_heights_of_several_objects_name_those_that_do_not_exist_yet() -> None:
    assert SNAPSHOT.heights(("one", "later")) == [0.3, None]
    assert SNAPSHOT.position("one") == (0.1, 0.2, 0.3)


SALT, OTHER = "ab" * 32, "cd" * 32
PLACES = [("Pick_Blocks_Size", 3), ("Stack_Blocks_Size_Order", 5), ("Press_Stapler_Repeat", 2)]


@pytest.mark.parametrize(("task", "level"), PLACES)
def test_every_salt_has_its_own_scenes(task: str, level: int) -> None:
    public, hidden = build_scene(task, level, 100000), build_scene(task, level, 100000, salt=SALT)
    other = build_scene(task, level, 100000, salt=OTHER)
    assert hidden == build_scene(task, level, 100000, salt=SALT)
    assert public == build_scene(task, level, 100000, salt="")
    assert len({public.digest, hidden.digest, other.digest}) == 3
    assert SALT not in json.dumps(hidden.to_json())


@pytest.mark.parametrize("split", SPLITS)
def test_the_sentence_is_drawn_with_the_salt(split: str) -> None:
    """The same scene, so that only the draw of the sentence can differ."""
    scene = build_scene("Pick_Blocks_Size", 3, 100000)
    assert sentences(scene, split, SALT) == sentences(scene, split, SALT)
    assert sentences(scene, split, SALT) != sentences(scene, split)
    chosen = {instruction(scene, split, salt) for salt in ("", SALT, OTHER, "ef" * 32)}
    assert len(chosen) > 1


def test_the_parts_of_a_mode_are_drawn_with_the_salt(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[float] = []

    def varied(scene, part):  # type: ignore[no-untyped-def]
        drawn.append(part("light").random())
        return scene

    monkeypatch.setattr("robospa.tasks.catalog.scene_mode", lambda name: varied)
    for salt in ("", SALT, OTHER, SALT):
        build_scene("Pick_Blocks_Size", 1, 100000, salt=salt)
    assert drawn[1] == drawn[3] and len(set(drawn)) == 3


@pytest.mark.parametrize(
    ("told", "total", "done", "best"),
    [
        (["done 0", "done 1", "undone 1", "undone 0", "done 0"], 3, 1, 2),
        (["done 0", "undone 0", "done 0"], 3, 1, 1),
        (["success"], 2, 2, 2),
        (["done 0", "failed"], 2, 1, 1),
    ],
)
def test_the_best_stays_and_a_subtask_counts_once(
    told: list[str], total: int, done: int, best: int
) -> None:
    """What is undone counts no more, and success is all."""
    events = []
    for time, text in enumerate(told):
        kind, _, index = text.partition(" ")
        events.append(
            Event(time, f"subtask_{kind}", "", int(index)) if index else Event(time, kind)
        )
    found = outcome(events, total)
    assert (found.done, found.best) == (done, best)
    assert (found.success, found.failed) == ("success" in told, "failed" in told)
