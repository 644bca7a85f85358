"""Official quirks switched back: each changes what it says and nothing else."""

from dataclasses import replace
from typing import Any

import pytest

from robospa.geometry import Pose
from robospa.harness.official.layout import IDS, SWITCHES, chosen, switched
from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.colors import NAMED
from robospa.tasks.official import official_model
from robospa.tasks.scene import Scene, SceneObject


def block(name: str, word: str, x: float = 0.0, **more: Any) -> SceneObject:
    params = {"half": [0.02] * 3, "color": list(NAMED[word])}
    return SceneObject(name, "block", Pose((x, 0.0, 0.76)), params, **more)


def scene(task: str, *objects: SceneObject, level: int = 4, **facts: Any) -> Scene:
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
    made = scene("Press_Stapler_Repeat", block("object_0", "red"))
    assert switched(made, 3, SWITCHES) is made
    assert switched(made, 3, chosen("pure-colors")) is made
    assert switched(made, 3, SWITCHES, unsaid=True).objects[0].params["color"] == [1.0, 0.0, 0.0]


def test_the_extreme_asked_for_follows_the_episode() -> None:
    places = {"west": (-0.2, 0.0), "east": (0.2, 0.0), "far": (0.0, 0.1), "near": (0.0, -0.1)}
    items = [SceneObject(n, "seal", Pose((*at, 0.74)), {"look": 0}) for n, at in places.items()]
    made = scene("Pick_Seals_Multi_View", *items, target="far", extreme="frontmost",
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
    made = scene(task, *items)
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
        made = scene("Click_Bell_Open_Microwave_Place_Object", *items, object=one, reference=other)
        facts = switched(made, 0, chosen("left-thing-moves")).facts
        assert (facts["object"], facts["reference"]) == ("b", "a")
    early = scene("Click_Bell_Open_Microwave_Place_Object", *items, level=1, bell="a")
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
        found = switched(scene(task, *items), 0, SWITCHES, unsaid=True).objects
        assert [o.params.get("color") for o in found] == [purple, [1.0, 0.0, 0.0], None]
        assert found[0].params["half"] == [0.02] * 3


def test_the_microwave_floats() -> None:
    items = block("a", "red"), SceneObject("m", "microwave", Pose((0.0, 0.1, 0.74)), fixed=True)
    made = scene("Click_Bell_Open_Microwave_Place_Object", *items, microwave="m")
    found = switched(made, 0, chosen("floating-microwave"))
    assert found.objects[0] is items[0]
    assert found.objects[1].pose.position == pytest.approx((0.0, 0.1, 0.80))
