"""The client against servers that misbehave in known ways."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wire_helpers import HELLO, QUICK, SPEC, TRIAL, Recall, Scripted, answer, observation

from robospa.protocol.client import connect
from robospa.protocol.codec import Limits
from robospa.protocol.errors import (
    CallTimeout,
    ConnectFailed,
    ConnectionLost,
    DecodeError,
    EncodeError,
    PolicyAnswerError,
    PolicyError,
    ProtocolViolation,
    ServerError,
    SpecMismatch,
    TransportError,
    VersionMismatch,
)
from robospa.protocol.messages import Actions, Error, Hello, Ready, pack
from robospa.protocol.transport import Address, Transport

READY = answer(Ready)
CHUNK = np.zeros((2, 14), np.float32)


def actions(chunk: Any) -> Any:
    return answer(lambda id: Actions(id, chunk, {}))


@contextlib.contextmanager
def silent_port() -> Iterator[str]:
    """A port that accepts and never says a word."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"ws://127.0.0.1:{server.getsockname()[1]}"


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


def test_nobody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        url = f"ws://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(ConnectFailed, match="start the policy server"):
        connect(url, timeouts=QUICK)


def test_waits_for_a_server_that_is_still_starting(start: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    timer = threading.Timer(0.3, lambda: start(Recall(), port=port))
    timer.start()
    connect(f"ws://127.0.0.1:{port}", timeouts=replace(QUICK, wait=10)).close()
    timer.join()


def test_waits_for_a_server_that_restarts_and_resets_who_had_come(start: Any) -> None:
    server = socket.create_server(("127.0.0.1", 0))
    port = server.getsockname()[1]

    def restart() -> None:
        peer, _ = server.accept()
        peer.recv(1000)
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        peer.close()  # with a reset, as the kernel does for a process that ends
        server.close()
        start(Recall(), port=port)

    thread = threading.Thread(target=restart)
    thread.start()
    connect(f"ws://127.0.0.1:{port}", timeouts=replace(QUICK, wait=10)).close()
    thread.join()


def test_waits_for_a_server_that_is_shutting_down_to_restart(start: Any) -> None:
    server = socket.create_server(("127.0.0.1", 0))
    port = server.getsockname()[1]

    def restart() -> None:
        peer, _ = server.accept()
        peer.recv(1000)
        peer.sendall(b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\n\r\n")
        peer.close()
        server.close()
        start(Recall(), port=port)

    thread = threading.Thread(target=restart)
    thread.start()
    connect(f"ws://127.0.0.1:{port}", timeouts=replace(QUICK, wait=10)).close()
    thread.join()


def test_a_port_that_always_hangs_up() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=lambda: server.accept()[0].close())
        thread.start()
        with pytest.raises(ConnectFailed, match="start the policy server behind it"):
            connect(f"ws://127.0.0.1:{server.getsockname()[1]}", timeouts=QUICK)
        thread.join()


def test_a_port_that_never_answers() -> None:
    with silent_port() as url, pytest.raises(ConnectFailed, match="handshake within"):
        connect(url, timeouts=replace(QUICK, connect=0.2))


def test_a_port_that_speaks_something_else() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def talk() -> None:
            peer, _ = server.accept()
            peer.recv(1000)
            peer.sendall(b"SSH-2.0-OpenSSH_9.2\r\n")
            peer.close()

        thread = threading.Thread(target=talk)
        thread.start()
        with pytest.raises(ConnectFailed, match="cannot connect"):
            connect(f"ws://127.0.0.1:{server.getsockname()[1]}", timeouts=QUICK)
        thread.join()


@pytest.mark.parametrize("url", ["http://localhost:1", "localhost:8000", "ws://"])
def test_what_is_no_websocket_url(url: str) -> None:
    with pytest.raises(ValueError, match="not of the form ws://host:port"):
        connect(url, timeouts=QUICK)


def test_another_major_version_refuses_to_start() -> None:
    greeting = pack(Hello(0, "99.0", "s", SPEC))
    with Scripted(greeting) as url, pytest.raises(VersionMismatch):
        connect(url, timeouts=QUICK)


def test_another_spec_than_expected_refuses_to_start() -> None:
    with Scripted(HELLO) as url, pytest.raises(SpecMismatch, match="horizon was 9 and is 4"):
        connect(url, timeouts=QUICK, expect=replace(SPEC, horizon=9))


@pytest.mark.parametrize("greeting", [b"\xc1", "hello", pack(Ready(0)), b""])
def test_a_wrong_greeting(greeting: Any) -> None:
    with Scripted(greeting) as url, pytest.raises(ProtocolViolation):
        connect(url, timeouts=QUICK)


def test_no_greeting_at_all() -> None:
    with Scripted(None) as url, pytest.raises(CallTimeout, match="did not send hello"):
        connect(url, timeouts=replace(QUICK, hello=0.2))


def test_a_wrong_request_id_is_fatal() -> None:
    late = answer(lambda id: Actions(id - 1, CHUNK, {}))
    with Scripted(HELLO, [READY, late, READY]) as url:
        remote = connect(url, timeouts=QUICK)
        remote.reset(TRIAL)
        with pytest.raises(ProtocolViolation, match=r"answer 2 came to request 3"):
            remote.infer(observation())
        with pytest.raises(ConnectionLost):
            remote.infer(observation())


def test_an_answer_of_the_wrong_type_is_fatal() -> None:
    with Scripted(HELLO, [READY, READY]) as url:
        remote = connect(url, timeouts=QUICK)
        remote.reset(TRIAL)
        with pytest.raises(ProtocolViolation, match="ready came where actions was expected"):
            remote.infer(observation())


def test_a_text_frame_is_fatal() -> None:
    with Scripted(HELLO, ["oops"]) as url:
        remote = connect(url, timeouts=QUICK)
        with pytest.raises(ProtocolViolation, match="text frame"):
            remote.reset(TRIAL)


def test_a_late_answer_is_never_taken_for_the_next_one() -> None:
    given_up = threading.Event()

    def slow(request: bytes) -> bytes:
        given_up.wait(10)
        return bytes(actions(CHUNK)(request))

    with Scripted(HELLO, [READY, slow, actions(CHUNK)]) as url:
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


@pytest.mark.parametrize(
    "chunk",
    [
        np.zeros(14, np.float32),
        np.zeros((0, 14), np.float32),
        np.zeros((5, 14), np.float32),
        np.zeros((2, 7), np.float32),
        np.zeros((2, 14), np.float64),
        np.zeros((2, 14), np.int64),
        np.full((2, 14), np.inf, np.float32),
        np.full((2, 14), np.nan, np.float32),
    ],
)
def test_a_bad_chunk_is_the_policys_fault_and_spares_the_connection(chunk: Any) -> None:
    with Scripted(HELLO, [READY, actions(chunk), READY]) as url:
        remote = connect(url, timeouts=QUICK)
        remote.reset(TRIAL)
        with pytest.raises(PolicyAnswerError):
            remote.infer(observation())
        remote.reset(TRIAL)


def test_policy_errors_are_not_transport_errors() -> None:
    for kind in (PolicyAnswerError, ServerError):
        assert issubclass(kind, PolicyError) and not issubclass(kind, TransportError)


def test_an_error_without_request_ends_the_connection() -> None:
    with Scripted(HELLO, [pack(Error(0, "going", "the server is closing"))]) as url:
        remote = connect(url, timeouts=QUICK)
        with pytest.raises(ConnectionLost, match="the server is closing"):
            remote.reset(TRIAL)


def test_a_server_that_goes_away_inside_a_trial() -> None:
    with Scripted(HELLO, [READY, lambda _: None]) as url:
        remote = connect(url, timeouts=QUICK)
        remote.reset(TRIAL)
        with pytest.raises(ConnectionLost):
            remote.infer(observation())


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


def test_reconnecting_to_another_spec_is_refused(start: Any) -> None:
    first = start(Recall())
    port = int(first.url.rsplit(":", 1)[1])
    remote = connect(first.url, timeouts=QUICK)
    first.stop()
    start(Recall(replace(SPEC, horizon=9)), port=port)
    with pytest.raises(SpecMismatch, match="horizon was 4 and is 9"):
        remote.reconnect()


def test_an_answer_over_the_limit_ends_the_connection() -> None:
    with Scripted(HELLO, [b"\xc6" + b"\x00" * 9000]) as url:
        remote = connect(url, timeouts=QUICK, limits=Limits(message=5000))
        with pytest.raises(ConnectionLost):
            remote.reset(TRIAL)


def test_what_cannot_be_sent_spares_the_connection(start: Any) -> None:
    remote = connect(start(Recall()).url, timeouts=QUICK)
    remote.reset(TRIAL)
    with pytest.raises(EncodeError):
        remote.infer(observation(extra=object()))
    assert remote.infer(observation(2))[0, 0] == 2
    remote.close()


def test_large_messages_arrive_whole(start: Any) -> None:
    policy = Recall()
    remote = connect(start(policy).url, timeouts=QUICK)
    remote.reset(TRIAL)
    noise = np.random.default_rng(0).integers(0, 256, 1_000_003, dtype=np.uint8)
    remote.infer(observation(noise=noise))
    remote.close()
    assert np.array_equal(policy.seen[0]["noise"], noise)


def test_a_server_that_stops_reading_is_given_up() -> None:
    given_up = threading.Event()
    with Scripted(HELLO, [lambda _: (given_up.wait(20), None)[1]]) as url:
        transport = Transport(Address(url), replace(QUICK, first_infer=0.2, infer=0.2))
        with pytest.raises(TransportError):
            for _ in range(9):
                transport.send(bytes(8_000_000))
        given_up.set()


def test_images_travel_as_jpeg_if_the_spec_says_so(start: Any) -> None:
    policy = Recall(replace(SPEC, image_codec="jpeg", history=(-1,)))
    remote = connect(start(policy).url, timeouts=QUICK)
    remote.reset(TRIAL)
    flat: dict[str, Any] = {
        "images": {"head": np.full((6, 8, 3), 100, np.uint8)},
        "state": np.zeros(14, "f4"),
    }
    remote.infer(observation(**flat, history={-1: flat}))
    remote.close()
    for view in (policy.seen[0], policy.seen[0]["history"][-1]):
        assert view["images"]["head"].shape == (6, 8, 3)
        assert np.abs(view["images"]["head"].astype(int) - 100).max() <= 2


def test_a_broken_jpeg_is_refused() -> None:
    from robospa.protocol.codec import decode_jpeg

    with pytest.raises(DecodeError, match="no JPEG"):
        decode_jpeg(b"\xff\xd8 nothing")


def test_a_jpeg_bomb_is_refused_by_its_header() -> None:
    from robospa.protocol.codec import decode_jpeg, encode_jpeg

    data = encode_jpeg(np.zeros((40, 40, 3), np.uint8))
    with pytest.raises(DecodeError, match="over the limit"):
        decode_jpeg(data, Limits(array=1000))
