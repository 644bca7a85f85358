"""HTTP answers without an end: refused at their deadline, in one sentence."""

from __future__ import annotations

import contextlib
import itertools
import logging
import socket
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from run_fakes import FakePolicy
from standins import QUICK, Go1, Status, answered, joint_chunk, observation

from robospa.clients import connect, find_endpoint
from robospa.clients.dialect import ConnectionParams
from robospa.clients.http import JsonServer
from robospa.protocol.errors import CallTimeout, HandshakeError, TransportError
from robospa.protocol.server import ServerThread
from robospa.protocol.transport import Address, Timeouts, Transport


@contextmanager
def answering(answer: bytes) -> Iterator[JsonServer]:
    """A client to a server that sends `answer` to every request and never ends the connection."""
    listener = socket.create_server(("127.0.0.1", 0))
    held: list[socket.socket] = []

    def accept() -> None:
        with contextlib.suppress(OSError):
            while True:
                held.append(listener.accept()[0])
                held[-1].recv(65536)
                held[-1].sendall(answer)

    threading.Thread(target=accept, daemon=True).start()
    endpoint = find_endpoint(f"go1+http://127.0.0.1:{listener.getsockname()[1]}")
    server = JsonServer(ConnectionParams(endpoint, Timeouts(connect=10)))
    try:
        yield server
    finally:
        server.close()
        listener.close()
        for each in held:
            each.close()


def test_a_whole_answer_without_a_length_whose_end_never_comes_is_late() -> None:
    """Its deadline ends the connection, which would look like the end of the answer."""
    with (
        answering(b"HTTP/1.1 200 OK\r\n\r\n[[0, 1]]") as server,
        pytest.raises(CallTimeout, match="did not answer within"),
    ):
        server.request("GET", "/act", None, 0.2)


def test_a_redirect_is_not_followed_and_named() -> None:
    with (
        answering(
            b"HTTP/1.1 307 Go\r\nLocation: https://evil.org/act\r\nContent-Length: 0\r\n\r\n"
        ) as server,
        pytest.raises(HandshakeError, match=r"redirects to https://evil\.org/act, which is not"),
    ):
        server.request("POST", "/act", b"{}", 10.0)


def test_what_the_library_thinks_of_odd_servers_is_not_printed() -> None:
    """Its thread meets an endless answer as an internal error, now and then."""
    with ServerThread(FakePolicy()) as server:
        transport = Transport(Address(server.url), Timeouts(connect=10))
        assert not transport._socket.logger.isEnabledFor(logging.ERROR)
        transport.close()


class Gateway(Go1):
    """Refuses requests with these statuses before any reaches the model."""

    def __init__(self, refusals: Iterable[int]) -> None:
        super().__init__()
        self.refusals = iter(refusals)

    def act(self, body: bytes) -> Any:
        status = next(self.refusals, None)
        if status is not None:
            raise Status(status, b"no upstream")
        return super().act(body)


@pytest.mark.parametrize("status", [429, 502, 503, 504])
def test_an_unavailable_server_is_asked_again_within_the_trial(status: int) -> None:
    server = Gateway([status, status])
    assert np.array_equal(answered(server), joint_chunk().astype(np.float32))
    assert len(server.requests) == 1


def test_a_server_that_stays_unavailable_is_no_error_of_the_policy() -> None:
    limit = replace(QUICK, first_infer=0.1, infer=0.1)
    server = Gateway(itertools.repeat(503))
    late = pytest.raises(TransportError, match=r"answered HTTP 503: no upstream|within 0\.1 s")
    with server as url, connect(url, timeouts=limit) as policy, late:
        policy.infer(observation())
