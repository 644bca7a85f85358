"""A vla-eval server: what exactly it is sent, and what becomes of its answers."""

import itertools
import json
import re
import struct
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from standins import QUICK, RoboTwin, VlaEval, XPolicyLab, answered, talking
from standins_http import (
    EE,
    HEAD,
    LEFT,
    RIGHT,
    STATE,
    TRIAL,
    image,
    joint_chunk,
    observation,
    shows,
)

from robospa.clients import check_options, connect
from robospa.protocol.errors import (
    ConnectionLost,
    HandshakeError,
    PolicyAnswerError,
    ProtocolViolation,
    ServerError,
)

CAMERAS = ("head_camera", "left_camera", "right_camera")
"""Of vla-eval and of RoboTwin's TCP server."""


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
    assert list(seen["images"]) == list(CAMERAS)  # in this order
    shows(seen["images"], *CAMERAS)
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


# -------------------- XPolicyLab's server: what exactly it is sent, and what becomes of its answers


PARTS = {
    "left_arm_joint_state": slice(0, 6),
    "left_ee_joint_state": slice(6, 7),
    "right_arm_joint_state": slice(7, 13),
    "right_ee_joint_state": slice(13, 14),
}


def steps(chunk: Any) -> list[dict[str, Any]]:
    """A joint chunk as XPolicyLab's policies answer it."""
    return [{name: row[part].astype(np.float32) for name, part in PARTS.items()} for row in chunk]


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
    shown = {name: one["color"] for name, one in seen["vision"].items()}
    assert shown.keys() == {"cam_head", "cam_left_wrist", "cam_right_wrist"}
    shows(shown, "cam_head", "cam_left_wrist", "cam_right_wrist")


def test_xpolicylab_no_two_connections_share_an_id() -> None:
    server = XPolicyLab(lambda seen: steps(joint_chunk()))
    for _ in range(2):  # such as `check` and a run: newer servers answer a known id as before
        answered(server)
    assert len({request["message_id"] for request in server.requests}) == 8


def test_xpolicylab_state_is_split_by_arm() -> None:
    server = XPolicyLab(lambda seen: steps(joint_chunk()))
    answered(server)
    state = server.requests[-1]["payload"]["observation"]["state"]
    assert all(value.dtype == np.float32 for value in state.values())
    assert all(np.array_equal(state[name], STATE[part]) for name, part in PARTS.items())
    assert np.array_equal(state["left_ee_pose"], EE[0, :7])
    assert np.array_equal(state["right_ee_pose"], EE[1, :7])
    # Turned by 90 deg about z, the frame's x axis is the world's y axis.
    ahead = EE[1, :3] + [0, 0.12, 0]
    assert state["right_tcp_pose"][:3] == pytest.approx(ahead, abs=1e-6)
    assert np.array_equal(state["right_tcp_pose"][3:], EE[1, 3:7])


def test_xpolicylab_answers_poses() -> None:
    pose = {"left_ee_pose": EE[0, :7], "right_ee_pose": EE[1, :7]}
    grip = {"left_ee_joint_state": np.ones(1), "right_ee_joint_state": np.zeros(1)}
    chunk = ask([pose | grip], "?space=ee")
    assert chunk.shape == (1, 16)
    assert np.array_equal(chunk[0, :7], EE[0, :7])
    assert np.array_equal(chunk[0, 8:15], EE[1, :7])
    assert chunk[0, [7, 15]].tolist() == [1, 0]


def test_xpolicylab_grippers_can_be_turned_round() -> None:
    assert ask(np.zeros((1, 14)), "?grippers=closed")[0].tolist() == [0] * 6 + [1] + [0] * 6 + [1]


def ask(answer: Any, query: str = "") -> Any:
    """The chunk that our client makes of `answer`."""
    return answered(XPolicyLab(lambda seen: answer), query)


def test_a_gripper_that_is_not_named_stays_when_grippers_are_turned_round() -> None:
    chunk = ask([{"right_arm_joint_state": np.ones(6)}], "?grippers=closed")
    assert chunk[0, [6, 13]] == pytest.approx(STATE[[6, 13]])


JOINTS = np.arange(6) / 10


def named(left: str, of_left: Any, right: str, of_right: Any) -> dict[str, Any]:
    """Where the numbers of each of these names go."""
    return dict.fromkeys(left.split(), of_left) | dict.fromkeys(right.split(), of_right)


NAMES = named(
    "left_arm_joint_state left_arm_joint left_joint_state arm_joint_state joint_state", slice(0, 6),
    "right_arm_joint_state right_arm_joint right_joint_state", slice(7, 13),
)  # fmt: skip
GRIPPERS = named(
    "left_ee_joint_state left_gripper left_gripper_pos ee_joint_state", 6,
    "right_ee_joint_state right_gripper right_gripper_pos", 13,
)  # fmt: skip
POSES = named(
    "left_ee_pose left_endpose ee_pose", slice(0, 7), "right_ee_pose right_endpose", slice(8, 15)
)


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
        ([{"left_arm_joint": JOINTS, "left_grip": 1}], "left_grip, .* did you mean left_gripper"),
        ([{"left_arm_joint": np.ones(6), "action_type": "ee"}], r"write \?space=ee"),
        ([{"left_arm_joint": JOINTS, "action_type": "delta"}], "action_type 'delta', not joint"),
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


def test_xpolicylab_of_another_version_stops_the_run() -> None:
    says = {"code": "unknown_message_type", "message": "unsupported request type: infer"}
    server = XPolicyLab()
    server.extra = {"error": says}
    with talking(server) as policy, pytest.raises(HandshakeError, match="another version"):
        policy.infer(observation())


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (b"\xc1", "cannot be read"),
        ("hello", "a text frame"),
        (msgpack.packb([1]), "not a map"),
        (msgpack.packb({"a": 1}), "no message of XPolicyLab"),
        (msgpack.packb({"message_type": "x", "message_id": "9", "payload": {}}), "came to"),
        (msgpack.packb(msgpack.ExtType(4, b"x")), "cannot be read"),
    ],
)
def test_xpolicylab_frames_that_are_no_answer(frame: Any, reason: str) -> None:
    with talking(XPolicyLab(None, frame)) as policy:
        with pytest.raises(ProtocolViolation, match=reason):
            policy.infer(observation())
        with pytest.raises(ConnectionLost):
            policy.infer(observation())


# ---------------------- roboTwin's TCP server: what exactly it is sent, its framing, and its errors


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
    shows({name: one["rgb"] for name, one in sent["observation"].items()}, *CAMERAS)
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
    answered(server, "?layout=dp&reset=none")
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
