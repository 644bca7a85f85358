"""HTTP answers without an end: refused at their deadline, in one sentence."""

from __future__ import annotations

import contextlib
import logging
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from run_fakes import FakePolicy

from robospa.clients import find_endpoint
from robospa.clients.dialect import ConnectionParams
from robospa.clients.http import JsonServer
from robospa.protocol.errors import CallTimeout, HandshakeError
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
