"""GR00T: its names and histories, three layouts, both ways of writing an array, and its line."""

import io
import socket
import sys
import threading
from typing import Any

import numpy as np
import pytest
from standins import QUICK, Gr00t, answered, first_request, talking
from standins_http import HEAD, LEFT, ND, STATE, TRIAL, image, joint_chunk, observation

from robospa.clients import connect
from robospa.clients.numpy_msgpack import npy_form, read_npy
from robospa.protocol.errors import (
    CallTimeout,
    ConnectionLost,
    DecodeError,
    HandshakeError,
    PolicyAnswerError,
    TransportError,
    Unauthorized,
)
from robospa.protocol.transport import Timeouts


def gr00t(layout: str = "nested", model: Any = None, **changes: Any) -> Gr00t:
    """A stand-in whose `changes` are entries of its configuration."""
    server = Gr00t(model)
    server.layout = layout
    for modality, change in changes.items():
        server.config[modality] |= change
    return server


@pytest.mark.parametrize("layout", ["nested", "flat", "n15"])
@pytest.mark.parametrize("codec", [None, ND.write])
def test_every_layout_and_both_codecs_carry_the_same(layout: str, codec: Any) -> None:
    server = gr00t(layout)
    server.codec = codec or server.codec
    chunk = answered(server)
    assert np.array_equal(chunk, joint_chunk().astype(np.float32))
    assert "kill" not in server.calls
    (seen,) = server.requests
    if layout == "nested":
        assert seen["language"] == {"task": [["pick the red block"]]}
        seen = {f"{m}.{name}": value for m in seen for name, value in seen[m].items()}
    else:
        assert seen["task"] == ["pick the red block"]
    batch = 0 if layout == "n15" else 1
    assert np.array_equal(seen["video.cam_high"], image(HEAD)[(None,) * (1 + batch)])
    assert np.array_equal(seen["video.cam_left_wrist"], image(LEFT)[(None,) * (1 + batch)])
    states = [seen[f"state.{name}"] for name in server.config["state"]["modality_keys"]]
    assert np.array_equal(np.concatenate(states, -1).ravel(), STATE)


def test_no_more_is_rendered_than_the_model_reads_and_its_histories_are_asked_for() -> None:
    views = {-n: {"images": {HEAD: image(HEAD) + n, LEFT: image(LEFT)}, "state": STATE + n}
             for n in (2, 4)}  # fmt: skip
    server = gr00t(video={"delta_indices": [-4, -2, 0]}, state={"delta_indices": [-2, 0]})
    with talking(server) as policy:
        assert policy.spec.history == (-4, -2)
        assert [camera.name for camera in policy.spec.cameras] == [HEAD, LEFT]
        policy.reset(TRIAL)
        policy.infer(observation(8, history=views))
    (seen,) = server.requests
    frames = [image(HEAD) + n for n in (4, 2, 0)]
    assert np.array_equal(seen["video"]["cam_high"], np.array([frames]))
    assert np.array_equal(seen["state"]["right_gripper"].ravel(), STATE[13] + np.float32([2, 0]))


@pytest.mark.parametrize(
    ("modality", "change", "says"),
    [
        ("video", {"modality_keys": ["belly"]}, "what video belly is"),
        ("state", {"modality_keys": ["left_joints", "arm_l"]}, "what state arm_l is"),
        ("action", {"modality_keys": ["left_joints"]}, "neither left_arm"),
        ("video", {"delta_indices": [0, 1]}, "later than the query"),
        ("action", {"action_configs": [{"rep": "DELTA", "type": "NON_EEF"}] * 4}, "deltas=add"),
        ("action", {"action_configs": [{"rep": "ABSOLUTE", "type": "EEF"}] * 4}, "poses"),
        ("action", {"modality_keys": None}, "reads is unknown"),
    ],
)
def test_what_cannot_be_served_is_refused_at_connect_with_the_servers_names(
    modality: str, change: Any, says: str
) -> None:
    server = gr00t(**{modality: change})
    with pytest.raises(HandshakeError, match=says) as caught, talking(server):
        pass
    assert "cam_high" in str(caught.value) or modality == "video"
    assert set(server.calls) == {"ping", "get_modality_config"}


def test_names_of_ones_own_and_closed_grippers() -> None:
    server = gr00t(state={"modality_keys": ["robot"]}, video={"modality_keys": ["belly"]})
    told = first_request(server, "?names=joints:robot,head:belly&grippers=closed")
    sent = told["state"]["robot"].ravel()
    assert np.allclose(sent[[6, 13]], 1 - STATE[[6, 13]]) and sent[0] == STATE[0]
    assert told["video"]["belly"].shape == (1, 1, 240, 320, 3)
    with pytest.raises(ValueError, match="not of the form part:name"):
        connect("gr00t://h?names=elbow:x")


def test_declared_deltas_are_added_up_from_the_joints_sent() -> None:
    reps = [{"rep": rep, "type": "NON_EEF"} for rep in ("DELTA", "ABSOLUTE", "RELATIVE", "DELTA")]
    server = gr00t(action={"action_configs": reps})
    chunk, plain = answered(server, "?deltas=add"), joint_chunk().astype(np.float32)
    added = STATE + np.cumsum(plain, axis=0)
    assert np.allclose(chunk[:, :6], added[:, :6]) and np.allclose(chunk[:, 13], added[:, 13])
    assert np.array_equal(chunk[:, 6:13], plain[:, 6:13])


def test_a_part_of_another_width_and_parts_of_unequal_length() -> None:
    server = Gr00t()
    server.extra = {"left_gripper": np.zeros((1, 3, 2), np.float32)}
    with pytest.raises(PolicyAnswerError, match=r"\(3, 2\) as left_gripper, not .* \(1, T, 1\)"):
        answered(server)
    server.extra = {"left_gripper": np.zeros((1, 2, 1), np.float32)}
    with pytest.raises(PolicyAnswerError, match="of lengths"):
        answered(server)


def test_a_token_and_a_wrong_one() -> None:
    server = Gr00t()
    server.token = "open sesame"
    with server as url:
        connect(url, "open sesame", timeouts=QUICK).close()
        with pytest.raises(Unauthorized, match="Invalid API token"):
            connect(url, "sesame", timeouts=QUICK)


def test_a_busy_server_is_told_from_a_silent_port_and_a_late_answer_is_never_taken() -> None:
    wake, rows = threading.Event(), iter([joint_chunk(), joint_chunk() + 1])

    def slow(seen: Any) -> Any:
        wake.wait(20)
        return next(rows)

    with Gr00t(slow) as url, connect(url, timeouts=QUICK) as policy:
        policy.reset(TRIAL)
        policy.timeouts = Timeouts(first_infer=0.1)
        with pytest.raises(CallTimeout, match="one request at a time"):
            policy.infer(observation())
        with pytest.raises(ConnectionLost, match="was closed"):
            policy.infer(observation())
        hasty = Timeouts(connect=0.3, hello=0.1, first_infer=0.1, close=0.1)
        with pytest.raises(CallTimeout, match="did not answer ping"):
            connect(url, timeouts=hasty)
        wake.set()
        policy.timeouts = QUICK
        policy.reconnect()
        policy.reset(TRIAL)
        assert policy.infer(observation())[0, 0] == 1
    with (
        socket.create_server(("127.0.0.1", 0)) as silent,
        pytest.raises(TransportError, match="is no ZeroMQ server"),
    ):
        connect(f"gr00t://127.0.0.1:{silent.getsockname()[1]}", timeouts=hasty)


def test_an_address_of_ipv6() -> None:
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("no IPv6 here")
    server = gr00t()
    server.host = "[::1]"
    with server as url, connect(url.replace("127.0.0.1", "[::1]"), timeouts=QUICK) as policy:
        policy.reset(TRIAL)
        assert policy.infer(observation()).shape[1] == 14


def test_without_pyzmq_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zmq", None)
    with pytest.raises(HandshakeError, match="pip install pyzmq"):
        connect("gr00t://127.0.0.1:1")


@pytest.mark.parametrize("dtype", ["<f4", "|u1", ">i8"])
def test_arrays_as_npy_files_both_ways(dtype: str) -> None:
    for array in (np.arange(6).reshape(2, 3).astype(dtype), np.asfortranarray(np.eye(3, 2)),
                  np.float32(3), np.zeros((0, 4))):  # fmt: skip
        assert np.array_equal(read_npy(npy_form(np.asarray(array))["as_npy"]), array)
        np.save(theirs := io.BytesIO(), array)
        assert np.array_equal(read_npy(theirs.getvalue()), array)
    for broken in (None, b"", b"PK\x03\x04", npy_form(np.zeros(3))["as_npy"][:-1],
                   npy_form(np.zeros(2, "f4,i4"))["as_npy"]):  # fmt: skip
        with pytest.raises(DecodeError):
            read_npy(broken)
