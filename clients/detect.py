"""Which dialect a server speaks, if it is not the one it was spoken to in.

Only asked when something has gone wrong already. A server that is busy answers none of the
questions (`Probe`), and the error stays as it was.
"""

from __future__ import annotations

import contextlib
import http.client
import json
from dataclasses import dataclass, field, replace

from robospa.clients.dialect import ConnectionParams, Dialect, dialects
from robospa.protocol.codec import Limits
from robospa.protocol.errors import HandshakeError, WireError
from robospa.protocol.transport import Timeouts, Transport

ANSWER = 2**16
"""Bytes of an HTTP answer that are read."""


@dataclass(frozen=True)
class HttpAnswer:
    """`status` is None if what came back, or did not, was no HTTP."""

    status: int | None
    body: bytes = b""

    def json(self) -> dict[str, object] | None:
        """The body as a JSON map, None for anything else."""
        try:
            value = json.loads(self.body)
        except (ValueError, RecursionError):
            return None
        return value if isinstance(value, dict) else None


@dataclass(frozen=True)
class Probe:
    """Harmless questions to a server to be recognised: `params` have short deadlines and small
    limits, answers are bounded, and none runs a model."""

    params: ConnectionParams
    _answers: dict[tuple[str, str, bytes | None], HttpAnswer] = field(default_factory=dict)

    def http(self, method: str, path: str, body: bytes | None = None) -> HttpAnswer:
        """What the server answers; the same request is sent once."""
        request = (method, path, body)
        if request not in self._answers:
            self._answers[request] = self._ask(method, path, body)
        return self._answers[request]

    def _ask(self, method: str, path: str, body: bytes | None) -> HttpAnswer:
        connection = self.params.open_http()
        try:
            connection.request(method, path, body, {"Content-Type": "application/json"})
            response = connection.getresponse()
            return HttpAnswer(response.status, response.read(ANSWER))
        except (OSError, ValueError, http.client.HTTPException):
            return HttpAnswer(None)
        finally:
            connection.close()


SECONDS = 1.5
"""Deadline of each question."""
SMALL = Limits(message=2**22)
WEBSOCKET = "a WebSocket server"
HTTP = "an HTTP server of another kind"


def explain_error(error: WireError, params: ConnectionParams) -> WireError:
    """`error`, or a HandshakeError that also says which dialect the server seems to speak."""
    endpoint = params.endpoint
    found = detect(params)
    if found is None or _fits(endpoint.dialect, found):
        return error
    advice = ""
    if isinstance(found, Dialect):
        scheme = found.secure_scheme if endpoint.secure and found.secure_scheme else found.scheme
        advice = f"; try {scheme}://{endpoint.authority}"
    server = found if isinstance(found, str) else found.server
    explanation = HandshakeError(f"{endpoint.url} looks like {server}{advice} ({error})")
    explanation.__cause__ = error
    return explanation


def _fits(spoken: Dialect, found: Dialect | str) -> bool:
    """Whether the dialect that was spoken is right for the server that was found."""
    if isinstance(found, str):
        return found == WEBSOCKET and spoken.wire == "websocket"
    return found.scheme in (spoken.scheme, *spoken.also_reaches)


def detect(params: ConnectionParams) -> Dialect | str | None:
    """The dialect of the server, or a phrase for one of no known dialect; None: cannot be told."""
    timeouts = Timeouts(
        connect=SECONDS, hello=SECONDS, reset=SECONDS, first_infer=SECONDS, infer=SECONDS, close=0.2
    )
    probe = Probe(replace(params, timeouts=timeouts, limits=SMALL))
    status = probe.http("GET", "/health").status
    if status is not None and status >= 500:
        return None  # in trouble, or full: no sign of another dialect
    for dialect in sorted(dialects(), key=lambda dialect: dialect.weak_sign):
        if (dialect.wire == "tcp") == (status is None) and dialect.recognise is not None:
            # Whatever a question comes to, the error that led here is the one to report.
            with contextlib.suppress(Exception):
                if dialect.recognise(probe):
                    return dialect
    if status is None:
        return None
    return WEBSOCKET if status == 426 or _opens_websocket(probe.params) else HTTP


def _opens_websocket(params: ConnectionParams) -> bool:
    try:
        Transport(params.websocket_address(), params.timeouts, params.limits).close()
    except WireError:
        return False
    return True
