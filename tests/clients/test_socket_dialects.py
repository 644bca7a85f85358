"""openpi, XPolicyLab, vla-eval: what exactly they are sent, and what becomes of their answers."""

from __future__ import annotations

import itertools
from typing import Any

import msgpack
import numpy as np
import pytest
from standin_base import EE, HEAD, LEFT, QUICK, RIGHT, STATE, TRIAL, image, joint_chunk, observation
from standins import VlaEval, XPolicyLab

from robospa.clients import connect
from robospa.protocol.errors import (
    ConnectionLost,
    HandshakeError,
    PolicyAnswerError,
    ProtocolViolation,
    ServerError,
)

CAMERAS = (HEAD, LEFT, RIGHT)


def of_type(server: Any, key: str, kind: str) -> list[Any]:
    return [request for request in server.requests if request[key] == kind]


# ---------------------------------------------------------------- XPolicyLab


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
        (msgpack.packb([1]), "no map"),
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


# ---------------------------------------------------------------- vla-eval


def test_vla_eval_is_sent_what_its_server_reads() -> None:
    server = VlaEval()
    with server as url, connect(url, timeouts=QUICK) as policy:
        assert policy.hello["server"] == "Dummy 0.8.0"
        policy.reset(TRIAL)
        chunk = policy.infer(observation())
        policy.end({"success": True})
        policy.reset(TRIAL)
        policy.infer(observation())
    assert np.array_equal(chunk, joint_chunk().astype(np.float32))
    kinds = [request["type"] for request in server.requests]
    assert kinds[:4] == ["hello", "episode_start", "observation", "episode_end"]
    assert [request["seq"] for request in server.requests] == list(range(1, 7))
    assert server.requests[1]["payload"]["task"]["name"] == "Pick_Blocks_Size"
    seen = server.requests[2]["payload"]
    names = {"head_camera": HEAD, "left_camera": LEFT, "right_camera": RIGHT}
    assert list(seen["images"]) == list(names)  # in this order
    for theirs, ours in names.items():
        assert seen["images"][theirs].dtype == np.uint8
        assert np.array_equal(seen["images"][theirs], image(ours))
    assert seen["task_description"] == "pick the red block"
    for name in ("joint_state", "state", "states"):
        assert seen[name].dtype == np.float32
        assert np.array_equal(seen[name], STATE)


def test_vla_eval_single_actions_are_chunks_of_one() -> None:
    with VlaEval(lambda seen: STATE) as url, connect(url, timeouts=QUICK) as policy:
        assert np.array_equal(policy.infer(observation()), STATE[None])


def test_vla_eval_order_of_cameras_and_names_of_state() -> None:
    server = VlaEval()
    query = "?cameras=right_wrist,head&state_keys=joint_state&grippers=closed"
    with server as url, connect(url + query, timeouts=QUICK) as policy:
        chunk = policy.infer(observation())
    seen = of_type(server, "type", "observation")[0]["payload"]
    assert list(seen["images"]) == ["right_camera", "head_camera"]
    assert "state" not in seen
    assert chunk[0, 6] == pytest.approx(1 - joint_chunk()[0, 6])
    assert chunk[0, 0] == pytest.approx(joint_chunk()[0, 0])


def test_vla_eval_a_failed_start_does_not_shift_the_actions() -> None:
    """The known defect of its own client: from then on every action is of another observation."""
    server = VlaEval()
    server.broken_start = True
    with server as url, connect(url, timeouts=QUICK) as policy:
        policy.reset(TRIAL)
        with pytest.raises(ServerError, match="earlier message: episode_start_failed"):
            policy.infer(observation())
        with pytest.raises(ConnectionLost):
            policy.infer(observation())
        policy.reconnect()
        policy.reset(TRIAL)
        assert policy.infer(observation()).shape == (3, 14)


def test_vla_eval_another_version_is_refused() -> None:
    server = VlaEval()
    server.version = 99
    with server as url, pytest.raises(HandshakeError, match="version 99"):
        connect(url, timeouts=QUICK)


def test_vla_eval_actions_of_another_size_are_doubted_at_once() -> None:
    with VlaEval() as url, connect(url + "?space=ee", timeouts=QUICK) as policy:
        assert any("announces 14 numbers" in text for text in policy.hello["warnings"])


def test_vla_eval_an_error_leaves_the_connection_good() -> None:
    def model(seen: Any) -> Any:
        if seen["task_description"] == "fail":
            raise KeyError("image")
        return STATE

    with VlaEval(model) as url, connect(url, timeouts=QUICK) as policy:
        with pytest.raises(ServerError, match="observation_failed: KeyError"):
            policy.infer(observation(instruction="fail"))
        assert policy.infer(observation()).shape == (1, 14)


def array(**changes: Any) -> dict[str, Any]:
    good = {"__ndarray__": True, "data": bytes(56), "dtype": "<f4", "shape": [1, 14]}
    return {**good, **changes}


@pytest.mark.parametrize(
    "broken",
    [
        array(dtype="|O"),
        array(dtype="V4"),
        array(dtype="<c8"),
        array(dtype=7),
        array(dtype="f4,("),
        array(dtype="3f4"),
        array(shape=[2, 14]),
        array(shape="x"),
        array(data="text"),
    ],
)
def test_arrays_that_cannot_be_are_refused(broken: Any) -> None:
    frame = msgpack.packb(
        {"type": "action", "payload": {"actions": broken}, "seq": 2, "timestamp": 0.0}
    )
    with (
        VlaEval(None, frame) as url,
        connect(url, timeouts=QUICK) as policy,
        pytest.raises(ProtocolViolation, match="cannot be read"),
    ):
        policy.infer(observation())


# ---------------------------------------------------------------- what servers say of themselves


def test_what_a_server_says_of_itself_can_be_kept() -> None:
    from robospa.protocol.validate import as_said

    said = {"mean": np.array([1.5, np.nan]), b"x": {1: (np.inf, None)}, "odd": object}
    kept = as_said(said)
    assert kept["mean"] == [1.5, "nan"]
    assert kept["b'x'"] == {"1": ["inf", None]}
    assert as_said({"weights": np.zeros(10**5)}).startswith("left out: ")
