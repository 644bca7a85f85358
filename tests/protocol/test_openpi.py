"""openpi's dialect: its real client against our server, servers of its form against our client."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import msgpack
import numpy as np
import pytest
from wire_helpers import CAMERA, HELLO, QUICK, TRIAL, Recall, Scripted, observation

from robospa.protocol.client import RemotePolicy, connect
from robospa.protocol.codec import decode
from robospa.protocol.errors import (
    ConnectionLost,
    DecodeError,
    EncodeError,
    PolicyAnswerError,
    ProtocolViolation,
    ServerError,
)
from robospa.protocol.openpi import OpenPiOptions, from_openpi
from robospa.protocol.policy import PolicySpec

SPEC = PolicySpec("pi", cameras=(CAMERA,), horizon=4, action_dim=14)
OPTIONS = OpenPiOptions(spec=SPEC)


def array(value: Any) -> dict[bytes, Any]:
    """An array as openpi's format writes it, from its public description alone."""
    value = np.asarray(value)
    return {
        b"__ndarray__": True,
        b"data": value.tobytes(),
        b"dtype": value.dtype.str,
        b"shape": value.shape,
    }


METADATA = msgpack.packb({"reset_pose": [0.0, -1.5, 1.5, 0.0, 0.0, 0.0], "offset": array([1.0])})


def reply(actions: Any) -> bytes:
    timing = {"infer_ms": {b"__npgeneric__": True, b"data": 2.5, b"dtype": "<f8"}}
    packed: bytes = msgpack.packb({"actions": array(actions), "server_timing": timing})
    return packed


@contextmanager
def openpi_server(*answers: Any) -> Iterator[RemotePolicy]:
    """Our client, connected to a scripted server in openpi's dialect."""
    with (
        Scripted(METADATA, answers, v1=False) as url,
        connect(url, timeouts=QUICK, openpi=OPTIONS) as remote,
    ):
        yield remote


# ---------------------------------------------------------------- an openpi server, our client


def test_a_server_that_does_not_select_our_protocol_is_spoken_to_in_openpis() -> None:
    requests = []

    def infer(request: bytes) -> bytes:
        requests.append(decode(request))
        return reply(np.full((4, 14), 0.5))

    with openpi_server(infer) as remote:
        assert remote.dialect == "openpi"
        assert remote.hello["metadata"]["offset"] == [1.0]
        assert remote.spec == SPEC
        remote.reset(TRIAL)
        chunk = remote.infer(observation(2))
        remote.end()
    assert chunk.dtype == np.float32
    assert chunk.tolist() == [[0.5] * 14] * 4
    assert remote.last_timing["infer_ms"] == 2.5
    sent = requests[0]
    assert sent.keys() == {"images", "state", "prompt"}
    assert sent["prompt"] == "pick it"
    assert sent["state"].shape == (14,)
    assert np.array_equal(
        sent["images"]["cam_high"], np.moveaxis(observation()["images"]["head"], -1, 0)
    )


def test_our_protocol_need_not_be_offered() -> None:
    with (
        Scripted(METADATA, [reply(np.zeros((1, 14)))]) as url,
        connect(url, timeouts=QUICK, openpi=OPTIONS, force_openpi=True) as remote,
    ):
        assert remote.dialect == "openpi"
        assert remote.infer(observation()).shape == (1, 14)


def test_a_text_frame_is_the_servers_traceback() -> None:
    trace = 'Traceback (most recent call last):\n  File "policy.py"\nKeyError: "cam_high"\n'
    with openpi_server(trace) as remote:
        with pytest.raises(ServerError, match=r'KeyError: "cam_high"$') as caught:
            remote.infer(observation())
        assert caught.value.retriable
        assert "policy.py" in caught.value.__notes__[0]
        with pytest.raises(ConnectionLost):
            remote.infer(observation())


@pytest.mark.parametrize("actions", [np.zeros((4, 7)), np.full((2, 14), np.nan), np.zeros(14)])
def test_a_bad_chunk_is_the_policys_fault(actions: Any) -> None:
    with openpi_server(reply(actions)) as remote, pytest.raises(PolicyAnswerError):
        remote.infer(observation())


@pytest.mark.parametrize("frame", [b"\xc1", msgpack.packb([1])])
def test_an_unreadable_answer(frame: bytes) -> None:
    with openpi_server(frame) as remote, pytest.raises(ProtocolViolation):
        remote.infer(observation())


def test_an_answer_without_actions() -> None:
    with openpi_server(msgpack.packb({"a": 1})) as remote, pytest.raises(PolicyAnswerError):
        remote.infer(observation())


def test_a_camera_without_openpi_name_is_named() -> None:
    seen = observation(images={"third": np.zeros((6, 8, 3), np.uint8)})
    with openpi_server() as remote, pytest.raises(EncodeError, match="'third'"):
        remote.infer(seen)


def test_a_server_that_selects_our_protocol_is_not_spoken_to_in_openpis() -> None:
    with Scripted(HELLO) as url, connect(url, timeouts=QUICK, openpi=OPTIONS) as remote:
        assert remote.dialect == "robospa.v1"


# ---------------------------------------------------------------- an openpi client, our server


def openpi_client(url: str) -> Any:
    module = pytest.importorskip("openpi_client.websocket_client_policy")
    return module.WebsocketClientPolicy(url)


def openpi_observation(**changes: Any) -> dict[str, Any]:
    image = np.moveaxis(observation()["images"]["head"], -1, 0)
    return {"images": {"cam_high": image}, "state": np.arange(14.0), "prompt": "pick it", **changes}


def test_the_real_openpi_client_is_served(start: Any) -> None:
    policy = Recall()
    client = openpi_client(start(policy).url)
    assert client.get_server_metadata()["robospa"]["spec"]["name"] == "test"
    client.reset()
    answers = [client.infer(openpi_observation())["actions"] for _ in range(3)]
    client.infer(openpi_observation(prompt="something else"))
    client._ws.close()
    assert [answer[0, 0] for answer in answers] == [0, 2, 4]
    assert [trial.instruction for trial in policy.trials] == ["pick it", "something else"]
    seen = policy.seen[0]
    assert np.array_equal(seen["images"]["head"], observation()["images"]["head"])
    assert seen["state"].dtype == np.float32
    assert [o["step"] for o in policy.seen] == [0, 2, 4, 0]


def test_a_failing_policy_sends_openpis_client_a_traceback(start: Any) -> None:
    policy = Recall()
    policy.fail_infer = 1
    server = start(policy)
    client = openpi_client(server.url)
    with pytest.raises(RuntimeError, match="CUDA error: device lost"):
        client.infer(openpi_observation())
    again = openpi_client(server.url)
    assert again.infer(openpi_observation())["actions"].shape == (2, 14)
    again._ws.close()


def test_an_openpi_observation_without_its_camera_is_refused(start: Any) -> None:
    client = openpi_client(start(Recall()).url)
    with pytest.raises(RuntimeError, match="lacks the image of camera 'head'"):
        client.infer(openpi_observation(images={}))


def test_openpis_api_key_is_a_token(start: Any) -> None:
    module = pytest.importorskip("openpi_client.websocket_client_policy")
    url = start(Recall(), token="s3cret").url
    client = module.WebsocketClientPolicy(url, api_key="s3cret")
    assert client.infer(openpi_observation())["actions"].shape == (2, 14)
    client._ws.close()


@pytest.mark.parametrize(
    "image",
    [
        np.full((3, 6, 8), 51, np.uint8),
        np.full((6, 8, 3), 51, np.uint8),
        np.full((3, 6, 8), 0.2, np.float32),
    ],
)
def test_images_of_either_layout_and_range(image: Any) -> None:
    found = from_openpi({"images": {"cam_high": image}}, 0)["images"]["head"]
    assert found.shape == (6, 8, 3)
    assert found.dtype == np.uint8
    assert (found == 51).all()


@pytest.mark.parametrize(
    "value",
    [None, {"images": []}, {"images": {"cam_high": 1}}, {"state": [1.0]}, {"prompt": 3}],
)
def test_what_is_no_openpi_observation(value: Any) -> None:
    with pytest.raises(DecodeError):
        from_openpi(value, 0)
