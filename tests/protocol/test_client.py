"""The client against servers that misbehave in known ways."""

import socket
import struct
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wire_helpers import (
    HELLO,
    QUICK,
    SPEC,
    TRIAL,
    Recall,
    answer,
    begun,
    observation,
    port_that,
    scripted,
)

from robospa.protocol.client import connect
from robospa.protocol.codec import Limits, decode_jpeg, encode_jpeg
from robospa.protocol.errors import (
    CallTimeout,
    ConnectFailed,
    ConnectionLost,
    DecodeError,
    EncodeError,
    PolicyAnswerError,
    ProtocolViolation,
    ServerError,
    TransportError,
    VersionMismatch,
)
from robospa.protocol.messages import Actions, Error, Hello, Ready, pack
from robospa.protocol.transport import Address, Transport

READY = answer(Ready)
CHUNK = np.zeros((2, 14), np.float32)


def actions(chunk: Any) -> Any:
    return answer(lambda id: Actions(id, chunk, {}))


def test_a_trial(start: Any) -> None:
    policy = Recall()
    with connect(start(policy).url, timeouts=QUICK) as remote:
        assert remote.spec == SPEC
        remote.reset(TRIAL)
        assert remote.infer(observation(3)).tolist() == [[3.0] * 14] * 2
        assert remote.last_timing.keys() >= {"round_trip_ms", "infer_ms", "queue_ms", "batch"}
        remote.end({"success": True})
    assert policy.trials == [TRIAL]
    assert policy.outcomes == [{"success": True}]
    assert np.array_equal(policy.seen[0]["images"]["head"], observation()["images"]["head"])


def hang_up(peer: socket.socket) -> None:
    peer.recv(1000)
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


def say(text: bytes) -> Callable[[socket.socket], None]:
    return lambda peer: (peer.recv(1000), peer.sendall(text))[1]


UNAVAILABLE = say(b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\n\r\n")


@pytest.mark.parametrize(
    ("serve", "words"),
    [
        (lambda peer: None, "start the policy server behind it"),
        (lambda peer: peer.recv(10_000) and peer.recv(1), "handshake within"),
        (say(b"SSH-2.0-OpenSSH_9.2\r\n"), "cannot connect"),
        (UNAVAILABLE, "HTTP 503"),
    ],
)
def test_a_port_that_is_no_policy_server(serve: Any, words: str) -> None:
    with port_that(serve) as url, pytest.raises(ConnectFailed, match=words):
        connect(url, timeouts=replace(QUICK, connect=0.5))


@pytest.mark.parametrize("serve", [None, hang_up, UNAVAILABLE])
def test_waits_for_a_server_that_starts_or_restarts(start: Any, serve: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        if serve is None:
            server.close()

        def restart() -> None:
            if serve is not None:
                with server.accept()[0] as peer:
                    serve(peer)
                server.close()
            start(Recall(), port=port)

        timer = threading.Timer(0.2, restart)
        timer.start()
        connect(f"ws://127.0.0.1:{port}", timeouts=replace(QUICK, wait=10)).close()
        timer.join()


@pytest.mark.parametrize(
    ("greeting", "error"),
    [
        (b"\xc1", ProtocolViolation),
        ("hello", ProtocolViolation),
        (pack(Ready(0)), ProtocolViolation),
        (b"", ProtocolViolation),
        (pack(Hello(0, "99.0", "s", SPEC)), VersionMismatch),
        (None, CallTimeout),
    ],
)
def test_a_wrong_greeting(greeting: Any, error: type[Exception]) -> None:
    with scripted(greeting) as url, pytest.raises(error):
        connect(url, timeouts=replace(QUICK, hello=0.3))


@pytest.mark.parametrize(
    ("answer_", "error", "words"),
    [
        (answer(lambda id: Actions(id - 1, CHUNK, {})), ProtocolViolation, "came to request"),
        (READY, ProtocolViolation, "where actions was expected"),
        ("oops", ProtocolViolation, "text frame"),
        (pack(Error(0, "going", "the server is closing")), ConnectionLost, "server is closing"),
        (lambda _: None, ConnectionLost, "closed"),
        (b"\xc6" + b"\x00" * 9000, ConnectionLost, "bytes"),
    ],
)
def test_an_answer_that_ends_the_connection(answer_: Any, error: Any, words: str) -> None:
    with scripted(HELLO, [READY, answer_, READY]) as url:
        remote = connect(url, timeouts=QUICK, limits=Limits(message=5000))
        remote.reset(TRIAL)
        with pytest.raises(error, match=words):
            remote.infer(observation())
        with pytest.raises(ConnectionLost):
            remote.infer(observation())


def test_a_late_answer_is_never_taken_for_the_next_one() -> None:
    given_up = threading.Event()

    def slow(request: bytes) -> bytes:
        given_up.wait(10)
        return bytes(actions(CHUNK)(request))

    with scripted(HELLO, [READY, slow, actions(CHUNK)]) as url:
        remote = connect(url, timeouts=replace(QUICK, first_infer=0.1))
        remote.reset(TRIAL)
        with pytest.raises(CallTimeout, match=r"within 0\.1 s"):
            remote.infer(observation(0))
        given_up.set()
        with pytest.raises(ConnectionLost):
            remote.infer(observation(1))


def test_only_the_first_call_of_a_task_may_be_slow(
    start: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    allowed: list[float] = []
    receive = Transport.receive

    def spy(self: Transport, timeout: float, what: str) -> Any:
        if what == "actions":
            allowed.append(timeout)
        return receive(self, timeout, what)

    monkeypatch.setattr(Transport, "receive", spy)
    remote = connect(start(Recall()).url, timeouts=replace(QUICK, first_infer=99, infer=9))
    for task in ("a", "a", "b"):
        remote.reset(replace(TRIAL, task=task))
        remote.infer(observation(0))
        remote.infer(observation(1))
    remote.reconnect()
    remote.reset(TRIAL)
    remote.infer(observation(0))
    remote.close()
    assert allowed == [99, 9, 9, 9, 99, 9, 99]


@pytest.mark.parametrize("chunk", [np.zeros((5, 14), np.float32), np.zeros((2, 14), np.float64)])
def test_a_bad_chunk_is_the_policys_fault_and_spares_the_connection(chunk: Any) -> None:
    with scripted(HELLO, [READY, actions(chunk), READY]) as url:
        remote = connect(url, timeouts=QUICK)
        remote.reset(TRIAL)
        with pytest.raises(PolicyAnswerError):
            remote.infer(observation())
        remote.reset(TRIAL)


def test_a_restarted_server_does_not_continue_a_trial(start: Any) -> None:
    first = start(Recall())
    port = int(first.url.rsplit(":", 1)[1])
    remote = connect(first.url, timeouts=QUICK)
    remote.reset(TRIAL)
    first.stop()
    again = Recall()
    start(again, port=port)
    with pytest.raises(ConnectionLost):
        remote.infer(observation())
    remote.reconnect()
    with pytest.raises(ServerError, match="reset first"):
        remote.infer(observation())
    remote.reset(TRIAL)
    assert remote.infer(observation(1)).shape == (2, 14)
    assert len(again.seen) == 1
    remote.close()


def test_what_cannot_be_sent_spares_the_connection(start: Any) -> None:
    with begun(start(Recall())) as remote:
        with pytest.raises(EncodeError):
            remote.infer(observation(extra=object()))
        assert remote.infer(observation(2))[0, 0] == 2


def test_large_messages_arrive_whole(start: Any) -> None:
    policy = Recall()
    with begun(start(policy)) as remote:
        noise = np.random.default_rng(0).integers(0, 256, 1_000_003, dtype=np.uint8)
        remote.infer(observation(noise=noise))
    assert np.array_equal(policy.seen[0]["noise"], noise)


def test_a_server_that_stops_reading_is_given_up() -> None:
    given_up = threading.Event()
    with scripted(HELLO, [lambda _: (given_up.wait(20), None)[1]]) as url:
        transport = Transport(Address(url), replace(QUICK, first_infer=0.2, infer=0.2))
        with pytest.raises(TransportError):
            for _ in range(9):
                transport.send(bytes(8_000_000))
        given_up.set()


def test_images_travel_as_jpeg_if_the_spec_says_so(start: Any) -> None:
    policy = Recall(replace(SPEC, image_codec="jpeg", history=(-1,)))
    with begun(start(policy)) as remote:
        flat: dict[str, Any] = {
            "images": {"head": np.full((6, 8, 3), 100, np.uint8)},
            "state": np.zeros(14, "f4"),
        }
        remote.infer(observation(**flat, history={-1: flat}))
    for view in (policy.seen[0], policy.seen[0]["history"][-1]):
        assert view["images"]["head"].shape == (6, 8, 3)
        assert np.abs(view["images"]["head"].astype(int) - 100).max() <= 2


def test_a_broken_jpeg_is_refused_and_a_bomb_by_its_header() -> None:
    data = encode_jpeg(np.zeros((40, 40, 3), np.uint8))
    for sent, words in ((b"\xff\xd8 nothing", "no JPEG"), (data, "over the limit")):
        with pytest.raises(DecodeError, match=words):
            decode_jpeg(sent, Limits(array=1000))
