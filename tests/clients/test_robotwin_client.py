"""RoboTwin's TCP server: what exactly it is sent, its framing, and its errors."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from standins import (
    EE,
    HEAD,
    LEFT,
    RIGHT,
    STATE,
    TRIAL,
    RoboTwin,
    answered,
    image,
    joint_chunk,
    observation,
    talking,
)

from robospa.clients import check_options
from robospa.protocol.errors import (
    ConnectionLost,
    PolicyAnswerError,
    ProtocolViolation,
    ServerError,
)


def calls(server: Any) -> list[str]:
    return [request["cmd"] for request in server.requests]


def test_the_nested_observation() -> None:
    server = RoboTwin()
    with talking(server) as policy:
        policy.reset(TRIAL)
        chunk = policy.infer(observation())
        policy.end({})
    assert np.array_equal(chunk, joint_chunk().astype(np.float32))
    assert calls(server) == ["reset_model", "get_action"]
    assert server.requests[0]["obs"] is None
    sent = server.requests[1]["obs"]
    names = {"head_camera": HEAD, "left_camera": LEFT, "right_camera": RIGHT}
    for theirs, ours in names.items():
        assert sent["observation"][theirs]["rgb"].dtype == np.uint8
        assert np.array_equal(sent["observation"][theirs]["rgb"], image(ours))
    joints = sent["joint_action"]
    assert np.array_equal(joints["vector"].astype(np.float32), STATE)
    assert joints["left_arm"] == pytest.approx(STATE[:6])
    assert joints["left_gripper"] == 0.25
    assert joints["right_arm"] == pytest.approx(STATE[7:13])
    assert joints["right_gripper"] == 0.75
    assert sent["endpose"]["left_endpose"] == pytest.approx(EE[0, :7])
    assert sent["endpose"]["right_endpose"] == pytest.approx(EE[1, :7])
    assert sent["instruction"] == "pick the red block"


def test_the_layout_of_dp() -> None:
    server = RoboTwin()
    with talking(server, "?layout=dp") as policy:
        policy.infer(observation())
    sent = server.requests[0]["obs"]
    assert sent.keys() == {"head_cam", "left_cam", "right_cam", "agent_pos"}
    for theirs, ours in (("head_cam", HEAD), ("left_cam", LEFT), ("right_cam", RIGHT)):
        assert sent[theirs].shape == (3, 240, 320)
        expected = np.moveaxis(image(ours), -1, 0) / 255
        assert np.allclose(sent[theirs], expected, atol=1e-6)
    assert np.array_equal(sent["agent_pos"].astype(np.float32), STATE)


def test_update_and_then_ask() -> None:
    server = RoboTwin()
    with talking(server, "?calls=update&reset=none") as policy:
        policy.reset(TRIAL)
        policy.infer(observation())
    assert calls(server) == ["update_obs", "get_action"]
    assert server.requests[1]["obs"] is None


class Windows(RoboTwin):
    """RoboTwin's DP: a window of three observations, of which it answers the steps."""

    methods = ("reset_obs", "get_action", "update_obs")

    def __init__(self) -> None:
        super().__init__(self.act)
        self.seen: list[int] = []
        self.windows: list[list[int]] = []

    def one(self, sock: Any) -> bool:
        before = len(self.requests)
        alive = super().one(sock)
        for request in self.requests[before:]:
            if request["cmd"] == "update_obs":
                self.seen.append(step_of(request["obs"]))
        return alive

    def act(self, seen: Any) -> Any:
        self.seen.append(step_of(seen))
        window = self.seen[-3:]
        self.windows.append([window[0]] * (3 - len(window)) + window)
        return np.zeros((6, 14))


def step_of(seen: Any) -> int:
    return int(seen["agent_pos"][0])


def at(step: int, offsets: tuple[int, ...]) -> Any:
    """The observation at `step`; each has its step as its joints."""
    history = {
        offset: {
            "images": observation()["images"],
            "state": np.full(14, max(step + offset, 0), np.float32),
        }
        for offset in offsets
    }
    return observation(step, history=history, state=np.full(14, step, np.float32))


def documented_url() -> str:
    """The query of docs/clients.md for RoboTwin's DP."""
    page = Path(__file__).parents[2] / "docs/clients.md"
    found = re.search(r"robotwin\+tcp://localhost:9999(\?layout=dp\S*)", page.read_text())
    assert found is not None
    return found[1]


def test_the_documented_url_gives_robotwins_dp_the_windows_of_its_own_client() -> None:
    server = Windows()
    with talking(server, documented_url()) as policy:
        policy.reset(TRIAL)
        for step in (0, 6, 12, 18):
            policy.infer(at(step, policy.spec.history))
    assert server.windows == [[0, 0, 0], [5, 6, 6], [11, 12, 12], [17, 18, 18]]
    assert calls(server)[:2] == ["reset_obs", "get_action"]


def test_earlier_steps_are_told_once() -> None:
    server = RoboTwin()
    with talking(server, "?layout=dp&history=2") as policy:
        assert policy.spec.history == (-2, -1)
        policy.reset(TRIAL)
        for step in (0, 1, 5):
            policy.infer(at(step, policy.spec.history))
    told = [(r["cmd"], step_of(r["obs"])) for r in server.requests[1:]]
    asked, earlier = "get_action", "update_obs"
    assert told == [(asked, 0), (asked, 1), (earlier, 3), (earlier, 4), (asked, 5)]


def test_answers_may_come_in_any_pieces() -> None:
    server = RoboTwin()
    server.slowly = True
    assert answered(server).shape == (3, 14)


def test_an_array_is_understood_too() -> None:
    answer = joint_chunk().astype(np.float32)
    assert np.array_equal(answered(RoboTwin(lambda seen: answer)), answer)


def test_a_servers_error_is_told_and_ends_the_connection() -> None:
    with talking(RoboTwin(lambda seen: 1 / 0)) as policy:
        with pytest.raises(ServerError, match=r"division by zero \(in get_action\)") as caught:
            policy.infer(observation())
        assert caught.value.retriable
        assert "Traceback" in caught.value.__notes__[0]
        with pytest.raises(ConnectionLost):
            policy.infer(observation())
        policy.reconnect()
        policy.reset(TRIAL)


def test_a_method_that_the_model_lacks() -> None:
    with (
        talking(RoboTwin(), "?reset=reset_obs") as policy,
        pytest.raises(ServerError, match="No model method named 'reset_obs'"),
    ):
        policy.reset(TRIAL)


@pytest.mark.parametrize("name", ["__class__", "_secret", "a.b", "", "a b"])
def test_only_plain_methods_are_called(name: str) -> None:
    with pytest.raises(ValueError, match="no name of a model's method"):
        check_options(f"robotwin+tcp://localhost:1?reset={name}")


def frame(text: bytes) -> bytes:
    return struct.pack(">I", len(text)) + text


@pytest.mark.parametrize(
    ("instead", "error", "reason"),
    [
        (struct.pack(">I", 2**31), ProtocolViolation, "over the limit"),
        (frame(b"{"), ProtocolViolation, "did not answer JSON"),
        (frame(b"[1]"), ProtocolViolation, "neither 'res' nor 'error'"),
        (frame(b'{"res": [[NaN]]}'), PolicyAnswerError, "numbers per action"),
        (frame(json.dumps({"res": "x"}).encode()), PolicyAnswerError, "not an array"),
        (frame(b'{"res": {"__numpy_array__": true, "dtype": "O"}}'), PolicyAnswerError, "array"),
        (
            frame(b'{"res": {"__numpy_array__": true, "data": "", "dtype": "f4,(", "shape": [0]}}'),
            PolicyAnswerError,
            "array",
        ),
    ],
)
def test_answers_that_cannot_be(instead: bytes, error: Any, reason: str) -> None:
    with pytest.raises(error, match=reason):
        answered(RoboTwin(None, instead))
