"""Plans that fail on purpose: which calls they are made of, and where they are refused."""

from __future__ import annotations

import pytest

from robospa.harness.demonstrations.changed_plans import split_steps, wrong_plan
from robospa.tasks.catalog import build_scene, task
from robospa.tasks.plan import Pick, Place, Press
from robospa.tasks.scene import Scene

SEED = 930_000


def planned(kind: str, name: str, level: int) -> tuple[Scene, tuple[object, ...]]:
    scene = build_scene(name, level, SEED)
    return scene, wrong_plan(kind, scene)


def test_the_neighbour_is_not_the_target() -> None:
    scene, plan = planned("neighbour", "Pick_Blocks_Size", 5)
    (call,) = plan
    assert isinstance(call, Pick)
    assert call.object != scene.facts["target"]


def test_a_swap_builds_the_tower_in_another_order() -> None:
    scene, plan = planned("swaps", "Stack_Blocks_Color_Order", 3)
    first, second, third = scene.facts["order"]
    assert [c.object for c in plan if isinstance(c, Place)] == [first, third, second]


def test_a_forgotten_cue_changes_the_order_of_the_covers() -> None:
    scene, plan = planned("forgets", "Remember_Color_Cover", 3)
    covers = scene.facts["covers"]
    assert [c.object for c in plan if isinstance(c, Pick)] == [*covers[1:], covers[0]]


def test_a_repetition_presses_again_and_goes_no_further() -> None:
    _, plan = planned("repeats", "Click_Can_Place_Items", 2)
    assert [type(call) for call in plan] == [Press, Press, Press]


def test_who_stops_early_does_the_first_part() -> None:
    scene, plan = planned("stops", "Put_Bottles_Dustbin", 5)
    assert split_steps(plan) == split_steps(task(scene.task).plan(scene))[:2]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "name", "level"),
    [
        ("swaps", "Pick_Blocks_Size", 5),
        ("drops", "Press_Stapler_Repeat", 3),
        ("forgets", "Remember_Color_Cover", 1),
        ("repeats", "Press_Stapler_Repeat", 5),
        ("hasty", "Put_Bottles_Dustbin", 2),
    ],
)
def test_a_mistake_without_an_occasion_is_refused(kind: str, name: str, level: int) -> None:
    with pytest.raises(ValueError, match=r"no occasion|nothing to drop"):
        planned(kind, name, level)


def test_a_plan_of_one_call_with_a_tool_has_no_first_part() -> None:
    assert planned("nothing", "Hit_Blocks_Hammer_Order", 3)[1] == ()
    with pytest.raises(ValueError, match="no occasion for 'stops'"):
        planned("stops", "Hit_Blocks_Hammer_Order", 3)
