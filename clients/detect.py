"""Which dialect does a server look like, if it is not the one it was spoken to in?

Only asked when something has gone wrong already. A few harmless requests, each with a short
deadline and a bounded answer, none of which runs a model: a health page, an empty body to `/act`, a
greeting over WebSocket, an empty command over TCP. A server that is busy answers none of them, and
then nothing is said.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from robospa.clients.http import open_http
from robospa.clients.numpy_msgpack import binary_form, pack, unpack
from robospa.protocol.codec import Limits
from robospa.protocol.errors import HandshakeError, WireError
from robospa.protocol.transport import Address, Timeouts, Transport

if TYPE_CHECKING:
    from robospa.clients import Line, Target

SECONDS = 1.5
"""Deadline of each request."""
BYTES = 2**16
SMALL = Limits(message=2**22)


@dataclass(frozen=True)
class Look:
    """What a server looks like: `what`, and the `scheme` that reaches it ("" if none does)."""

    what: str
    scheme: str = ""


ROBOSPA = Look("a robospa.v1 server", "ws")
OPENPI = Look("an openpi server", "openpi")
VLA_EVAL = Look("a vla-eval model server", "vla-eval")
XPOLICYLAB = Look("an XPolicyLab policy server", "xpolicylab")
WEBSOCKET = Look("a WebSocket server", "ws")
GO1 = Look("GO-1's server", "go1+http")
XVLA = Look("X-VLA's server", "xvla+http")
HTTP = Look("an HTTP server of another kind")
TCP = Look("RoboTwin's model server", "robotwin+tcp")


def explained(error: WireError, line: Line) -> WireError:
    """`error`, or a HandshakeError that also says which dialect the server looks like."""
    target = line.target
    seen = look(line)
    if seen is None or speaks(target.scheme, seen):
        return error
    try_this = ""
    if seen.scheme:
        secure = {"ws": "wss", "go1+http": "go1+https", "xvla+http": "xvla+https"}
        scheme = secure.get(seen.scheme, seen.scheme) if target.secure else seen.scheme
        host = f"[{target.host}]" if ":" in target.host else target.host
        try_this = f"; try {scheme}://{host}:{target.port}"
    found = HandshakeError(f"{target.url} looks like {seen.what}{try_this} ({error})")
    found.__cause__ = error
    return found


def speaks(scheme: str, seen: Look) -> bool:
    """Whether `scheme` is right for what was seen."""
    plain = scheme.removesuffix("s") if scheme in ("wss", "go1+https", "xvla+https") else scheme
    if seen is WEBSOCKET:
        return plain in ("ws", "openpi", "xpolicylab", "vla-eval")
    if plain == "ws":
        return seen in (ROBOSPA, OPENPI)
    # Our own server also answers an openpi client.
    return plain == seen.scheme or (plain == "openpi" and seen is ROBOSPA)


def look(line: Line) -> Look | None:
    """What listens there, or None if that cannot be told."""
    target = line.target
    status, body = _request(line, "GET", "/health")
    if status == 200 and _json(body) == {"status": "ok"}:
        return VLA_EVAL
    if status is None:
        return _look_tcp(target)
    if status >= 500:
        return None  # in trouble, or full: no sign of another dialect
    act, answer = _request(line, "POST", "/act", b"{}")
    if act == 500:
        return GO1
    if act == 400 and "error" in (_json(answer) or {}):
        return XVLA
    return _look_websocket(line) or (WEBSOCKET if status == 426 else HTTP)


def _request(
    line: Line, method: str, path: str, body: bytes | None = None
) -> tuple[int | None, bytes]:
    """Status and beginning of the answer; None if what came back was not HTTP."""
    connection = open_http(line.target, SECONDS, line.ssl)
    try:
        connection.request(method, path, body, {"Content-Type": "application/json"})
        response = connection.getresponse()
        return response.status, response.read(BYTES)
    except (OSError, ValueError, http.client.HTTPException):
        return None, b""
    finally:
        connection.close()


def _json(body: bytes) -> Any:
    try:
        value = json.loads(body)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None


def _look_websocket(line: Line) -> Look | None:
    """What greets over a WebSocket, or answers XPolicyLab's greeting."""
    target = line.target
    host = f"[{target.host}]" if ":" in target.host else target.host
    url = f"{'wss' if target.secure else 'ws'}://{host}:{target.port}{target.path}"
    short = Timeouts(connect=SECONDS, hello=SECONDS, close=0.2)
    try:
        transport = Transport(Address(url, line.token, line.ssl), short, SMALL)
    except WireError:
        return None
    try:
        if transport.subprotocol is not None:
            return ROBOSPA
        hello = {
            "message_type": "hello",
            "message_id": "0",
            "evaluation_id": "robospa",
            "payload": {},
        }
        transport.send(pack(hello, binary_form, SMALL))
        data = transport.receive(SECONDS, "a greeting")
        value = unpack(data, SMALL) if isinstance(data, bytes) else None
        if isinstance(value, dict) and value.get("message_type") == "hello_ack":
            return XPOLICYLAB
        return OPENPI if isinstance(value, dict) else WEBSOCKET
    except WireError:
        return None
    finally:
        transport.close()


def _look_tcp(target: Target) -> Look | None:
    """RoboTwin's server refuses a command without a name in a framed JSON map."""
    with contextlib.suppress(OSError, ValueError):
        with socket.create_connection((target.host, target.port), SECONDS) as sock:
            sock.settimeout(SECONDS)
            text = json.dumps({"cmd": "", "obs": None}).encode()
            sock.sendall(len(text).to_bytes(4, "big") + text)
            data = b""
            while len(data) < 4 or len(data) < 4 + min(int.from_bytes(data[:4], "big"), BYTES):
                piece = sock.recv(4096)
                if not piece:
                    break
                data += piece
        if "error" in (_json(data[4:]) or {}):
            return TCP
    return None
