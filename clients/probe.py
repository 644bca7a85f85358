"""Harmless questions to a server whose dialect is not known.

Each has a short deadline and a bounded answer, and none runs a model.
"""

from __future__ import annotations

import http.client
import json
from dataclasses import dataclass, field

from robospa.clients.dialect import ConnectionParams
from robospa.clients.http import open_http

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
    """A server to be recognised; `params` have short deadlines and small limits."""

    params: ConnectionParams
    _answers: dict[tuple[str, str, bytes | None], HttpAnswer] = field(default_factory=dict)

    def http(self, method: str, path: str, body: bytes | None = None) -> HttpAnswer:
        """What the server answers; the same request is sent once."""
        request = (method, path, body)
        if request not in self._answers:
            self._answers[request] = self._ask(method, path, body)
        return self._answers[request]

    def _ask(self, method: str, path: str, body: bytes | None) -> HttpAnswer:
        params = self.params
        connection = open_http(params.endpoint, params.timeouts.connect, params.ssl)
        try:
            connection.request(method, path, body, {"Content-Type": "application/json"})
            response = connection.getresponse()
            return HttpAnswer(response.status, response.read(ANSWER))
        except (OSError, ValueError, http.client.HTTPException):
            return HttpAnswer(None)
        finally:
            connection.close()
