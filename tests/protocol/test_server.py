"""The server: errors that leave it usable, clients that harm only themselves."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wire_helpers import QUICK, SPEC, TRIAL, Recall, ask, observation, raw

from robospa.protocol.client import connect
from robospa.protocol.codec import encode
from robospa.protocol.connection_limits import ServerOptions
from robospa.protocol.errors import (
    ConnectionLost,
    PolicyAnswerError,
    ServerError,
)
from robospa.protocol.messages import End, Error, Infer, Message, Ready, Reset, pack, unpack


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


def test_a_policy_that_wants_to_exit_does_not(start: Any) -> None:
    class Exits(Recall):
        def infer(self, seen: Any) -> Any:
            raise SystemExit("out of memory")

    with connect(start(Exits()).url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
        with pytest.raises(ServerError, match="SystemExit: out of memory"):
            remote.infer(observation())
        remote.reset(TRIAL)


@pytest.mark.parametrize("answer", [[[0.0] * 14], np.zeros((2, 3), "f4"), np.full((2, 14), np.nan)])
def test_what_is_no_chunk_is_reported_as_the_policys_answer(start: Any, answer: Any) -> None:
    policy = Recall()
    policy.answer = answer
    with connect(start(policy).url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
        with pytest.raises(PolicyAnswerError):
            remote.infer(observation())


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
