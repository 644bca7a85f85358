"""XPolicyLab's server: what exactly it is sent, and what becomes of its answers."""

from __future__ import annotations

import itertools
from typing import Any

import msgpack
import numpy as np
import pytest
from standin_base import EE, HEAD, LEFT, QUICK, RIGHT, STATE, TRIAL, image, joint_chunk, observation
from standins import XPolicyLab

from robospa.clients import connect
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
    with server as url, connect(url, timeouts=QUICK) as policy:
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
    assert reset["trial_id"] == "Pick_Blocks_Size-L3-100007"
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
    with server as url, connect(url, timeouts=QUICK) as policy:
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
    with (
        XPolicyLab(lambda seen: [pose | grip]) as url,
        connect(url + "?space=ee", timeouts=QUICK) as policy,
    ):
        chunk = policy.infer(observation())
    assert chunk.shape == (1, 16)
    assert np.array_equal(chunk[0, :7], EE[0, :7])
    assert np.array_equal(chunk[0, 8:15], EE[1, :7])
    assert chunk[0, [7, 15]].tolist() == [1, 0]


def test_xpolicylab_what_is_not_named_stays() -> None:
    with (
        XPolicyLab(lambda seen: [{"right_arm_joint_state": np.ones(6)}]) as url,
        connect(url, timeouts=QUICK) as policy,
    ):
        chunk = policy.infer(observation())
    assert np.array_equal(chunk[0, :7], STATE[:7])
    assert chunk[0, 7:13].tolist() == [1] * 6
    assert chunk[0, 13] == STATE[13]


def test_xpolicylab_grippers_can_be_turned_round() -> None:
    with (
        XPolicyLab(lambda seen: np.zeros((1, 14))) as url,
        connect(url + "?grippers=closed", timeouts=QUICK) as policy,
    ):
        assert policy.infer(observation())[0].tolist() == [0] * 6 + [1] + [0] * 6 + [1]


@pytest.mark.parametrize(
    "answer",
    [
        [{"left_ee_pose": np.ones(7)}],
        [{"left_arm_joint_state": np.ones(7)}],
        [3, {"left_arm_joint_state": np.ones(6)}],
    ],
)
def test_xpolicylab_actions_that_name_the_wrong_things(answer: Any) -> None:
    with (
        XPolicyLab(lambda seen: answer) as url,
        connect(url, timeouts=QUICK) as policy,
        pytest.raises(PolicyAnswerError, match="the policy answered"),
    ):
        policy.infer(observation())


def test_xpolicylab_a_failed_reset_is_an_error_and_a_failed_preparation_is_not() -> None:
    server = XPolicyLab(lambda seen: np.zeros((1, 14)))
    with server as url, connect(url, timeouts=QUICK) as policy:
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

    with XPolicyLab(model) as url, connect(url, timeouts=QUICK) as policy:
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
    with XPolicyLab(None, frame) as url, connect(url, timeouts=QUICK) as policy:
        with pytest.raises(ProtocolViolation, match=reason):
            policy.infer(observation())
        with pytest.raises(ConnectionLost):
            policy.infer(observation())
