"""XPolicyLab's server: what exactly it is sent, and what becomes of its answers."""

from __future__ import annotations

import itertools
from typing import Any

import msgpack
import numpy as np
import pytest
from standins import (
    EE,
    HEAD,
    LEFT,
    RIGHT,
    STATE,
    TRIAL,
    XPolicyLab,
    answered,
    image,
    joint_chunk,
    observation,
    talking,
)

from robospa.protocol.errors import (
    ConnectionLost,
    PolicyAnswerError,
    ProtocolViolation,
    ServerError,
)


def steps(chunk: Any) -> list[dict[str, Any]]:
    """A joint chunk as XPolicyLab's policies answer it."""
    return [
        {
            "left_arm_joint_state": row[:6].astype(np.float32),
            "left_ee_joint_state": row[6:7].astype(np.float32),
            "right_arm_joint_state": row[7:13].astype(np.float32),
            "right_ee_joint_state": row[13:].astype(np.float32),
        }
        for row in chunk
    ]


def test_xpolicylab_is_sent_what_its_server_reads() -> None:
    server = XPolicyLab(lambda seen: steps(joint_chunk()))
    with talking(server) as policy:
        assert policy.hello["server"] == "demo_policy_server"
        policy.reset(TRIAL)
        chunk = policy.infer(observation(5))
        policy.end({"success": True})
        assert policy.last_timing["infer_ms"] == 4.5
    assert np.array_equal(chunk, joint_chunk().astype(np.float32))
    kinds = [request["message_type"] for request in server.requests]
    assert kinds == ["hello", "prepare_case", "reset", "infer", "trial_end"]
    assert len({request["message_id"] for request in server.requests}) == 5
    assert all(request["evaluation_id"] == "robospa" for request in server.requests)
    reset = server.requests[2]
    assert reset["trial_id"] == "5eed" and reset["payload"]["seed"] == TRIAL.policy_seed
    assert reset["payload"]["instruction"] == TRIAL.instruction
    assert reset["payload"]["action_type"] == "joint"
    assert server.requests[3]["step"] == 5
    assert server.requests[4]["payload"]["success"] is True
    seen = server.requests[3]["payload"]["observation"]
    assert seen["data_format_version"] == "v1.0"
    assert seen["instruction"] == "pick the red block"
    assert seen["instructions"] == ["pick the red block"]
    assert seen["env_idx"] == 0
    assert seen["additional_info"] == {"frequency": 30}
    names = {"cam_head": HEAD, "cam_left_wrist": LEFT, "cam_right_wrist": RIGHT}
    assert seen["vision"].keys() == names.keys()
    for theirs, ours in names.items():
        assert seen["vision"][theirs]["color"].dtype == np.uint8
        assert np.array_equal(seen["vision"][theirs]["color"], image(ours))


def test_xpolicylab_state_is_split_by_arm() -> None:
    server = XPolicyLab(lambda seen: steps(joint_chunk()))
    with talking(server) as policy:
        policy.infer(observation())
    state = server.requests[-1]["payload"]["observation"]["state"]
    assert all(value.dtype == np.float32 for value in state.values())
    assert np.array_equal(state["left_arm_joint_state"], STATE[:6])
    assert np.array_equal(state["left_ee_joint_state"], STATE[6:7])
    assert np.array_equal(state["right_arm_joint_state"], STATE[7:13])
    assert np.array_equal(state["right_ee_joint_state"], STATE[13:])
    assert np.array_equal(state["left_ee_pose"], EE[0, :7])
    assert np.array_equal(state["right_ee_pose"], EE[1, :7])
    # Turned by 90 deg about z, the frame's x axis is the world's y axis.
    ahead = EE[1, :3] + [0, 0.12, 0]
    assert state["right_tcp_pose"][:3] == pytest.approx(ahead, abs=1e-6)
    assert np.array_equal(state["right_tcp_pose"][3:], EE[1, 3:7])


def test_xpolicylab_answers_poses() -> None:
    pose = {"left_ee_pose": EE[0, :7], "right_ee_pose": EE[1, :7]}
    grip = {"left_ee_joint_state": np.ones(1), "right_ee_joint_state": np.zeros(1)}
    with talking(XPolicyLab(lambda seen: [pose | grip]), "?space=ee") as policy:
        chunk = policy.infer(observation())
    assert chunk.shape == (1, 16)
    assert np.array_equal(chunk[0, :7], EE[0, :7])
    assert np.array_equal(chunk[0, 8:15], EE[1, :7])
    assert chunk[0, [7, 15]].tolist() == [1, 0]


def test_xpolicylab_grippers_can_be_turned_round() -> None:
    with talking(XPolicyLab(lambda seen: np.zeros((1, 14))), "?grippers=closed") as policy:
        assert policy.infer(observation())[0].tolist() == [0] * 6 + [1] + [0] * 6 + [1]


def ask(answer: Any, query: str = "") -> Any:
    """The chunk that our client makes of `answer`."""
    return answered(XPolicyLab(lambda seen: answer), query)


def test_a_gripper_that_is_not_named_stays_when_grippers_are_turned_round() -> None:
    chunk = ask([{"right_arm_joint_state": np.ones(6)}], "?grippers=closed")
    assert chunk[0, [6, 13]] == pytest.approx(STATE[[6, 13]])


def test_what_is_not_named_stays_where_it_was_commanded_last() -> None:
    """RoboTwin's client falls back on the joint targets after the action before."""
    chunk = ask(
        [{"left_arm_joint": np.ones(6), "left_gripper": 0.25}, {"right_arm_joint": [2] * 6}]
    )
    assert chunk[1].tolist() == pytest.approx([1] * 6 + [0.25] + [2] * 6 + [STATE[13]])


JOINTS = np.arange(6) / 10
NAMES = {
    "left_arm_joint_state": slice(0, 6),
    "left_arm_joint": slice(0, 6),
    "left_joint_state": slice(0, 6),
    "arm_joint_state": slice(0, 6),
    "joint_state": slice(0, 6),
    "right_arm_joint_state": slice(7, 13),
    "right_arm_joint": slice(7, 13),
    "right_joint_state": slice(7, 13),
}
GRIPPERS = {
    "left_ee_joint_state": 6,
    "left_gripper": 6,
    "left_gripper_pos": 6,
    "ee_joint_state": 6,
    "right_ee_joint_state": 13,
    "right_gripper": 13,
    "right_gripper_pos": 13,
}
POSES = {
    "left_ee_pose": slice(0, 7),
    "left_endpose": slice(0, 7),
    "ee_pose": slice(0, 7),
    "right_ee_pose": slice(8, 15),
    "right_endpose": slice(8, 15),
}


@pytest.mark.parametrize("name", NAMES)
def test_every_name_of_joints_that_robotwins_client_takes(name: str) -> None:
    assert ask([{name: JOINTS}])[0, NAMES[name]] == pytest.approx(JOINTS)


@pytest.mark.parametrize("name", GRIPPERS)
def test_every_name_of_a_gripper_that_robotwins_client_takes(name: str) -> None:
    for value in (0.125, [0.125], np.float32(0.125)):
        chunk = ask([{"left_arm_joint_state": JOINTS, name: value}])
        assert chunk[0, GRIPPERS[name]] == 0.125


@pytest.mark.parametrize("name", POSES)
def test_every_name_of_a_pose_that_robotwins_client_takes(name: str) -> None:
    chunk = ask([{name: EE[1, :7], "action_type": "endpose"}], "?space=ee")
    assert np.array_equal(chunk[0, POSES[name]], EE[1, :7])


def test_the_usual_name_wins_and_names_of_the_other_space_are_ignored() -> None:
    action = {"left_arm_joint": JOINTS, "left_arm_joint_state": JOINTS + 1, "left_ee_pose": [9] * 7}
    assert ask([action | {"action_type": "QPOS"}])[0, :6] == pytest.approx(JOINTS + 1)


@pytest.mark.parametrize(
    "answer", [np.arange(14.0), list(range(14)), {"actions": np.arange(14.0)}], ids=type
)
def test_one_action_without_a_list_around_it(answer: Any) -> None:
    assert ask(answer).tolist() == [list(range(14))]


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        ([{"left_ee_pose": np.ones(7)}], "is option space its action_type"),
        ([{"left_arm_joint_state": np.ones(7)}], "7 values of float64 as left_arm_joint_state"),
        ([{"left_arm_joint_state": ["a"] * 6}], "6 values of <U1 as left_arm_joint_state"),
        ([{"left_arm_joint_state": [[1, 2], [3]]}], "uneven"),
        ([3, {"left_arm_joint_state": np.ones(6)}], "a int among them"),
        (
            [{"left_arm_joint": np.ones(6), "left_grip": 1}],
            "left_grip, which .* did you mean left_gripper",
        ),
        ([{"left_arm_joint": np.ones(6), "action_type": "ee"}], r"write \?space=ee"),
        (
            [{"left_arm_joint": np.ones(6), "action_type": "delta"}],
            "action_type 'delta', not joint",
        ),
    ],
)
def test_xpolicylab_actions_that_name_the_wrong_things(answer: Any, reason: str) -> None:
    with pytest.raises(PolicyAnswerError, match=reason):
        ask(answer)


def test_foreign_names_are_safe_to_print_and_short() -> None:
    action = {f"\x1b[31mred{n}\n": 1 for n in range(1000)}
    for answer in ([action], {"actions": [[0] * 14], "x": action}):
        with pytest.raises(PolicyAnswerError) as caught:
            ask(answer)
        assert str(caught.value).isprintable() and len(str(caught.value)) < 600


def test_xpolicylab_a_failed_reset_is_an_error_and_a_failed_preparation_is_not() -> None:
    server = XPolicyLab(lambda seen: np.zeros((1, 14)))
    with talking(server) as policy:
        server.broken = ("prepare_case",)
        policy.reset(TRIAL)
        assert policy.infer(observation()).shape == (1, 14)
        server.broken = ("reset",)
        with pytest.raises(ServerError, match="reset failed"):
            policy.reset(TRIAL)


def test_xpolicylab_an_error_leaves_the_connection_good() -> None:
    answers = itertools.chain([ValueError("no such camera")], itertools.repeat(None))

    def model(seen: Any) -> Any:
        trouble = next(answers)
        if trouble is not None:
            raise trouble
        return np.zeros((1, 14))

    with talking(XPolicyLab(model)) as policy:
        with pytest.raises(ServerError, match="INFER_FAILED: no such camera"):
            policy.infer(observation())
        assert policy.infer(observation()).shape == (1, 14)


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (b"\xc1", "cannot be read"),
        ("hello", "a text frame"),
        (msgpack.packb([1]), "not a map"),
        (msgpack.packb({"a": 1}), "no message of XPolicyLab"),
        (
            msgpack.packb({"message_type": "infer_result", "message_id": "9", "payload": {}}),
            "came to",
        ),
        (msgpack.packb(msgpack.ExtType(4, b"x")), "cannot be read"),
    ],
)
def test_xpolicylab_frames_that_are_no_answer(frame: Any, reason: str) -> None:
    with talking(XPolicyLab(None, frame)) as policy:
        with pytest.raises(ProtocolViolation, match=reason):
            policy.infer(observation())
        with pytest.raises(ConnectionLost):
            policy.infer(observation())
