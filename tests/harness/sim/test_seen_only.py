"""Objects that are there to be seen only: fixed, drawn, and in nobody's way."""

from __future__ import annotations

import pytest

from robospa.geometry import Pose
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene, SceneObject
from robospa.workcell import TABLE_TOP

pytestmark = pytest.mark.sim

PAD = SceneObject("pad", "pad", Pose((0.0, -0.1, TABLE_TOP)), {"look": 2}, fixed=True)
CUBE = SceneObject("cube", "block", Pose((0.0, -0.1, TABLE_TOP + 0.02)), {"look": 0})


def scene_with(*objects: SceneObject) -> Scene:
    return Scene("Test", 1, 0, "aloha-agilex", "default", objects, {})


def test_a_pad_that_is_only_seen_carries_nothing() -> None:
    from robospa.harness.sim.sapien_world import SapienWorld

    world = SapienWorld(render=False)
    world.load(scene_with(PAD, CUBE))
    assert world.snapshot().poses["cube"].position[2] == pytest.approx(TABLE_TOP + 0.02, abs=2e-4)
    assert world.snapshot().poses["pad"].position == pytest.approx((0.0, -0.1, TABLE_TOP), abs=1e-6)


def test_a_solid_pad_carries_what_stands_on_it() -> None:
    from robospa.harness.sim.sapien_world import SapienWorld

    solid = SceneObject("pad", "pad", PAD.pose, {"look": 2, "solid": True}, fixed=True)
    above = SceneObject("cube", "block", Pose((0.0, -0.1, TABLE_TOP + 0.022)), {"look": 0})
    world = SapienWorld(render=False)
    world.load(scene_with(solid, above))
    assert world.snapshot().poses["cube"].position[2] == pytest.approx(TABLE_TOP + 0.021, abs=3e-4)


def test_what_moves_must_be_able_to_collide() -> None:
    from robospa.harness.sim.bodies import dynamic_body

    with pytest.raises(ValueError, match="no colliding shape"):
        dynamic_body(object_model("pad"), "pad", Pose(), fixed=False)
