"""What a server or its line does wrong ends in the same way in every dialect."""

import contextlib
import itertools
import re
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from standins import DIALECTS
from standins_http import TRIAL, joint_chunk, observation

from robospa.clients import connect, dialect
from robospa.protocol.client import RemotePolicy
from robospa.protocol.errors import CallTimeout, PolicyError, ServerError, TransportError
from robospa.protocol.transport import Timeouts

LIMIT = Timeouts(10, 30, 30, 30, 30, 30, 30, 0.2)
SHORT = Timeouts(10, 30, 30, 30, 30, 0.3, 30, 0.2)


HUGE = {
    "http": b"HTTP/1.1 200 OK\r\nContent-Length: 2147483648\r\n\r\n",
    "tcp": struct.pack(">I", 2**31),
    "zmq": struct.pack(">BQ", 2, 2**31),
    "socket": struct.pack(">BBQ", 0x82, 127, 2**31),
}
"""How 2 GB are announced."""


class BadLine:
    """Passes bytes to the port `to` and back. `mode` is good, hang, drip, cut, half, huge, twice or
    gone; `kind` a key of HUGE. A context manager that gives its port."""

    def __init__(self, to: int, kind: str) -> None:
        self.to, self.kind, self.mode = to, kind, "good"
        self._ends: list[socket.socket] = []
        self._over = threading.Event()

    def __enter__(self) -> int:
        self._door = socket.create_server(("127.0.0.1", 0))
        port: int = self._door.getsockname()[1]
        threading.Thread(target=self._welcome, daemon=True).start()
        return port

    def __exit__(self, *_: object) -> None:
        self._over.set()
        _end(self._door)
        self.cut()

    def cut(self) -> None:
        """End all connections."""
        for end in self._ends:
            _end(end)
        self._ends = []

    def _welcome(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._door.accept()
                server = socket.create_connection(("127.0.0.1", self.to))
                self._ends += [client, server]
                for work in ((client, server, self._there), (server, client, self._back)):
                    threading.Thread(target=self._carry, args=work, daemon=True).start()

    def _carry(self, source: Any, target: Any, how: Any) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(2**20):
                how(data, source, target)
        _end(source)
        _end(target)

    def _there(self, data: bytes, source: Any, target: Any) -> None:
        target.sendall(data)

    def _back(self, data: bytes, source: Any, target: Any) -> None:
        mode = self.mode
        if mode == "good":
            target.sendall(data)
        elif mode == "drip":
            while not self._over.wait(0.05):
                target.sendall(data[:1])
                data = data[1:] or b" "
        elif mode == "huge":
            target.sendall(HUGE[self.kind])
            moment()
            _end(target)
        elif mode == "twice":
            whole = data + _rest(source)
            target.sendall(whole + whole)
        elif mode in ("cut", "half"):
            target.sendall(data[: 10 * (mode == "half")])
            _end(target)
        else:
            assert mode == "hang"


def _rest(source: socket.socket) -> bytes:
    """What follows within a moment."""
    found = b""
    source.settimeout(0.1)
    with contextlib.suppress(TimeoutError):
        while piece := source.recv(2**20):
            found += piece
    source.settimeout(None)
    return found


def _end(end: socket.socket) -> None:
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()


def moment() -> None:
    """Time enough for bytes to cross a loopback."""
    time.sleep(0.05)


@contextmanager
def talking(name: str, model: Any, timeouts: Timeouts) -> Iterator[tuple[RemotePolicy, BadLine]]:
    """A client that has been answered once, and the line between it and the server."""
    make, kind, options = DIALECTS[name]
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
        if DIALECTS[name][1] in ("http", "zmq"):  # what follows an answer is dropped
            assert policy.infer(observation(6))[0, 0] == 2
            return TransportError("not requested")
        with pytest.raises(TransportError) as caught:
            policy.infer(observation(6))
    return caught.value


def spoiled(number: float) -> Any:
    chunk = joint_chunk()
    chunk[1, 4] = number
    return chunk


PLACE = "in action 1, dimension 4"
LATE = r"within 0\.3 s; look at the server's log"
CASES: dict[str, tuple[type[Exception], Callable[[str], Exception], str]] = {
    "hangs": (CallTimeout, broken("hang", SHORT), LATE),
    "a byte at a time": (CallTimeout, broken("drip", SHORT), LATE),
    "crashes": (TransportError, broken("cut"), "the connection to "),
    "crashes in mid-message": (TransportError, broken("half"), "the connection to "),
    "announces 2 GB": (TransportError, broken("huge"), "over|more than"),
    "answers twice": (TransportError, twice, "came to|not requested"),
    "fails": (PolicyError, failing, "the server reported "),
    "nan": (PolicyError, answering(spoiled(np.nan)), f"nan {PLACE}|actions of NaN"),
    "infinity": (PolicyError, answering(spoiled(np.inf)), f"inf {PLACE}|actions of NaN"),
    "too large": (PolicyError, answering(spoiled(1e300)), f"inf {PLACE}"),
    "shape": (PolicyError, answering(np.zeros((2, 13))), "not|but a joint"),
    "many": (PolicyError, answering(np.zeros((10_001, 14))), "from 1 to 10000"),
    "texts": (PolicyError, answering(np.full((2, 14), "0.5")), "the policy answered"),
}
"""What a server does: the error, how it is caused, and part of what the user reads."""
NO_TEXTS = ("gr00t", "openpi", "vla-eval", "xpolicylab")
"""Arrays of text do not exist in these."""


@pytest.mark.parametrize("name", DIALECTS)
@pytest.mark.parametrize("what", CASES)
def test_it_ends_alike_in_every_dialect(what: str, name: str) -> None:
    if what == "texts" and name in NO_TEXTS:
        return
    kind, fault, says = CASES[what]
    error = fault(name)
    assert isinstance(error, kind)
    assert re.search(says, str(error)), str(error)
    assert str(error).isprintable()


@pytest.mark.parametrize("name", DIALECTS)
def test_a_server_that_restarts_between_trials(name: str) -> None:
    with talking(name, lambda seen: joint_chunk(), LIMIT) as (policy, line):
        line.cut()
        if name in ("openpi", "vla-eval"):  # their server does not answer that a trial begins
            policy.reconnect()
        policy.reset(TRIAL)
        assert policy.infer(observation()).shape == (3, 14)


@pytest.mark.parametrize("name", DIALECTS)
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
