"""The five robots are the ones that the official simulator loads."""

import numpy as np
import pytest
from official_arms import ARMS, description

from robospa.geometry import Pose, to_transform
from robospa.harness.robots import embodiment, embodiments
from robospa.harness.robots.embodiment import Arm
from robospa.harness.robots.kinematics import chain_of, end_effector, forward, inverse

KEYS = sorted(ARMS)

ROBOTS = sorted({name for name, _ in KEYS})


def arm_of(key: tuple[str, str]) -> Arm:
    name, side = key
    return embodiment(name).arms[side == "right"]


def test_all_five_are_installed() -> None:
    assert set(embodiments()) == {name for name, _ in KEYS} and len(ROBOTS) == 5


@pytest.mark.parametrize("key", KEYS, ids="-".join)
def test_the_end_effector_is_where_a_library_finds_it_in_the_official_description(
    key: tuple[str, str],
) -> None:
    sapien = pytest.importorskip("sapien")
    official = ARMS[key]
    count = len(official.joints)
    model = sapien.PinocchioModel(description(official), [0, 0, -9.81])
    model.set_joint_order([f"joint{i}" for i in range(1, count + 1)])
    model.set_link_order(["ee"])
    postures = np.random.default_rng(1).uniform(-3, 3, (100, count))
    frames, _ = forward(chain_of(arm_of(key)), postures)
    for joints, frame in zip(postures, frames, strict=True):
        model.compute_forward_kinematics(joints)
        pose = model.get_link_pose(0)
        found = to_transform(Pose(tuple(pose.p), tuple(pose.q)))
        assert np.abs(frame - found).max() < 1e-5  # its poses have single precision


@pytest.mark.parametrize("name", ROBOTS)
def test_twenty_thousand_postures(name: str) -> None:
    # frames are rigid, and the Jacobian is the derivative
    chain = chain_of(embodiment(name).arms[0])
    rng = np.random.default_rng(3)
    low, high = chain.working_lower, chain.working_upper
    joints = rng.uniform(low, high, (20_000, len(low)))
    frames, jacobian = forward(chain, joints)
    turn = frames[:, :3, :3]
    assert np.abs(np.einsum("nij,nik->njk", turn, turn) - np.eye(3)).max() < 1e-12
    assert (np.cross(turn[:, :, 0], turn[:, :, 1]) * turn[:, :, 2]).sum(axis=1).min() > 0.999
    step = 1e-5 * rng.uniform(-1, 1, joints.shape)
    moved = forward(chain, joints + step)[0][:, :3, 3] - frames[:, :3, 3]
    assert np.abs(moved - np.einsum("nij,nj->ni", jacobian[:, :3], step)).max() < 1e-8


@pytest.mark.parametrize("name", ROBOTS)
def test_inverse_comes_back_from_where_forward_went(name: str) -> None:
    chain = chain_of(embodiment(name).arms[1])
    rng = np.random.default_rng(5)
    low, high = chain.working_lower, chain.working_upper
    middle = np.asarray(chain.seeds[0])
    joints = np.clip(middle + rng.uniform(-0.3, 0.3, (300, len(low))), low + 0.05, high - 0.05)
    poses = [end_effector(chain, row) for row in joints]
    found, reached = inverse(chain, poses)
    frames, _ = forward(chain, found[reached])
    wanted, _ = forward(chain, joints[reached])
    assert reached.mean() > 0.85  # not every solution is found from the start postures
    assert np.abs(frames - wanted).max() < 1e-4
    assert (found >= low - 1e-9).all() and (found <= high + 1e-9).all()


GRIPPERS = {
    "aloha-agilex": (0.0, 0.09, 0.088),
    "ARX-X5": (0.0, 0.088, 0.088),
    "piper": (0.0, 0.08, 0.08),
    "franka-panda": (0.0, 0.08, 0.08),
    "ur5-wsg": (0.0054, 0.11, 0.11),
}

"""Opening [m] at the values 0 and 1 as joint limits cut it, and the most that skills use."""


@pytest.mark.parametrize("name", ROBOTS)
def test_grippers_open_as_far_as_their_joints_let_them(name: str) -> None:
    for arm in embodiment(name).arms:
        limits = {(finger.lower, finger.upper) for finger in arm.fingers}
        assert len(limits) == 1
        least, most = limits.pop()
        closed, opened = (2 * min(max(value, least), most) for value in arm.travel)
        assert (closed, opened, arm.gripper.opening) == pytest.approx(GRIPPERS[name])
        assert arm.gripper.gap == pytest.approx(closed)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_gripper_value_gives_the_opening_that_is_asked_for(name: str) -> None:
    arm = embodiment(name).arms[0]
    closed, opened = arm.travel
    for opening in np.linspace(max(arm.gripper.gap, 0.001), arm.gripper.opening, 9):
        value = arm.gripper_value(float(opening))
        assert 0 <= value <= 1
        assert 2 * (closed + value * (opened - closed)) == pytest.approx(opening)


@pytest.mark.parametrize("key", KEYS, ids="-".join)
def test_fingers_close_around_the_grasp_centre(key: tuple[str, str]) -> None:
    # in the end-effector frame: both slide along y, in opposite directions, on one level
    arm = arm_of(key)
    ways = []
    for finger in arm.fingers:
        origin = arm.tool.inverse() * finger.origin
        assert abs(origin.position[2]) < 1e-3 and 0 < origin.position[0] < arm.gripper.tip
        ways.append(origin.apply(finger.axis)[1] - origin.position[1])
    assert sorted(ways) == pytest.approx([-1.0, 1.0], abs=1e-6)


@pytest.mark.parametrize(
    ("name", "canonical"),
    [
        ("piper", "piper"),
        ("piper:0.6", "piper"),
        ("piper:0.60", "piper"),
        ("piper+piper:0.6", "piper"),
        ("piper:0.7", "piper:0.7"),
        ("piper+franka-panda:0.6", "piper+franka-panda:0.6"),
        ("aloha-agilex", "aloha-agilex"),
    ],
)
def test_equal_robots_have_one_name(name: str, canonical: str) -> None:
    robot = embodiment(name)
    assert robot.name == canonical
    assert embodiment(canonical).arms == robot.arms


@pytest.mark.parametrize("name", ["ARX-X5", "piper", "franka-panda", "ur5-wsg"])
def test_bases_stand_the_distance_apart(name: str) -> None:
    robot = embodiment(name)
    left, right = (arm.base.position for arm in robot.arms)
    assert (left[0], right[0]) == (-robot.distance / 2, robot.distance / 2)
    wider = embodiment(f"{name}:0.9")
    for arm, moved, x in zip(robot.arms, wider.arms, (-0.45, 0.45), strict=True):
        assert moved.base.position == (x, *arm.base.position[1:])
        assert moved.base.rotation == arm.base.rotation


def test_a_pair_has_the_left_arm_of_one_and_the_right_arm_of_the_other() -> None:
    pair, left, right = (embodiment(n) for n in ("piper+franka-panda:0.6", "piper", "franka-panda"))
    assert pair.arms[0] == left.arms[0] and pair.arms[0].base.position == (-0.3, -0.45, 0.75)
    assert pair.arms[1].base.position == (0.3, -0.65, 0.75)
    assert pair.arms[1].joints == right.arms[1].joints
    assert pair.grippers == (left.grippers[0], right.grippers[1])
    assert pair.action_space("joint").joints == (6, 7)
    near, far = (
        end_effector(chain_of(robot.arms[1]), right.arms[1].home) for robot in (pair, right)
    )
    assert far.position[0] - near.position[0] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("piper+franka-panda", "write piper.franka-panda:0.6"),
        ("piper:near", "'near'; it has to be from 0.3 to 1.2 m"),
        ("piper:3", "'3'; it has to be from"),
        ("piper:nan", "'nan'; it has to be from"),
        ("aloha-agilex:0.5", "arms of aloha-agilex stand together"),
        ("aloha-agilex+piper:0.6", "arms of aloha-agilex stand together"),
        ("a+b+c:0.6", "names no robot"),
        ("", "names no robot"),
        ("piper+fanka-panda:0.6", "did you mean franka-panda"),
    ],
)
def test_what_is_wrong_with_a_name_is_said(name: str, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        embodiment(name)
