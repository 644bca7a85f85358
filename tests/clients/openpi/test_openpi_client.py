"""A server of openpi's form, and our client."""

from __future__ import annotations

from typing import Any

import msgpack
import numpy as np
import pytest
from standin_base import HEAD, LEFT, QUICK, RIGHT, STATE, TRIAL, image, joint_chunk, observation
from standin_codecs import openpi_out
from standins import OpenPi

from robospa.clients import connect
from robospa.clients.openpi.client import OpenPiClientOptions
from robospa.protocol.errors import (
    ConnectionLost,
    EncodeError,
    PolicyAnswerError,
    ProtocolViolation,
    ServerError,
)
from robospa.protocol.openpi import to_openpi


def reply(actions: Any) -> bytes:
    """An answer whose time is a numpy scalar, as openpi sends it."""
    timing = {"infer_ms": {b"__npgeneric__": True, b"data": 2.5, b"dtype": "<f8"}}
    message = {"actions": np.asarray(actions), "server_timing": timing}
    packed: bytes = msgpack.packb(message, default=openpi_out)
    return packed


def test_a_server_that_does_not_select_our_protocol_is_spoken_to_in_openpis() -> None:
    server = OpenPi(None, reply(np.full((4, 14), 0.5)))
    with server as url, connect(url.replace("openpi://", "ws://"), timeouts=QUICK) as policy:
        assert policy.dialect == "openpi"
        assert policy.hello["metadata"] == {"reset_pose": [0, -1.5, 1.5, 0, 0, 0]}
        policy.reset(TRIAL)
        chunk = policy.infer(observation(2))
        policy.end()
        assert policy.last_timing["infer_ms"] == 2.5
    assert chunk.dtype == np.float32
    assert chunk.tolist() == [[0.5] * 14] * 4
    assert server.requests[0].keys() == {"images", "state", "prompt"}


def test_openpi_is_sent_what_its_server_reads() -> None:
    server = OpenPi()
    with server as url, connect(url, timeouts=QUICK) as policy:
        policy.reset(TRIAL)
        chunk = policy.infer(observation())
        assert policy.hello["metadata"] == {"reset_pose": [0, -1.5, 1.5, 0, 0, 0]}
        assert policy.last_timing["infer_ms"] == 12.5
        assert any("adapt_to_pi" in text for text in policy.hello["warnings"])
    sent = server.requests[0]
    assert sent.keys() == {"images", "state", "prompt"}
    names = {"cam_high": HEAD, "cam_left_wrist": LEFT, "cam_right_wrist": RIGHT}
    assert sent["images"].keys() == names.keys()
    for theirs, ours in names.items():
        assert sent["images"][theirs].dtype == np.uint8
        assert sent["images"][theirs].shape == (3, 240, 320)
        assert np.array_equal(np.moveaxis(sent["images"][theirs], 0, -1), image(ours))
    assert sent["state"].dtype == np.float64
    assert np.array_equal(sent["state"], STATE)
    assert sent["prompt"] == "pick the red block"
    assert np.array_equal(chunk, joint_chunk().astype(np.float32))


def test_metadata_that_openpis_own_client_reads_is_read() -> None:
    server = OpenPi()
    server.metadata = {
        "names": np.array(["left", "right"]),
        "gains": np.array([1.5, 2], ">f4"),
        "when": np.datetime64("2026-01-01"),
        b"stats": {b"mean": np.float32(0.5)},
    }
    with server as url, connect(url, timeouts=QUICK) as policy:
        assert policy.hello["metadata"]["gains"] == [1.5, 2]
        assert policy.hello["metadata"]["names"] == "array of <U5 [2]"
        assert policy.infer(observation()).shape == (3, 14)


@pytest.mark.parametrize(
    "actions", [[[1] * 14] * 2, np.ones((2, 14), np.int64), np.ones((2, 14), ">f8")], ids=type
)
def test_actions_that_openpis_own_client_takes_are_taken(actions: Any) -> None:
    answer = msgpack.packb({"actions": actions}, default=openpi_out)
    with OpenPi(None, answer) as url, connect(url, timeouts=QUICK) as policy:
        assert policy.infer(observation()).tolist() == [[1] * 14] * 2


def test_openpi_texts_are_no_actions() -> None:
    answer = msgpack.packb({"actions": np.array([["1"] * 14])}, default=openpi_out)
    with (
        OpenPi(None, answer) as url,
        connect(url, timeouts=QUICK) as policy,
        pytest.raises(PolicyAnswerError, match="the policy answered str"),
    ):
        policy.infer(observation())


def test_openpis_key_is_sent_as_its_client_sends_it() -> None:
    server = OpenPi()
    with server as url:
        connect(url, token="s3cret", timeouts=QUICK).close()
        assert server.authorization == "Api-Key s3cret"
        connect(url.replace("openpi://", "ws://"), token="s3cret", timeouts=QUICK).close()
        assert server.authorization == "Bearer s3cret"


def test_openpi_other_cameras_names_and_keys() -> None:
    server = OpenPi()
    query = '?cameras=head&names=head:cam_high&extra={"seed":3}&horizon=3&execute=2'
    with server as url, connect(url + query, timeouts=QUICK) as policy:
        assert [camera.name for camera in policy.spec.cameras] == ["head"]
        policy.infer(observation(images={"head": image(HEAD)}))
        assert (policy.spec.horizon, policy.spec.execute) == (3, 2)
    assert server.requests[0]["images"].keys() == {"cam_high"}
    assert server.requests[0]["seed"] == 3


def test_committed_actions_go_under_the_names_of_the_server() -> None:
    options = OpenPiClientOptions(committed="prev_chunk_left_over,inference_delay")
    assert options.spec.committed_actions and not OpenPiClientOptions().spec.committed_actions
    rows = np.ones((3, 14), np.float32)
    seen: Any = {"instruction": "go", "committed": rows, "delay": 2}
    sent = to_openpi(seen, {}, {}, options.committed_names)
    assert sent["inference_delay"] == 2
    assert np.array_equal(np.asarray(sent["prev_chunk_left_over"]), rows)
    assert set(to_openpi(seen, {}, {})) == {"images", "prompt"}
    with pytest.raises(ValueError, match="is not two names"):
        OpenPiClientOptions(committed="prefix")


def test_openpi_complains_in_a_text_frame() -> None:
    with OpenPi() as url, connect(url + "?names=head:cam_top", timeouts=QUICK) as policy:
        with pytest.raises(ServerError, match="Expected images to contain") as caught:
            policy.infer(observation())
        assert "Traceback" in caught.value.__notes__[0]


def test_openpis_own_codec_reads_and_is_read() -> None:
    original = pytest.importorskip("openpi_client.msgpack_numpy")
    answer = {"actions": joint_chunk(), "server_timing": {"infer_ms": np.float64(3.5)}}
    server = OpenPi(None, original.packb(answer))
    with server as url, connect(url, timeouts=QUICK) as policy:
        chunk = policy.infer(observation())
        assert policy.last_timing["infer_ms"] == 3.5
    assert np.array_equal(chunk, joint_chunk().astype(np.float32))
    seen = original.unpackb(server.raw[0])
    assert np.array_equal(np.moveaxis(seen["images"]["cam_left_wrist"], 0, -1), image(LEFT))
    assert np.array_equal(seen["state"], STATE)
    assert seen["prompt"] == "pick the red block"


def test_after_a_text_frame_the_connection_is_gone() -> None:
    trace = 'Traceback (most recent call last):\n  File "policy.py"\nKeyError: "cam_high"\n'
    with OpenPi(None, trace) as url, connect(url, timeouts=QUICK) as policy:
        with pytest.raises(ServerError, match=r'KeyError: "cam_high"$') as caught:
            policy.infer(observation())
        assert caught.value.retriable
        with pytest.raises(ConnectionLost):
            policy.infer(observation())


@pytest.mark.parametrize("frame", [b"\xc1", msgpack.packb([1])])
def test_an_unreadable_answer(frame: bytes) -> None:
    with (
        OpenPi(None, frame) as url,
        connect(url, timeouts=QUICK) as policy,
        pytest.raises(ProtocolViolation),
    ):
        policy.infer(observation())


def test_an_answer_without_actions() -> None:
    with (
        OpenPi(None, msgpack.packb({"a": 1})) as url,
        connect(url, timeouts=QUICK) as policy,
        pytest.raises(PolicyAnswerError),
    ):
        policy.infer(observation())


def test_a_camera_without_openpi_name_is_named() -> None:
    seen = observation(images={"third": np.zeros((6, 8, 3), np.uint8)})
    with (
        OpenPi() as url,
        connect(url, timeouts=QUICK) as policy,
        pytest.raises(EncodeError, match="'third'"),
    ):
        policy.infer(seen)
