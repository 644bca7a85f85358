"""Who is let in: tokens, versions, browsers, TLS."""

from __future__ import annotations

import http.client
import ssl
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from run_fakes import FakePolicy
from websockets.datastructures import Headers
from websockets.exceptions import InvalidStatus
from websockets.http11 import Request, Response
from websockets.sync.client import connect as open_socket
from websockets.sync.server import serve
from websockets.typing import Origin
from wire_helpers import QUICK, TRIAL, Recall, observation

from robospa.clients import connect
from robospa.protocol.client import connect as connect_ours
from robospa.protocol.errors import (
    ConnectFailed,
    HandshakeError,
    Unauthorized,
)
from robospa.protocol.server import ServerThread
from robospa.protocol.transport import Address, Transport, _moved


def test_the_token_is_needed(start: Any) -> None:
    url = start(policy_factory=Recall, token="s3cret").url
    connect(url, token="s3cret", timeouts=QUICK).close()
    for token in (None, "", "wrong", "s3cret2"):
        with pytest.raises(Unauthorized, match="missing or wrong token"):
            connect(url, token=token, timeouts=QUICK)


def test_another_version_is_refused(start: Any) -> None:
    url = start(Recall()).url
    with pytest.raises(HandshakeError, match=r"speaks robospa\.v1, not robospa\.v2"):
        Transport(Address(url), QUICK, subprotocol="robospa.v2")


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


@contextmanager
def redirecting(location: str) -> Iterator[tuple[str, list[Request]]]:
    """A WebSocket server that sends everybody to `location`; its URL, and what it was asked."""
    asked: list[Request] = []

    def answer(connection: Any, request: Request) -> Response:
        asked.append(request)
        return Response(302, "Found", Headers({"Location": location, "Content-Length": "0"}), b"")

    server = serve(lambda connection: None, "127.0.0.1", 0, process_request=answer)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}", asked
    finally:
        server.shutdown()
        thread.join(5)


def test_another_host_is_not_followed_and_gets_no_token() -> None:
    with ServerThread(FakePolicy(), token="secret") as other:
        target = other.url.replace("127.0.0.1", "localhost")
        with (
            redirecting(target) as (url, _),
            pytest.raises(HandshakeError, match=r"redirects to ws://localhost:.*not followed"),
        ):
            connect_ours(url, "secret", QUICK)
        assert other.load.sessions == 0


def test_another_address_of_the_same_host_is_followed_and_recorded() -> None:
    with ServerThread(FakePolicy()) as other, redirecting(other.url) as (url, asked):
        with connect(url, timeouts=QUICK) as policy:
            assert policy.hello["redirected_to"] == other.url
            policy.reconnect()
        assert len(asked) == 2
    with ServerThread(FakePolicy()) as server, connect(server.url, timeouts=QUICK) as policy:
        assert "redirected_to" not in policy.hello


def test_a_circle_ends() -> None:
    with redirecting("/again") as (url, asked), pytest.raises(HandshakeError, match="for ever"):
        connect_ours(url, timeouts=QUICK)
    assert 1 < len(asked) < 6


@pytest.mark.parametrize(
    ("url", "location", "target"),
    [
        ("ws://gpu:8000", "/v2", "ws://gpu:8000/v2"),
        ("ws://gpu:8000", "https://gpu/v2", "wss://gpu/v2"),
        ("ws://gpu:8000", "wss://GPU:8443", "wss://GPU:8443"),
        ("wss://gpu", "wss://gpu:1/", "wss://gpu:1/"),
        ("wss://gpu", "ws://gpu", None),
        ("ws://gpu", "wss://gpu.evil.org", None),
        ("ws://gpu", "wss://gpu@evil.org", None),
        ("ws://gpu", "//evil.org/", None),
        ("ws://gpu", "file:///etc/passwd", None),
        ("ws://gpu", "", None),
    ],
)
def test_where_a_redirect_may_lead(url: str, location: str, target: str | None) -> None:
    if target is None:
        with pytest.raises(HandshakeError, match="redirects to"):
            _moved(Address(url), location)
    else:
        assert _moved(Address(url, "token"), location) == Address(target, "token")
