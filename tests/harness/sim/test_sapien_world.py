"""The SAPIEN world: repeatable to the bit, official timing, honest state."""

import json
import math

import numpy as np
import pytest
from command_line import printed
from world_scenes import READY, block, go_on, joint_action, run_digest, scene, two_blocks, wandering

from robospa.geometry import Pose, look_rotation
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector, inverse
from robospa.harness.sim.bodies import dynamic_body
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.skills import Expert
from robospa.harness.world import ActionError, RenderUnavailable, SceneUnstable
from robospa.observation import CameraSpec
from robospa.protocol.policy import PolicySpec
from robospa.results.records.action_problems import UNREACHABLE
from robospa.tasks.objects import assets, object_model
from robospa.tasks.plan import Open
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot, snapshot_from_json, snapshot_to_json
from robospa.workcell import TABLE_TOP

pytestmark = pytest.mark.sim

BLIND = PolicySpec("blind", cameras=())


@pytest.fixture
def world() -> SapienWorld:
    return SapienWorld(render=False)


def test_a_trial_repeats_to_the_bit_after_another_one(world: SapienWorld) -> None:
    first = run_digest(world, two_blocks(), seed=1)
    run_digest(world, scene(block("one", 0.0, 0.0), block("two", 0.0, 0.1)), seed=2)
    assert run_digest(world, two_blocks(), seed=1) == first
    assert run_digest(world, two_blocks(), seed=2) != first


def test_a_trial_repeats_to_the_bit_in_another_process(world: SapienWorld) -> None:
    code = (
        "from world_scenes import *; from robospa.harness.sim.sapien_world import SapienWorld\n"
        "print(run_digest(SapienWorld(render=False), two_blocks(), seed=1))"
    )
    assert printed(code).split() == [run_digest(world, two_blocks(), seed=1)]


def test_gathering_contacts_changes_nothing(world: SapienWorld) -> None:
    plain = run_digest(world, two_blocks(), seed=3)
    world.load(two_blocks(), contacts=True)
    for action in wandering(4, 3):
        world.step(action, "joint", go_on)
    assert world.digest() == plain


def test_a_loaded_scene_is_at_time_zero_with_arms_at_home(world: SapienWorld) -> None:
    world.load(two_blocks())
    snapshot = world.snapshot()
    assert snapshot.time == 0.0
    assert snapshot.joints == ((0.0,) * 6, (0.0,) * 6)
    assert snapshot.gripper == (1.0, 1.0)
    assert snapshot.poses["one"].position == pytest.approx((-0.1, 0.0, TABLE_TOP + 0.02), abs=1e-3)


def test_an_action_takes_the_official_number_of_steps(world: SapienWorld) -> None:
    world.load(scene())
    home = (0.0,) * 6
    result = world.step(joint_action((0.5, *home[1:]), home), "joint", go_on)
    assert result.physics_steps == 353
    assert world.snapshot().time == pytest.approx(353 / 250)


def test_arms_arrive_where_they_are_told_and_ends_where_kinematics_says(world: SapienWorld) -> None:
    world.load(scene())
    world.step(joint_action(), "joint", go_on)
    snapshot = world.snapshot()
    for arm, pose, joints in zip(
        embodiment("aloha-agilex").arms, snapshot.end_effector, snapshot.measured, strict=True
    ):
        assert joints == pytest.approx(READY, abs=2e-3)
        expected = end_effector(chain_of(arm), joints)
        assert pose.position == pytest.approx(expected.position, abs=1e-5)
        assert pose.rotation == pytest.approx(expected.rotation, abs=1e-5)


def test_ee_brings_the_gripper_to_the_pose(world: SapienWorld) -> None:
    world.load(scene())
    world.step(joint_action(), "joint", go_on)
    target = np.asarray(world.observe(BLIND)["ee"])
    target[:, 2] -= 0.04
    world.step(target.reshape(-1), "ee", go_on)
    assert np.asarray(world.observe(BLIND)["ee"])[:, :7] == pytest.approx(target[:, :7], abs=3e-3)


def test_an_unreachable_pose_is_reported_and_the_arm_holds(world: SapienWorld) -> None:
    world.load(scene())
    target = np.asarray(world.observe(BLIND)["ee"])
    target[0, :3] = 3.0
    result = world.step(target.reshape(-1), "ee", go_on)
    assert [problem.kind for problem in result.problems] == [UNREACHABLE]
    assert world.snapshot().joints[0] == (0.0,) * 6


def test_a_refused_action_moves_nothing(world: SapienWorld) -> None:
    world.load(two_blocks())
    before = world.digest()
    with pytest.raises(ActionError):
        world.step(np.full(14, np.inf, dtype=np.float32), "joint", go_on)
    assert world.digest() == before


def test_polls_come_every_fifth_of_a_tenth_of_a_second(world: SapienWorld) -> None:
    times: list[float] = []

    def poll(snapshot: Snapshot) -> bool:
        times.append(snapshot.time)
        return False

    world.load(scene())
    for grip in (0.0, 0.9, 0.3):
        world.step(joint_action((0.003, 0, 0, 0, 0, 0), (0,) * 6, (grip, 1.0)), "joint", poll)
    assert times == pytest.approx(np.arange(1, len(times) + 1) / 50)


def test_a_poll_can_end_the_action(world: SapienWorld) -> None:
    world.load(scene())
    result = world.step(joint_action(), "joint", lambda snapshot: snapshot.time > 0.1)
    assert (result.physics_steps, result.stopped) == (30, True)
    held = world.snapshot().joints
    world.step(joint_action(*held), "joint", go_on)
    assert world.snapshot().measured[0] == pytest.approx(held[0], abs=5e-3)


def test_state_is_commanded_or_measured(world: SapienWorld) -> None:
    world.load(scene())
    action = joint_action(grip=(0.0, 0.5))
    world.step(action, "joint", go_on)
    commanded = world.observe(BLIND)["state"]
    measured = world.observe(PolicySpec("m", cameras=(), state="measured"))["state"]
    assert commanded == pytest.approx(action)
    assert measured[:6] == pytest.approx(action[:6], abs=2e-3)
    assert 0.0 <= measured[6] < 0.3
    assert commanded.dtype == np.float32


def test_only_what_the_spec_asks_for_is_observed(world: SapienWorld) -> None:
    world.load(scene())
    assert set(world.observe(PolicySpec("n", cameras=(), state="none"))) == {"images", "ee"}


def test_the_privileged_state_is_the_snapshot(world: SapienWorld) -> None:
    world.load(two_blocks())
    seen = world.observe(PolicySpec("p", cameras=(), privileged=True))["privileged"]
    assert snapshot_from_json(seen, embodiment("aloha-agilex").grippers).poses == dict(
        world.snapshot().poses
    )


def test_short_cuts_of_a_snapshot_say_what_its_poses_say(world: SapienWorld) -> None:
    world.load(two_blocks())
    seen = world.snapshot()
    assert seen.contacts == ()  # unless they are asked for
    names = list(seen.poses)
    assert [seen.position(name) for name in names] == [seen.poses[n].position for n in names]
    assert seen.heights([*names, "later"]) == [*(seen.height(name) for name in names), None]
    assert all(seen.height(name) == seen.poses[name].position[2] for name in names)


def test_a_snapshot_stays_as_it_was_when_the_world_moves_on(world: SapienWorld) -> None:
    world.load(two_blocks())
    early, late = world.snapshot(), world.snapshot()
    before = snapshot_to_json(early)
    world.step(joint_action(grip=(0.0, 0.0)), "joint", go_on)
    assert snapshot_to_json(late) == before
    assert snapshot_to_json(world.snapshot()) != before


def test_an_object_appears_at_its_time(world: SapienWorld) -> None:
    world.load(scene(block("one", 0.0, 0.0), block("late", 0.2, 0.0, appears_at=0.1)))
    seen: list[int] = []

    def poll(snapshot: Snapshot) -> bool:
        seen.append(len(snapshot.poses))
        return False

    world.step(joint_action((0,) * 6, (0,) * 6), "joint", poll)
    assert seen == [1, 1, 1, 1, 2, 2, 2, 2, 2, 2]


def test_a_fixed_object_does_not_fall(world: SapienWorld) -> None:
    world.load(scene(block("shelf", 0.0, 0.0, lift=0.3, fixed=True)))
    world.step(joint_action(), "joint", go_on)
    assert world.snapshot().poses["shelf"].position[2] == pytest.approx(TABLE_TOP + 0.32)


def test_a_scene_that_keeps_moving_or_leaves_the_table_is_unstable(world: SapienWorld) -> None:
    with pytest.raises(SceneUnstable, match="object 'falling' of Test_Blocks level 1 seed 100000"):
        world.load(scene(block("falling", 0.0, 0.0, lift=6.0)))
    with pytest.raises(SceneUnstable, match=r"object 'off' .* fell off the table"):
        world.load(scene(block("off", 0.9, 0.0)))


def test_an_object_weighs_what_its_model_says() -> None:
    for name in assets():
        model = object_model(name)
        if model.hinge or not any(shape.collision for shape in model.shapes):
            continue  # always fixed
        _, component = dynamic_body(model, name, Pose(), fixed=False)
        assert component.mass == pytest.approx(model.mass, rel=1e-4), name


def test_contacts_name_both_bodies(world: SapienWorld) -> None:
    world.load(scene(block("low", 0.0, 0.0), block("high", 0.0, 0.0, lift=0.04)), contacts=True)
    world.step(joint_action((0,) * 6, (0,) * 6), "joint", go_on)
    contacts = world.snapshot().contacts
    assert {(c.first, c.second) for c in contacts} == {("high", "low")}
    assert all(c.point[2] == pytest.approx(TABLE_TOP + 0.04, abs=1e-3) for c in contacts)


def test_a_gripper_holds_what_it_closes_on(world: SapienWorld) -> None:
    chain = chain_of(embodiment("aloha-agilex").arms[0])
    down = look_rotation((0, 0, -1), (-1, 0, 0))
    spot = (-0.2, -0.1)
    targets = [Pose((*spot, TABLE_TOP + 0.02 + 0.12 + up), down) for up in (0.1, 0.0)]
    joints, reached = inverse(chain, targets)
    assert reached.all()
    above, around = tuple(joints[0].tolist()), tuple(joints[1].tolist())
    world.load(scene(block("one", *spot)), contacts=True)
    for pose, grip in ((above, 1.0), (around, 1.0), (around, 0.0), (around, 0.0), (above, 0.0)):
        world.step(joint_action(pose, READY, (grip, 1.0)), "joint", go_on)
    snapshot = world.snapshot()
    assert snapshot.poses["one"].position[2] > TABLE_TOP + 0.1
    assert snapshot.gripper_contacts("one")


def test_fixed_rate_lasts_as_long_as_asked() -> None:
    world = SapienWorld(render=False, control="fixed_rate", action_steps=8)
    world.load(scene())
    assert world.step(joint_action(), "joint", go_on).physics_steps == 8


def test_what_a_world_cannot_do_is_said(world: SapienWorld) -> None:
    with pytest.raises(ValueError, match="no control 'warp'"):
        SapienWorld(control="warp")
    with pytest.raises(RuntimeError, match="call load"):
        world.snapshot()
    with pytest.raises(ValueError, match="no colliding shape"):
        dynamic_body(object_model("pad"), "pad", Pose(), fixed=False)
    with pytest.raises(ValueError, match="must be fixed"):
        world.load(with_microwave(fixed=False))
    world.load(scene())
    with pytest.raises(RenderUnavailable, match="render=False"):
        world.render(CameraSpec("head"))


def test_info_is_json_and_names_the_simulator(world: SapienWorld) -> None:
    assert json.loads(json.dumps(world.info()))["simulator"] == "sapien"


@pytest.mark.parametrize(("look", "lift"), [({"look": 2}, 0.0), ({"look": 2, "solid": True}, 1e-3)])
def test_only_a_solid_pad_carries_what_stands_on_it(
    world: SapienWorld, look: dict[str, int], lift: float
) -> None:
    pad = SceneObject("pad", "pad", Pose((0.0, -0.1, TABLE_TOP)), look, fixed=True)
    world.load(scene(pad, block("cube", 0.0, -0.1, lift=2 * lift)))
    found = world.snapshot().poses
    assert found["cube"].position[2] == pytest.approx(TABLE_TOP + 0.02 + lift, abs=2e-4)
    assert found["pad"].position == pytest.approx(pad.pose.position, abs=1e-6)


# ------------------ doors: they swing, stay where they are left, are reported, drawn and repeatable


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


def test_opening_repeats_to_the_bit_and_the_door_stays_where_it_is_left(world: SapienWorld) -> None:
    digests = []
    for _ in range(2):
        world.load(two_blocks())
        before = opened(world, with_microwave()).hinges["oven"]
        digests.append(world.digest())
    assert digests[0] == digests[1]
    for _ in range(10):
        world.step(joint_action(*world.snapshot().joints), "joint", go_on)
    assert world.snapshot().hinges["oven"] == pytest.approx(before, abs=0.01)


def test_scenes_without_doors_report_none(world: SapienWorld) -> None:
    world.load(two_blocks())
    assert world.snapshot().hinges == {}
    assert "hinges" not in snapshot_to_json(world.snapshot())


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
