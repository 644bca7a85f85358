"""Who is let in: tokens, versions, browsers, TLS."""

from __future__ import annotations

import http.client
import ssl
import subprocess
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect as open_socket
from websockets.typing import Origin
from wire_helpers import QUICK, TRIAL, Recall, observation

from robospa.protocol.client import connect
from robospa.protocol.errors import (
    ConnectFailed,
    HandshakeError,
    Unauthorized,
)
from robospa.protocol.server import ServerThread
from robospa.protocol.transport import Address, Transport


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
