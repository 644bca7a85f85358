"""A vla-eval server: what exactly it is sent, and what becomes of its answers."""

from __future__ import annotations

from typing import Any

import msgpack
import numpy as np
import pytest
from standins import (
    HEAD,
    LEFT,
    QUICK,
    RIGHT,
    STATE,
    TRIAL,
    VlaEval,
    answered,
    image,
    joint_chunk,
    observation,
    talking,
)

from robospa.clients import connect
from robospa.protocol.errors import (
    ConnectionLost,
    HandshakeError,
    ProtocolViolation,
    ServerError,
)


def test_vla_eval_is_sent_what_its_server_reads() -> None:
    server = VlaEval()
    with talking(server) as policy:
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
    task = server.requests[1]["payload"]["task"]
    assert (task["name"], task["suite"]) == ("Pick_Blocks_Size", "robotwin")
    seen = server.requests[2]["payload"]
    names = {"head_camera": HEAD, "left_camera": LEFT, "right_camera": RIGHT}
    assert list(seen["images"]) == list(names)  # in this order
    for theirs, ours in names.items():
        assert seen["images"][theirs].dtype == np.uint8
        assert np.array_equal(seen["images"][theirs], image(ours))
    assert seen["task_description"] == "pick the red block"
    assert seen.keys() == {"images", "task_description", "joint_state"}
    assert seen["joint_state"].dtype == np.float64
    assert np.array_equal(seen["joint_state"], STATE)


def test_vla_eval_single_actions_are_chunks_of_one() -> None:
    assert np.array_equal(answered(VlaEval(lambda seen: STATE)), STATE[None])


def test_vla_eval_of_a_whole_chunk_the_first_action_alone_is_executed() -> None:
    """As its own runner does; the harness executes `spec.execute` actions of a chunk."""
    with VlaEval() as url:
        for query, execute in (("", 1), ("?execute=none", None)):
            with connect(url + query, timeouts=QUICK) as policy:
                assert policy.infer(observation()).shape == (3, 14)
                assert policy.spec.execute == execute


def test_vla_eval_order_of_cameras_and_names_of_state() -> None:
    server = VlaEval()
    query = "?cameras=right_wrist,head&state_keys=state,states&grippers=closed"
    chunk = answered(server, query)
    seen = next(r["payload"] for r in server.requests if r["type"] == "observation")
    assert list(seen["images"]) == ["right_camera", "head_camera"]
    assert "joint_state" not in seen
    assert np.array_equal(seen["state"], STATE) and np.array_equal(seen["states"], STATE)
    assert chunk[0, 6] == pytest.approx(1 - joint_chunk()[0, 6])
    assert chunk[0, 0] == pytest.approx(joint_chunk()[0, 0])


def test_vla_eval_a_failed_start_does_not_shift_the_actions() -> None:
    """The known defect of its own client: from then on every action is of another observation."""
    server = VlaEval()
    server.broken_start = True
    with talking(server) as policy:
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
    with talking(VlaEval(), "?space=ee") as policy:
        assert any("announces 14 numbers" in text for text in policy.hello["warnings"])


def test_vla_eval_a_state_that_is_announced_and_not_sent_is_doubted_at_once() -> None:
    server = VlaEval()
    server.reads = ("images", "state")
    with server as url:
        with connect(url, timeouts=QUICK) as policy:
            assert any("reads 'state', which is not sent" in t for t in policy.hello["warnings"])
        with connect(url + "?state_keys=joint_state,state", timeouts=QUICK) as policy:
            assert not any("which is not sent" in text for text in policy.hello["warnings"])


def test_vla_eval_an_error_leaves_the_connection_good() -> None:
    def model(seen: Any) -> Any:
        if seen["task_description"] == "fail":
            raise KeyError("image")
        return STATE

    with talking(VlaEval(model)) as policy:
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
    with pytest.raises(ProtocolViolation, match="cannot be read"):
        answered(VlaEval(None, frame))
