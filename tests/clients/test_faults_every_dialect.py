"""What a server or its line does wrong ends in the same way in every dialect."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from bad_line import BadLine, moment
from standins import (
    TRIAL,
    Go1,
    OpenPi,
    RoboTwin,
    VlaEval,
    XPolicyLab,
    XVla,
    joint_chunk,
    observation,
)

from robospa.clients import connect, dialect
from robospa.protocol.client import RemotePolicy
from robospa.protocol.errors import (
    PolicyError,
    ServerError,
    TransportError,
)
from robospa.protocol.transport import Timeouts

SERVERS: dict[str, tuple[Callable[[Any], Any], str, str]] = {
    "openpi": (OpenPi, "socket", ""),
    "go1": (Go1, "http", ""),
    "xvla": (lambda model: XVla(model, proprio=14), "http", "?space=joint"),
    "xpolicylab": (XPolicyLab, "socket", ""),
    "vla-eval": (VlaEval, "socket", ""),
    "robotwin": (RoboTwin, "tcp", ""),
}
"""By dialect: a stand-in for its server, how it frames messages, options."""
REPEATED, POLICY = "repeated, then missing", "policy error"
LIMIT = Timeouts(10, 30, 30, 30, 30, 30, 30, 0.2)
SHORT = Timeouts(10, 30, 30, 30, 30, 0.3, 30, 0.2)


@contextmanager
def talking(name: str, model: Any, timeouts: Timeouts) -> Iterator[tuple[RemotePolicy, BadLine]]:
    """A client that has been answered once, and the line between it and the server."""
    make, kind, options = SERVERS[name]
    server = make(model)
    with server as url:
        line = BadLine(server.port, kind)
        with line as port:
            address = url.replace(str(server.port), str(port)) + options
            with connect(address, timeouts=timeouts) as policy:
                policy.reset(TRIAL)
                assert policy.infer(observation()).shape == (3, 14)
                yield policy, line


def broken(mode: str, timeouts: Timeouts = LIMIT) -> Callable[[str], Exception]:
    """What the client says of a line in this `mode`; on a new connection all is well again."""

    def fault(name: str) -> Exception:
        with talking(name, lambda seen: joint_chunk(), timeouts) as (policy, line):
            line.mode = mode
            with pytest.raises(TransportError) as caught:
                policy.infer(observation(3))
            line.mode = "good"
            policy.timeouts = LIMIT
            policy.reconnect()
            policy.reset(TRIAL)
            assert np.array_equal(policy.infer(observation()), joint_chunk().astype("f4"))
        return caught.value

    return fault


def answering(answer: Any) -> Callable[[str], Exception]:
    """What the client says of this answer; the connection stays good. Where an answer has no form
    for it (NaN in JSON) the server fails."""

    def fault(name: str) -> Exception:
        answers = itertools.chain([joint_chunk(), answer], itertools.repeat(joint_chunk()))
        with talking(name, lambda seen: next(answers), LIMIT) as (policy, _):
            with pytest.raises(PolicyError) as caught:
                policy.infer(observation(3))
            policy.reset(TRIAL)
            assert np.array_equal(policy.infer(observation()), joint_chunk().astype("f4"))
        return caught.value

    return fault


def failing(name: str) -> Exception:
    """What the client says of a model that raises."""
    models = itertools.chain([joint_chunk], itertools.repeat(lambda: 1 / 0))
    with talking(name, lambda seen: next(models)(), LIMIT) as (policy, _):
        with pytest.raises(ServerError) as caught:
            policy.infer(observation(3))
        assert caught.value.retriable
    return caught.value


def twice(name: str) -> Exception:
    """The answer that is left over is never taken for that to the next question."""
    answers = (joint_chunk() + n for n in itertools.count())
    with talking(name, lambda seen: next(answers), LIMIT) as (policy, line):
        line.mode = "twice"
        policy.infer(observation(3))
        moment()
        line.mode = "good"
        if SERVERS[name][1] == "http":  # what follows an answer is dropped with its buffer
            assert policy.infer(observation(6))[0, 0] == 2
            return TransportError("not requested")
        with pytest.raises(TransportError) as caught:
            policy.infer(observation(6))
    return caught.value


def spoiled() -> Any:
    chunk = joint_chunk()
    chunk[1, 4] = np.nan
    return chunk


@dataclass(frozen=True)
class Case:
    """`told` ends the sentence "a server that ..."; `says` is part of what the user reads."""

    told: str
    end: str
    fault: Callable[[str], Exception]
    says: str


CASES = {
    "hang": Case(
        "hangs", REPEATED, broken("hang", SHORT), "within 0.3 s; look at the server's log"
    ),
    "drip": Case(
        "sends its answer a byte at a time",
        REPEATED,
        broken("drip", SHORT),
        "within 0.3 s; look at the server's log",
    ),
    "cut": Case("crashes", REPEATED, broken("cut"), "the connection to "),
    "half": Case("crashes in mid-message", REPEATED, broken("half"), "the connection to "),
    "huge": Case("announces 2 GB", REPEATED, broken("huge"), "over|more than"),
    "twice": Case("answers twice", REPEATED, twice, "came to|not requested"),
    "fails": Case("fails inside its model", POLICY, failing, "the server reported "),
    "nan": Case("answers NaN", POLICY, answering(spoiled()), "nan in action 1, dimension 4|NaN"),
    "shape": Case(
        "answers 13 numbers an action", POLICY, answering(np.zeros((2, 13))), "not|but a joint"
    ),
    "many": Case(
        "answers too many actions", POLICY, answering(np.zeros((10_001, 14))), "from 1 to 10000"
    ),
    "texts": Case(
        "answers numbers as text", POLICY, answering(np.full((2, 14), "0.5")), "the policy answered"
    ),
}


def cases() -> Iterator[tuple[str, str]]:
    for fault, name in itertools.product(CASES, SERVERS):
        # Arrays of text do not exist in these.
        if (fault, name) not in (
            ("texts", "openpi"),
            ("texts", "vla-eval"),
            ("texts", "xpolicylab"),
        ):
            yield fault, name


@pytest.mark.parametrize(("fault", "name"), cases())
def test_it_ends_alike_in_every_dialect(fault: str, name: str) -> None:
    import re

    case = CASES[fault]
    error = case.fault(name)
    assert isinstance(error, PolicyError if case.end == POLICY else TransportError)
    assert re.search(case.says, str(error)), str(error)
    assert str(error).isprintable()


@pytest.mark.parametrize("name", SERVERS)
def test_a_server_that_restarts_between_trials(name: str) -> None:
    with talking(name, lambda seen: joint_chunk(), LIMIT) as (policy, line):
        line.cut()
        policy.reconnect()
        policy.reset(TRIAL)
        assert policy.infer(observation()).shape == (3, 14)


@pytest.mark.parametrize("name", SERVERS)
def test_a_door_that_closes_later_is_not_taken_for_another_dialect(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is there after a first success is in trouble; that is no reason to stop the run."""
    monkeypatch.setattr(dialect, "SECONDS", 0.5)
    with talking(name, lambda seen: joint_chunk(), replace(LIMIT, wait=0.5)) as (policy, line):
        line.mode = "cut"
        line.cut()
        with pytest.raises(TransportError) as caught:
            policy.reconnect()
            policy.reset(TRIAL)
            policy.infer(observation())
        assert "looks like" not in str(caught.value)
