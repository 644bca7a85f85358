"""Grasps of what has fallen over, and which of them a hand that goes on to place takes."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from robot_at_home import at_home

from robospa.geometry import Pose, axis_rotation, multiply, rotate
from robospa.harness.robots import embodiment
from robospa.harness.skills import pick
from robospa.harness.skills.arm_clearance import TOUCH
from robospa.harness.skills.grasping import SPARE_OPENING, world_grasps
from robospa.harness.skills.workspace import Workspace
from robospa.tasks.objects import object_model
from robospa.tasks.plan import Pick
from robospa.tasks.scene import SceneObject
from robospa.workcell import TABLE_TOP

FRANKA = embodiment("franka-panda").grippers[0]
HALF = 0.018


def lying(roll: float) -> Pose:
    """Along the world's x axis, rolled by `roll` [rad]."""
    over = axis_rotation((0.0, 1.0, 0.0), math.pi / 2)
    return Pose((0.2, 0.0, 0.8), multiply(over, axis_rotation((0.0, 0.0, 1.0), roll)))


@pytest.mark.parametrize("roll", [0.0, 0.4, math.pi / 4, 1.2])
def test_a_lying_bottle_is_grasped_across_however_it_has_rolled(roll: float) -> None:
    model = object_model("bottle")
    found = world_grasps(model, lying(roll), embodiment("ur5-wsg").grippers[0])
    assert found
    for grasp in found:
        along = rotate(lying(roll).rotation, (0.0, 0.0, 1.0))
        assert abs(sum(a * b for a, b in zip(grasp.closing, along, strict=True))) < 1e-6
        assert abs(grasp.closing[2]) < 0.5


def test_what_is_too_wide_when_it_lies_is_grasped_by_one_of_its_parts() -> None:
    cup = object_model("cup")
    assert min(cup.size) > FRANKA.opening
    found = world_grasps(cup, lying(0.0), FRANKA)
    assert found and all(grasp.width < FRANKA.opening for grasp in found)


def test_what_a_hand_grasps_when_it_stands_it_grasps_when_it_lies() -> None:
    bottle = object_model("pill_bottle")
    standing = max(grasp.width for grasp in bottle.grasps)
    narrow = replace(FRANKA, opening=standing + SPARE_OPENING)
    assert min(bottle.size) > standing
    for roll in (0.0, 0.8):
        widths = [grasp.width for grasp in world_grasps(bottle, lying(roll), narrow)]
        assert widths and max(widths) <= standing + 1e-6


def tower_beside() -> Workspace:
    """A Piper, a block, and a tower of three so near that a level hand is in it."""
    look = {"half": [HALF] * 3, "color": [1.0, 0.0, 0.0]}
    places = [(0.037, -0.033, 0), (0.0, -0.115, 0), (0.0, -0.115, 1), (0.0, -0.115, 2)]
    return at_home(
        "piper",
        *(
            SceneObject(f"block_{i}", "block", Pose((x, y, TABLE_TOP + HALF * (1 + 2 * n))), look)
            for i, (x, y, n) in enumerate(places)
        ),
    )


def test_a_hand_that_goes_on_to_place_leans_before_it_touches_a_tower() -> None:
    call = Pick("block_0", lift=0.2, arm="right")
    straight, *_ = pick._choose(tower_beside(), call, [], None)
    careful, *_ = pick._choose(tower_beside(), call, [], lambda _: True)
    assert straight.depth > TOUCH
    assert careful.depth <= TOUCH
