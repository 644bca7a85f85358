"""The server: errors that leave it usable, sessions kept apart, refusals at the door."""

from __future__ import annotations

import http.client
import itertools
import json
import socket
import ssl
import subprocess
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect as open_socket
from websockets.typing import Origin
from wire_helpers import QUICK, SPEC, TRIAL, Recall, Together, observation

from robospa.protocol.channel import Address, Channel
from robospa.protocol.client import connect
from robospa.protocol.codec import Limits, encode
from robospa.protocol.errors import (
    ConnectFailed,
    ConnectionLost,
    HandshakeError,
    PolicyAnswerError,
    ServerError,
    TransportError,
    Unauthorized,
)
from robospa.protocol.messages import End, Error, Infer, Message, Ready, Reset, pack, unpack
from robospa.protocol.server import ServerOptions, ServerThread


def raw(url: str) -> Channel:
    """A connection past the hello."""
    channel = Channel(Address(url), QUICK)
    channel.receive(10, "hello")
    return channel


def ask(channel: Channel, frame: bytes) -> Message:
    channel.send(frame)
    data = channel.receive(10, "answer")
    assert isinstance(data, bytes)
    return unpack(data)


def test_a_failed_reset_shifts_no_answer(start: Any) -> None:
    policy = Recall()
    policy.fail_reset = 1
    with connect(start(policy).url, timeouts=QUICK) as remote:
        with pytest.raises(ServerError, match=r"not loaded yet$") as caught:
            remote.reset(TRIAL)
        assert caught.value.code == "policy_failed"
        assert caught.value.retriable
        for trial in range(3):
            remote.reset(replace(TRIAL, seed=trial))
            for step in range(5):
                assert remote.infer(observation(step))[0, 0] == step


def test_after_a_policy_error_only_a_reset_helps(start: Any) -> None:
    policy = Recall()
    with connect(start(policy).url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
        policy.fail_infer = 1
        with pytest.raises(ServerError, match="RuntimeError: CUDA error"):
            remote.infer(observation(0))
        with pytest.raises(ServerError, match="reset first") as caught:
            remote.infer(observation(1))
        assert caught.value.code == "no_trial"
        remote.reset(TRIAL)
        assert remote.infer(observation(2))[0, 0] == 2


def test_a_policy_says_whether_trying_again_helps(start: Any) -> None:
    class Hopeless(Exception):
        retriable = False

    class Policy(Recall):
        def reset(self, trial: Any) -> None:
            raise Hopeless("no checkpoint for this task")

    with connect(start(Policy()).url, timeouts=QUICK) as remote:
        with pytest.raises(ServerError) as caught:
            remote.reset(TRIAL)
        assert not caught.value.retriable


@pytest.mark.parametrize("answer", [[[0.0] * 14], np.zeros((2, 3), "f4"), np.full((2, 14), np.nan)])
def test_what_is_no_chunk_is_reported_as_the_policys_answer(start: Any, answer: Any) -> None:
    policy = Recall()
    policy.answer = answer
    with connect(start(policy).url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
        with pytest.raises(PolicyAnswerError):
            remote.infer(observation())


def test_chunks_are_sent_as_float32(start: Any) -> None:
    policy = Recall()
    policy.answer = np.ones((3, 14), np.float64)[:, ::-1]
    with connect(start(policy).url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
        assert remote.infer(observation()).dtype == np.float32


def test_an_observation_that_does_not_fit_keeps_the_trial(start: Any) -> None:
    with connect(start(Recall()).url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
        with pytest.raises(ServerError, match=r"\(6, 8, 1\)") as caught:
            remote.infer(observation(images={"head": np.zeros((6, 8, 1), np.uint8)}))
        assert caught.value.code == "bad_observation"
        assert remote.infer(observation(4))[0, 0] == 4


def test_the_privileged_state_arrives(start: Any) -> None:
    policy = Recall(replace(SPEC, privileged=True))
    state = {"bodies": {"can": {"pose": [0.1, 0.2, 0.74, 1.0, 0.0, 0.0, 0.0]}}, "contacts": []}
    with connect(start(policy).url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
        remote.infer(observation(privileged=state))
    assert json.dumps(policy.seen[0]["privileged"]) == json.dumps(state)


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (b"\xc1", "does not exist"),
        (b"", "announced"),
        (encode([1]), "request ids"),
        (encode({"type": "reset"}), "request ids"),
        (encode({"type": "reset", "id": 0}), "request ids"),
        (encode({"type": "reset", "id": -5}), "request ids"),
    ],
)
def test_a_frame_without_request_ends_this_connection_only(
    start: Any, frame: bytes, reason: str
) -> None:
    server = start(policy_factory=Recall)
    other = connect(server.url, timeouts=QUICK)
    channel = raw(server.url)
    answer = ask(channel, frame)
    assert isinstance(answer, Error)
    assert answer.id == 0
    assert reason in answer.message
    with pytest.raises(ConnectionLost):
        channel.receive(10, "nothing")
    other.reset(TRIAL)
    other.close()


@pytest.mark.parametrize(
    "fields",
    [{"type": "sing"}, {"type": "reset", "trial": 3}, {"type": "ready"}, {"type": 4}, {}],
)
def test_a_request_that_makes_no_sense_is_answered(start: Any, fields: dict[str, Any]) -> None:
    channel = raw(start(Recall()).url)
    answer = ask(channel, encode({"id": 7, **fields}))
    assert isinstance(answer, Error)
    assert (answer.id, answer.code, answer.retriable) == (7, "bad_message", False)
    assert isinstance(ask(channel, pack(Reset(8, TRIAL))), Ready)
    channel.close()


def test_a_request_id_cannot_come_twice(start: Any) -> None:
    channel = raw(start(Recall()).url)
    assert isinstance(ask(channel, pack(Reset(5, TRIAL))), Ready)
    assert ask(channel, pack(Reset(5, TRIAL))).id == 0
    channel.close()


@pytest.mark.parametrize("request_", [Infer(1, observation()), End(1, {})])
def test_nothing_before_the_first_reset(start: Any, request_: Message) -> None:
    channel = raw(start(Recall()).url)
    answer = ask(channel, pack(request_))
    assert isinstance(answer, Error)
    assert answer.code == "no_trial"
    channel.close()


def test_requests_sent_at_once_are_answered_in_order(start: Any) -> None:
    channel = raw(start(Recall()).url)
    channel.send(pack(Reset(1, TRIAL)))
    for id in range(2, 6):
        channel.send(pack(Infer(id, observation(id))))
    answers = [unpack(channel.receive(10, "answer")) for _ in range(5)]  # type: ignore[arg-type]
    assert [answer.id for answer in answers] == [1, 2, 3, 4, 5]
    assert [answer.chunk[0, 0] for answer in answers[1:]] == [2, 3, 4, 5]  # type: ignore[union-attr]
    channel.close()


def test_a_message_over_the_limit_ends_this_connection_only(start: Any) -> None:
    options = ServerOptions(limits=Limits(message=5000))
    server = start(policy_factory=Recall, options=options)
    channel = raw(server.url)
    with pytest.raises(TransportError):
        channel.send(b"\x00" * 200_000)
        channel.receive(10, "nothing")
    connect(server.url, timeouts=QUICK).close()


def test_a_text_frame_ends_this_connection_only(start: Any) -> None:
    server = start(policy_factory=Recall)
    channel = raw(server.url)
    channel._socket.send("hello")
    assert "text frames" in str(channel.receive(10, "answer"))
    connect(server.url, timeouts=QUICK).close()


def test_half_a_handshake_blocks_nobody(start: Any) -> None:
    server = start(policy_factory=Recall)
    port = int(server.url.rsplit(":", 1)[1])
    with socket.create_connection(("127.0.0.1", port)) as idle:
        idle.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n")
        with connect(server.url, timeouts=QUICK) as remote:
            remote.reset(TRIAL)


def test_half_a_message_blocks_nobody(start: Any) -> None:
    server = start(policy_factory=Recall)
    channel = raw(server.url)
    channel._socket.socket.sendall(b"\x82\xff" + b"\x00\x00\x00\x00\x00\x0f\x00\x00" + b"abcd" * 9)
    with connect(server.url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
    channel.close()


def test_a_silent_connection_is_closed_in_the_end(start: Any) -> None:
    server = start(policy_factory=Recall, options=ServerOptions(idle=0.1))
    channel = raw(server.url)
    with pytest.raises(ConnectionLost):
        channel.receive(10, "nothing")


# ---------------------------------------------------------------- sessions


def test_every_connection_has_a_policy_of_its_own(start: Any) -> None:
    made: list[Recall] = []

    def create() -> Recall:
        made.append(Recall())
        return made[-1]

    server = start(policy_factory=create)
    with connect(server.url, timeouts=QUICK) as a, connect(server.url, timeouts=QUICK) as b:
        a.reset(replace(TRIAL, seed=1))
        b.reset(replace(TRIAL, seed=2))
        a.infer(observation(10))
        b.infer(observation(20))
    assert [[t.seed for t in policy.trials] for policy in made] == [[1], [2]]
    assert [[o["step"] for o in policy.seen] for policy in made] == [[10], [20]]


def test_a_factory_that_fails_says_why(start: Any) -> None:
    made: list[Recall] = []

    def create() -> Recall:
        if made:
            raise MemoryError("no room for a second model")
        made.append(Recall())
        return made[0]

    server = start(policy_factory=create)
    with (
        connect(server.url, timeouts=QUICK),
        pytest.raises(ConnectionLost, match="no room for a second model"),
    ):
        connect(server.url, timeouts=QUICK)


def test_a_policy_that_knows_no_sessions_serves_one_connection(start: Any) -> None:
    server = start(Recall(), options=ServerOptions(patience=0.05))
    with connect(server.url, timeouts=QUICK) as first:
        with pytest.raises(ConnectFailed, match="all 1 places"):
            connect(server.url, timeouts=QUICK)
        first.reset(TRIAL)
    connect(server.url, timeouts=QUICK).close()


def test_reconnecting_finds_the_place_that_it_left(start: Any) -> None:
    with connect(start(Recall()).url, timeouts=QUICK) as remote:
        for _ in range(5):
            remote.reconnect()
            remote.reset(TRIAL)


def test_places_are_limited(start: Any) -> None:
    options = ServerOptions(max_connections=2, patience=0.05)
    server = start(policy_factory=Recall, options=options)
    with (
        connect(server.url, timeouts=QUICK),
        connect(server.url, timeouts=QUICK),
        pytest.raises(ConnectFailed, match="all 2 places"),
    ):
        connect(server.url, timeouts=QUICK)


def test_a_client_that_leaves_during_inference_harms_nobody(start: Any) -> None:
    policy = Together()
    server = start(policy)
    channel = raw(server.url)
    channel.send(pack(Reset(1, TRIAL)))
    channel.receive(10, "ready")
    channel.send(pack(Infer(2, observation(1))))
    policy.started.wait(10)
    channel._socket.socket.shutdown(socket.SHUT_RDWR)
    policy.open.set()
    with connect(server.url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
        assert remote.infer(observation(5))[0, 0] == 5


def test_the_server_answers_others_while_a_policy_computes(start: Any) -> None:
    policy = Together()
    server = start(policy)
    with connect(server.url, timeouts=QUICK) as busy, ThreadPoolExecutor(1) as pool:
        busy.reset(TRIAL)
        waiting = pool.submit(busy.infer, observation(1))
        assert policy.started.wait(10)
        connect(server.url, timeouts=QUICK).close()
        policy.open.set()
        assert waiting.result(10)[0, 0] == 1


def test_stopping_a_server_whose_model_hangs() -> None:
    policy = Together()
    server = ServerThread(policy).start()
    channel = raw(server.url)
    channel.send(pack(Reset(1, TRIAL)))
    channel.receive(10, "ready")
    channel.send(pack(Infer(2, observation(1))))
    assert policy.started.wait(10)
    server.stop()
    with pytest.raises(ConnectionLost):
        channel.receive(10, "actions")
    policy.open.set()


# ---------------------------------------------------------------- batches


def test_requests_that_wait_together_become_one_call(start: Any) -> None:
    policy = Together()
    server = start(policy)
    remotes = [connect(server.url, timeouts=QUICK) for _ in range(4)]
    for remote in remotes:
        remote.reset(TRIAL)
    with ThreadPoolExecutor(4) as pool:
        first = pool.submit(remotes[0].infer, observation(0))
        assert policy.started.wait(10)
        rest = [pool.submit(remotes[n].infer, observation(n)) for n in (1, 2, 3)]
        _until(lambda: len(server._server._engine._batcher._pending) == 3)
        policy.open.set()
        assert [future.result(10)[0, 0] for future in (first, *rest)] == [0, 1, 2, 3]
    assert [sorted(batch) for batch in policy.batches] == [[0], [1, 2, 3]]
    assert remotes[1].last_timing["batch"] == 3
    for remote in remotes:
        remote.close()


def test_one_bad_sample_spares_the_others(start: Any) -> None:
    policy = Together()
    server = start(policy)
    remotes = [connect(server.url, timeouts=QUICK) for _ in range(4)]
    for remote in remotes:
        remote.reset(TRIAL)
    with ThreadPoolExecutor(4) as pool:
        first = pool.submit(remotes[0].infer, observation(0))
        assert policy.started.wait(10)
        good = [pool.submit(remotes[n].infer, observation(n)) for n in (1, 2)]
        bad = pool.submit(remotes[3].infer, observation(3, instruction="poison"))
        _until(lambda: len(server._server._engine._batcher._pending) == 3)
        policy.open.set()
        assert [future.result(10)[0, 0] for future in (first, *good)] == [0, 1, 2]
        with pytest.raises(ServerError, match="one sample is bad"):
            bad.result(10)
    for remote in remotes:
        remote.close()


def test_too_many_waiting_requests_are_refused(start: Any) -> None:
    policy = Together(size=1)
    server = start(policy, options=ServerOptions(queue=1))
    remotes = [connect(server.url, timeouts=QUICK) for _ in range(3)]
    for remote in remotes:
        remote.reset(TRIAL)
    with ThreadPoolExecutor(3) as pool:
        first = pool.submit(remotes[0].infer, observation(0))
        assert policy.started.wait(10)
        second = pool.submit(remotes[1].infer, observation(1))
        _until(lambda: len(server._server._engine._batcher._pending) == 1)
        with pytest.raises(ServerError, match="busy") as caught:
            remotes[2].infer(observation(2))
        assert caught.value.retriable
        policy.open.set()
        assert [first.result(10)[0, 0], second.result(10)[0, 0]] == [0, 1]
    for remote in remotes:
        remote.close()


def test_a_batch_policy_is_told_which_session_resets_and_ends(start: Any) -> None:
    class Aware(Together):
        def __init__(self) -> None:
            super().__init__()
            self.log: list[tuple[str, int]] = []
            self.gone = threading.Event()
            self.open.set()

        def reset_session(self, session: int, trial: Any) -> None:
            self.log.append(("reset", session))

        def end_session(self, session: int) -> None:
            self.log.append(("end", session))
            self.gone.set()

    policy = Aware()
    with connect(start(policy).url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
    assert policy.gone.wait(10)
    assert [name for name, _ in policy.log] == ["reset", "end"]
    assert len({session for _, session in policy.log}) == 1


def _until(condition: Any) -> None:
    for _ in itertools.count():
        if condition():
            return
        threading.Event().wait(0.005)


# ---------------------------------------------------------------- the door


def test_the_token_is_needed(start: Any) -> None:
    url = start(policy_factory=Recall, token="s3cret").url
    connect(url, token="s3cret", timeouts=QUICK).close()
    for token in (None, "", "wrong", "s3cret2"):
        with pytest.raises(Unauthorized, match="missing or wrong token"):
            connect(url, token=token, timeouts=QUICK)


def test_another_version_is_refused(start: Any) -> None:
    url = start(Recall()).url
    with pytest.raises(HandshakeError, match=r"speaks robospa\.v1, not robospa\.v2"):
        Channel(Address(url), QUICK, subprotocol="robospa.v2")


def test_browsers_are_refused(start: Any) -> None:
    url = start(Recall()).url
    with pytest.raises(InvalidStatus), open_socket(url, origin=Origin("https://example.org")):
        pass


def test_health(start: Any) -> None:
    port = int(start(Recall(), token="s3cret").url.rsplit(":", 1)[1])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request("GET", "/healthz")
    response = connection.getresponse()
    assert (response.status, response.read()) == (200, b"OK\n")
    connection.close()


def test_a_taken_port_is_an_error(start: Any) -> None:
    port = int(start(Recall()).url.rsplit(":", 1)[1])
    with pytest.raises(OSError, match="address already in use"):
        ServerThread(Recall(), port=port).start()


def test_either_a_policy_or_a_factory() -> None:
    with pytest.raises(ValueError, match="either"):
        ServerThread()


def test_tls(start: Any, tmp_path: Path) -> None:
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    command = [
        *("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1"),
        *("-subj", "/CN=localhost", "-addext", "subjectAltName=IP:127.0.0.1"),
        *("-keyout", str(key), "-out", str(certificate)),
    ]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=60)
    except FileNotFoundError:
        pytest.skip("openssl is not installed")
    inside = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    inside.load_cert_chain(certificate, key)
    url = start(policy_factory=Recall, ssl=inside, token="s3cret").url
    assert url.startswith("wss://")
    trust = ssl.create_default_context(cafile=certificate)
    with connect(url, token="s3cret", timeouts=QUICK, ssl=trust) as remote:
        remote.reset(TRIAL)
        assert remote.infer(observation(1))[0, 0] == 1
    with pytest.raises(ConnectFailed, match="CERTIFICATE_VERIFY_FAILED"):
        connect(url, token="s3cret", timeouts=QUICK)
