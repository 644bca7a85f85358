"""How far a gripper opens when it lets go of what it has placed."""

from __future__ import annotations

import pytest
from robot_at_home import at_home

from robospa.geometry import Pose, look_rotation
from robospa.harness.skills.place import release_opening
from robospa.harness.skills.workspace import Workspace
from robospa.tasks.objects import object_model
from robospa.tasks.plan import Place
from robospa.tasks.scene import SceneObject
from robospa.workcell import TABLE_TOP

HALF = 0.018
HEIGHT = TABLE_TOP + HALF
CALL = Place("held", (0.0, 0.0, HEIGHT))


def opening(asset: str, *beside: float) -> float:
    """Value 0..1 with which a UR5 lets go in the middle, other blocks being so far [m] aside."""
    look = {"half": [HALF] * 3, "color": [1.0, 0.0, 0.0]}
    held = SceneObject("held", asset, Pose((0.0, 0.0, HEIGHT)), look if asset == "block" else {})
    others = [
        SceneObject(f"other_{i}", "block", Pose((x, 0.0, HEIGHT)), look)
        for i, x in enumerate(beside)
    ]
    ws: Workspace = at_home("ur5-wsg", held, *others)
    down = look_rotation((0.0, 0.0, -1.0), (1.0, 0.0, 0.0))
    hand = Pose((0.0, 0.0, HEIGHT + ws.hand(1).grip), down)
    return release_opening(ws, 1, hand, hand.inverse() * held.pose, CALL)


def test_with_nothing_near_the_gripper_opens_all_the_way() -> None:
    assert opening("block") == 1.0


def test_beside_a_neighbour_it_opens_less_but_lets_go() -> None:
    ws = at_home("ur5-wsg")
    value = opening("block", 0.08)
    assert ws.robot.arms[1].gripper_value(2 * HALF) < value < 1.0


@pytest.mark.parametrize("beside", [(0.05,), (0.08, -0.05)])
def test_where_a_neighbour_is_touched_anyway_it_opens_all_the_way(
    beside: tuple[float, ...],
) -> None:
    assert opening("block", *beside) == 1.0


def test_what_is_not_made_of_boxes_is_let_go_of_no_narrower_than_it_is() -> None:
    arm, wide = at_home("ur5-wsg").robot.arms[1], object_model("bottle").size[0]
    assert 1.0 > opening("bottle", 0.08) >= arm.gripper_value(wide)
    assert opening("bottle", 0.06) == 1.0
