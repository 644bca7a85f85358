"""The five robots are the ones that the official simulator loads."""

from dataclasses import dataclass

import numpy as np
import pytest

from robospa.geometry import Pose, to_transform
from robospa.harness.robots import embodiment, embodiments
from robospa.harness.robots.embodiment import Arm
from robospa.harness.robots.kinematics import chain_of, end_effector, forward, inverse

# --- joint chains of the five as the official simulator loads them: robots are held against them

Q = "1.5707963267948966"
X, Y, Z = "1 0 0", "0 1 0", "0 0 1"

ALOHA = (
    ("0 0 0.058", "0 0 0", Z),
    ("0.025013 0.00060169 0.042", "0 0 0", Y),
    ("-0.26396 0.0044548 0", "-3.1416 0 -0.015928", Y),
    ("0.246 -0.00025 -0.06", "0 0 0", Y),
    ("0.06775 0.0015 -0.0855", "0 0 -0.015928", Z),
    ("0.03095 0 0.0855", "-3.1416 0 0", X),
)
X5 = (
    ("0 0 0.0605", "0 0 0", Z),
    ("0.02 0 0.04", "0 0 0", Y),
    ("-0.264 0 0", "3.1416 0 0", Y),
    ("0.245 0 -0.056", "0 0 0", Y),
    ("0.06775 0.0005 -0.0865", "0 0 0", Z),
    ("0.02895 0 0.0865", "-3.1416 0 0", X),
)
PIPER = (
    ("0 0 0.123", "0 0 -1.5708", Z),
    ("0 0 0", "1.5708 0 -1.5708", Z),
    ("0.28358 0.028726 0", "0 0 0.10095", Z),
    ("-0.24221 0.068514 0", "-1.5708 0 1.3826", Z),
    ("0 0 0", "1.5708 0 0", Z),
    ("0 0.091 0.0014165", "-1.5708 -3.1415926 0", Z),
)
PANDA = (
    ("0 0 0.333", "0 0 0", Z),
    ("0 0 0", f"-{Q} 0 0", Z),
    ("0 -0.316 0", f"{Q} 0 0", Z),
    ("0.0825 0 0", f"{Q} 0 0", Z),
    ("-0.0825 0.384 0", f"-{Q} 0 0", Z),
    ("0 0 0", f"{Q} 0 0", Z),
    ("0.088 0 0", f"{Q} 0 0", Z),
)
UR5 = (
    ("0 0 0.089159", "0 0 0", Z),
    ("0 0.13585 0", f"0 {Q} 0", Y),
    ("0 -0.1197 0.425", "0 0 0", Y),
    ("0 0 0.39225", f"0 {Q} 0", Y),
    ("0 0.093 0", "0 0 0", Z),
    ("0 0 0.09465", "0 0 0", Y),
)


@dataclass(frozen=True)
class OfficialArm:
    """`root` and `base` one after the other place the first link, `tool` is in the last one."""

    joints: tuple[tuple[str, str, str], ...]
    base: tuple[str, str]
    tool: tuple[str, str] = ("0 0 0", "0 0 0")
    root: tuple[str, str] = ("0 0 0", "0 0 0")


STAND = ("0 -0.65 0", f"0 0 {Q}")
SIDES = ("left", "right")
ARMS: dict[tuple[str, str], OfficialArm] = {
    ("aloha-agilex", "left"): OfficialArm(ALOHA, ("0.2305 0.297 0.782", "0 0 0.02"), root=STAND),
    ("aloha-agilex", "right"): OfficialArm(ALOHA, ("0.2315 -0.3063 0.781", "0 0 0.01"), root=STAND),
    ("ur5-wsg", "left"): OfficialArm(UR5, ("-0.4 -0.65 0.65", "0 0 0"), ("0 0.0723 0", f"0 0 {Q}")),
    ("ur5-wsg", "right"): OfficialArm(UR5, ("0.4 -0.65 0.75", "0 0 0"), ("0 0.0723 0", f"0 0 {Q}")),
}
for side, sign in zip(SIDES, ("-", ""), strict=True):
    ARMS["ARX-X5", side] = OfficialArm(X5, (f"{sign}0.3 -0.35 0.784", f"0 0 {Q}"))
    ARMS["piper", side] = OfficialArm(
        PIPER, (f"{sign}0.3 -0.45 0.75", f"0 0 {Q}"), ("0 0 0", f"0 -{Q} 0")
    )
    ARMS["franka-panda", side] = OfficialArm(
        PANDA, (f"{sign}0.4 -0.65 0.75", f"0 0 {Q}"), ("0 0 0.067", f"0 -{Q} 2.356194490192345")
    )


def description(arm: OfficialArm) -> str:
    """URDF of an arm from the world to `ee`, the official end-effector frame."""
    last = len(arm.joints)
    joints = [
        _joint("stand", "fixed", "world", "root", *arm.root, Z),
        _joint("mount", "fixed", "root", "link0", *arm.base, Z),
        _joint("tool", "fixed", f"link{last}", "ee", *arm.tool, Z),
    ]
    joints += [
        _joint(f"joint{i}", "revolute", f"link{i - 1}", f"link{i}", xyz, rpy, axis)
        for i, (xyz, rpy, axis) in enumerate(arm.joints, 1)
    ]
    names = ["world", "root", "ee", *(f"link{i}" for i in range(last + 1))]
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    links = [
        f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial></link>'
        for name in names
    ]
    return "<robot name='arm'>" + "".join(links + joints) + "</robot>"


def _joint(name: str, kind: str, parent: str, child: str, xyz: str, rpy: str, axis: str) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        '<limit lower="-10" upper="10" effort="1" velocity="1"/></joint>'
    )


# --- robots

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
