"""The server: errors that leave it usable, and sessions that are kept apart."""

import socket
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wire_helpers import (
    QUICK,
    TRIAL,
    Recall,
    Together,
    ask,
    begun,
    observation,
    raw,
    until,
    websocket,
)

from robospa.protocol.client import connect
from robospa.protocol.codec import encode
from robospa.protocol.connection_limits import ServerOptions
from robospa.protocol.errors import (
    CallTimeout,
    ConnectFailed,
    ConnectionLost,
    PolicyAnswerError,
    ServerError,
)
from robospa.protocol.messages import End, Error, Infer, Message, Ready, Reset, pack, unpack
from robospa.protocol.server import ServerThread


def test_a_failed_reset_shifts_no_answer(start: Any) -> None:
    policy = Recall()
    policy.fail_reset = 1
    with connect(start(policy).url, timeouts=QUICK) as remote:
        with pytest.raises(ServerError, match=r"not loaded yet .*in the log of ws://") as caught:
            remote.reset(TRIAL)
        assert caught.value.code == "policy_failed"
        assert caught.value.retriable
        for trial in range(3):
            remote.reset(replace(TRIAL, policy_seed=trial))
            for step in range(5):
                assert remote.infer(observation(step))[0, 0] == step


def test_after_a_policy_error_only_a_reset_helps(start: Any) -> None:
    policy = Recall()
    with begun(start(policy)) as remote:
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

    with pytest.raises(ServerError) as caught, begun(start(Policy())):
        pass
    assert not caught.value.retriable


def test_a_policy_that_wants_to_exit_does_not(start: Any) -> None:
    class Exits(Recall):
        def infer(self, seen: Any) -> Any:
            raise SystemExit("out of memory")

    with begun(start(Exits())) as remote:
        with pytest.raises(ServerError, match="SystemExit: out of memory"):
            remote.infer(observation())
        remote.reset(TRIAL)


@pytest.mark.parametrize("answer", [[[0.0] * 14], np.zeros((2, 3), "f4"), np.full((2, 14), np.nan)])
def test_what_is_no_chunk_is_reported_as_the_policys_answer(start: Any, answer: Any) -> None:
    with begun(start(Recall(answer=answer))) as remote, pytest.raises(PolicyAnswerError):
        remote.infer(observation())


def test_an_observation_that_does_not_fit_keeps_the_trial(start: Any) -> None:
    with begun(start(Recall())) as remote:
        with pytest.raises(ServerError, match=r"\(6, 8, 1\)") as caught:
            remote.infer(observation(images={"head": np.zeros((6, 8, 1), np.uint8)}))
        assert caught.value.code == "bad_observation"
        assert remote.infer(observation(4))[0, 0] == 4


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
    transport = raw(server.url)
    answer = ask(transport, frame)
    assert isinstance(answer, Error)
    assert answer.id == 0
    assert reason in answer.message
    with pytest.raises(ConnectionLost):
        transport.receive(10, "nothing")
    other.reset(TRIAL)
    other.close()


@pytest.mark.parametrize(
    "fields",
    [{"type": "sing"}, {"type": "reset", "trial": 3}, {"type": "ready"}, {"type": 4}, {}],
)
def test_a_request_that_makes_no_sense_is_answered(start: Any, fields: dict[str, Any]) -> None:
    transport = raw(start(Recall()).url)
    answer = ask(transport, encode({"id": 7, **fields}))
    assert isinstance(answer, Error)
    assert (answer.id, answer.code, answer.retriable) == (7, "bad_message", False)
    assert isinstance(ask(transport, pack(Reset(8, TRIAL))), Ready)
    transport.close()


def test_a_request_id_cannot_come_twice(start: Any) -> None:
    transport = raw(start(Recall()).url)
    assert isinstance(ask(transport, pack(Reset(5, TRIAL))), Ready)
    assert ask(transport, pack(Reset(5, TRIAL))).id == 0
    transport.close()


@pytest.mark.parametrize("request_", [Infer(1, observation()), End(1, {})])
def test_nothing_before_the_first_reset(start: Any, request_: Message) -> None:
    transport = raw(start(Recall()).url)
    answer = ask(transport, pack(request_))
    assert isinstance(answer, Error)
    assert answer.code == "no_trial"
    transport.close()


def test_requests_sent_at_once_are_answered_in_order(start: Any) -> None:
    transport = raw(start(Recall()).url)
    transport.send(pack(Reset(1, TRIAL)))
    for id in range(2, 6):
        transport.send(pack(Infer(id, observation(id))))
    answers = [unpack(transport.receive(10, "answer")) for _ in range(5)]  # type: ignore[arg-type]
    assert [answer.id for answer in answers] == [1, 2, 3, 4, 5]
    assert [answer.chunk[0, 0] for answer in answers[1:]] == [2, 3, 4, 5]  # type: ignore[union-attr]
    transport.close()


def test_a_silent_connection_is_closed_in_the_end(start: Any) -> None:
    server = start(policy_factory=Recall, options=ServerOptions(idle=0.1))
    transport = raw(server.url)
    with pytest.raises(ConnectionLost):
        transport.receive(10, "nothing")


def test_every_connection_has_a_policy_of_its_own(start: Any) -> None:
    made: list[Recall] = []

    def create() -> Recall:
        made.append(Recall())
        return made[-1]

    server = start(policy_factory=create)
    with connect(server.url, timeouts=QUICK) as a, connect(server.url, timeouts=QUICK) as b:
        a.reset(replace(TRIAL, policy_seed=1))
        b.reset(replace(TRIAL, policy_seed=2))
        a.infer(observation(10))
        b.infer(observation(20))
    assert [[t.policy_seed for t in policy.trials] for policy in made] == [[1], [2]]
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


def test_a_client_that_leaves_during_inference_harms_nobody(start: Any) -> None:
    policy = Together()
    server = start(policy)
    with websocket(server.url) as connection:
        connection.send(pack(Reset(1, TRIAL)))
        connection.recv(10)
        connection.send(pack(Infer(2, observation(1))))
        policy.started.wait(10)
        connection.socket.shutdown(socket.SHUT_RDWR)
    policy.open.set()
    with begun(server) as remote:
        assert remote.infer(observation(5))[0, 0] == 5


def test_stopping_a_server_whose_model_hangs() -> None:
    policy = Together()
    server = ServerThread(policy).start()
    transport = raw(server.url)
    transport.send(pack(Reset(1, TRIAL)))
    transport.receive(10, "ready")
    transport.send(pack(Infer(2, observation(1))))
    assert policy.started.wait(10)
    server.stop()
    with pytest.raises(ConnectionLost):
        transport.receive(10, "actions")
    policy.open.set()


def test_requests_that_wait_together_become_one_call(start: Any) -> None:
    policy = Together()
    server = start(policy)
    with ExitStack() as stack, ThreadPoolExecutor(4) as pool:
        remotes = [stack.enter_context(begun(server)) for _ in range(4)]
        first = pool.submit(remotes[0].infer, observation(0))
        assert policy.started.wait(10)
        rest = [pool.submit(remotes[n].infer, observation(n)) for n in (1, 2, 3)]
        until(lambda: len(server._policies._batcher._pending) == 3)
        policy.open.set()
        assert [future.result(10)[0, 0] for future in (first, *rest)] == [0, 1, 2, 3]
    assert [sorted(batch) for batch in policy.batches] == [[0], [1, 2, 3]]
    assert remotes[1].last_timing["batch"] == 3


def crowd(start: Any, third: Any) -> Any:
    """What `third`(pool, remote) finds of a full queue, with one request in the model and one
    waiting; both are answered."""
    policy = Together(size=1)
    server = start(policy, options=ServerOptions(queue=1))
    with ExitStack() as stack, ThreadPoolExecutor(3) as pool:
        remotes = [stack.enter_context(begun(server)) for _ in range(3)]
        first = pool.submit(remotes[0].infer, observation(0))
        assert policy.started.wait(10)
        second = pool.submit(remotes[1].infer, observation(1))
        until(lambda: len(server._policies._batcher._pending) == 1)
        found = third(pool, remotes[2])
        policy.open.set()
        assert [first.result(10)[0, 0], second.result(10)[0, 0]] == [0, 1]
        return found and found.result(10)


def test_too_many_waiting_requests_are_refused(start: Any) -> None:
    def third(pool: Any, remote: Any) -> Any:
        remote.timeouts = replace(QUICK, first_infer=0.1)
        with pytest.raises(CallTimeout, match=r"was busy for 0.1 s \(the server is busy"):
            remote.infer(observation(2))

    crowd(start, third)


def test_a_busy_server_is_waited_for_within_the_trial(
    start: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = threading.Event()
    monkeypatch.setattr("robospa.protocol.client.time.sleep", lambda s: refused.set())

    def third(pool: Any, remote: Any) -> Any:
        asked = pool.submit(remote.infer, observation(2))
        assert refused.wait(10)
        return asked

    assert crowd(start, third)[0, 0] == 2


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
    with begun(start(policy)):
        pass
    assert policy.gone.wait(10)
    assert [name for name, _ in policy.log] == ["reset", "end"]
    assert len({session for _, session in policy.log}) == 1


def test_a_session_that_fails_is_in_the_log(
    start: Any, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def broken(session: Any) -> None:
        raise ZeroDivisionError("a mistake of ours")

    monkeypatch.setattr("robospa.protocol.server.ConnectionHandler.run", broken)
    server = start(policy_factory=Recall)
    with pytest.raises(ConnectionLost):
        connect(server.url, timeouts=QUICK)
    assert "the session with 127.0.0.1" in caplog.text and "a mistake of ours" in caplog.text


def test_a_policy_whose_own_server_is_away_is_busy_and_says_what_it_has_used(start: Any) -> None:
    class Paying(Recall):
        asked = 0

        @property
        def last_timing(self) -> dict[str, float]:
            return {"requests": self.asked, "infer_ms": -1.0}

        def infer(self, seen: Any) -> Any:
            self.asked += 1
            if self.asked == 1:
                raise CallTimeout("the endpoint answered HTTP 429")
            if self.asked == 3:
                raise PolicyAnswerError("the model refused to answer")
            return super().infer(seen)

    with begun(start(Paying())) as remote:
        assert remote.infer(observation(0))[0, 0] == 0
        assert remote.last_timing["requests"] == 2 and remote.last_timing["infer_ms"] >= 0
        with pytest.raises(PolicyAnswerError, match=r"^the model refused to answer$"):
            remote.infer(observation(1))
        assert remote.last_timing == {"requests": 3}
