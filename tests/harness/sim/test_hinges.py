"""Doors in the world: they swing, stay where they are left, are reported, drawn and repeatable."""

import math

import pytest
from world_scenes import block, go_on, joint_action, scene, two_blocks

from robospa.geometry import Pose
from robospa.harness.robots import embodiment
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.skills import Expert
from robospa.observation import CameraSpec
from robospa.tasks.objects import object_model
from robospa.tasks.plan import Open
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot, snapshot_from_json, snapshot_to_json
from robospa.workcell import TABLE_TOP

pytestmark = pytest.mark.sim


@pytest.fixture
def world() -> SapienWorld:
    return SapienWorld(render=False)


def with_microwave(x: float = -0.07, fixed: bool = True) -> Scene:
    oven = SceneObject("oven", "microwave", Pose((x, 0.17, TABLE_TOP)), {"look": 2}, fixed)
    return scene(block("one", 0.15, -0.1), oven)


def opened(world: SapienWorld, loaded: Scene) -> Snapshot:
    """The expert opens the door; the state afterwards."""
    world.load(loaded)
    expert = Expert(loaded, world.snapshot(), (Open("oven", arm="left"),))
    for _ in range(3):
        for row in expert.next(world.snapshot()):
            world.step(row, "joint", go_on)
    assert expert.failures == []
    return world.snapshot()


def test_a_door_starts_closed_opens_by_its_handle_and_is_told_in_json(world: SapienWorld) -> None:
    world.load(with_microwave())
    assert world.snapshot().hinges == {"oven": pytest.approx(0.0, abs=1e-3)}
    hinge = object_model("microwave").hinge
    assert hinge is not None
    seen = opened(world, with_microwave())
    assert seen.hinges["oven"] > 0.6 * hinge.upper
    again = snapshot_from_json(snapshot_to_json(seen), embodiment("aloha-agilex").grippers)
    assert again.hinges == seen.hinges


def test_a_door_stays_where_it_is_left(world: SapienWorld) -> None:
    before = opened(world, with_microwave()).hinges["oven"]
    for _ in range(10):
        world.step(joint_action(*world.snapshot().joints), "joint", go_on)
    assert world.snapshot().hinges["oven"] == pytest.approx(before, abs=0.01)


def test_opening_changes_the_digest_and_repeats_to_the_bit(world: SapienWorld) -> None:
    world.load(with_microwave())
    closed = world.digest()
    opened(world, with_microwave())
    first = world.digest()
    assert first != closed
    world.load(two_blocks())
    opened(world, with_microwave())
    assert world.digest() == first


def test_scenes_without_doors_report_none(world: SapienWorld) -> None:
    world.load(two_blocks())
    assert world.snapshot().hinges == {}
    assert "hinges" not in snapshot_to_json(world.snapshot())


def test_a_thing_that_opens_must_be_fixed() -> None:
    with pytest.raises(ValueError, match="must be fixed"):
        SapienWorld(render=False).load(with_microwave(fixed=False))


def test_an_open_door_is_drawn_where_it_is() -> None:
    world = SapienWorld()
    world.load(with_microwave())
    camera = CameraSpec("head", 160, 120)
    before = world.render(camera).astype(int)
    opened(world, with_microwave())
    after = world.render(camera).astype(int)
    red = (after[..., 0] > 90) & (after[..., 1] < 70)
    was = (before[..., 0] > 90) & (before[..., 1] < 70)
    assert (red & ~was).sum() > 100
    world.close()


def test_a_hinge_turns_about_its_axis() -> None:
    """The microwave's door, turned by 90 degrees, points from its hinge towards the robot."""
    hinge = object_model("microwave").hinge
    assert hinge is not None
    x, y, _ = hinge.point
    at = hinge.turned(math.pi / 2).apply((x + 0.1, y, 0.05))
    assert at == pytest.approx((x, y - 0.1, 0.05))
