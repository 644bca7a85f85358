"""JSON over HTTP to a model server, with every failure turned into an error of the protocol.

One connection that is kept open; a server that closed it between two requests is connected to once
more, because such a request never reached a model. The size of an answer is bounded. Standard
library only, and no proxies: a model server is a machine of one's own.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import select
import socket
import ssl as ssl_module
import threading
import time
from collections.abc import Mapping

from robospa.clients.dialect import ConnectionParams, Endpoint
from robospa.protocol.errors import (
    CallTimeout,
    ConnectFailed,
    ConnectionLost,
    HandshakeError,
    ProtocolViolation,
    ServerError,
    Unauthorized,
    printable,
    without_secrets,
)
from robospa.protocol.transport import MOVED

MAX_ANSWER = 64 * 2**20
"""Bytes of an answer; a chunk as JSON is some kilobytes."""
MAX_REASON = 300
"""Characters of a server's error text that are repeated."""
WRONG_ADDRESS = {
    "HTTP 404": "does not exist there: is it another server, or another path?",
    "HTTP 426": "is a WebSocket, not an HTTP endpoint",
}
"""What the status of a first request says about the address."""
UNAVAILABLE = (
    http.HTTPStatus.TOO_MANY_REQUESTS,
    http.HTTPStatus.BAD_GATEWAY,
    http.HTTPStatus.SERVICE_UNAVAILABLE,
    http.HTTPStatus.GATEWAY_TIMEOUT,
)
"""The server is not there, or has no room: what stands before it answers in its place."""
FIRST_PAUSE, LONGEST_PAUSE = 0.02, 1.0
"""[s] between two requests to a server that is not available."""
STALE_CONNECTION = (http.client.RemoteDisconnected, ConnectionResetError, BrokenPipeError)


def open_http(
    endpoint: Endpoint, timeout: float, ssl: ssl_module.SSLContext | None
) -> http.client.HTTPConnection:
    """A connection to be made, with TLS if the scheme asks for it."""
    host, port = endpoint.host, endpoint.port
    if endpoint.secure:
        return http.client.HTTPSConnection(host, port, timeout=timeout, context=ssl)
    return http.client.HTTPConnection(host, port, timeout=timeout)


class JsonServer:
    """The HTTP server at `params.endpoint`. Not thread-safe."""

    def __init__(self, params: ConnectionParams) -> None:
        endpoint, timeouts, token = params.endpoint, params.timeouts, params.token
        self.url = f"{'https' if endpoint.secure else 'http'}://{endpoint.authority}"
        self._connection = open_http(endpoint, timeouts.connect, params.ssl)
        self._headers = {"Content-Type": "application/json", "Accept": "application/json"}
        if token is not None:
            self._headers["Authorization"] = f"Bearer {token}"
        self._fresh, self._wait = False, timeouts.wait
        self._connect(timeouts.wait)

    def greet(self, path: str, timeout: float) -> None:
        """Ask whether `path` takes POST at all, without running a model.

        Raises HandshakeError if it does not exist or is a WebSocket's, and what `post` raises. An
        endpoint for POST answers a GET with 405, which is as good as anything else.
        """
        try:
            self.request("GET", path, None, timeout, patience=self._wait)
        except ServerError as error:
            if error.code in WRONG_ADDRESS:
                raise HandshakeError(
                    f"{self.url}{path} {WRONG_ADDRESS[error.code]} ({error.code}: {error.message})"
                ) from error
        except ProtocolViolation:
            return  # it answered, only not in JSON

    def post(self, path: str, body: bytes, timeout: float) -> object:
        """The decoded JSON answer to a POST.

        While the server is not available (UNAVAILABLE) the request is repeated until it is late.
        Raises ConnectFailed, ConnectionLost, CallTimeout, Unauthorized, ServerError for any other
        status that is not 200, ProtocolViolation for an answer that is no JSON.
        """
        return self.request("POST", path, body, timeout)

    def get(self, path: str, timeout: float) -> object:
        """The decoded JSON answer to a GET; errors as in `post`."""
        return self.request("GET", path, None, timeout)

    def request(
        self,
        method: str,
        path: str,
        body: bytes | None,
        timeout: float,
        patience: float | None = None,
    ) -> object:
        """One request; see `post`. `patience`: how long the server may be unavailable [s], by
        default for all of `timeout`."""
        now, pause = time.monotonic(), FIRST_PAUSE
        until, give_up = now + timeout, now + (timeout if patience is None else patience)
        while True:
            status, reason, data = self._answer(method, path, body, timeout, until)
            if status not in UNAVAILABLE:
                break
            if time.monotonic() + pause > give_up:
                raise ConnectFailed(
                    f"{self.url}{path} answered HTTP {status}: {_reason(data) or reason}; start "
                    "the policy server behind it, or allow more time"
                )
            time.sleep(pause)
            pause = min(2 * pause, LONGEST_PAUSE)
        if status in (http.HTTPStatus.UNAUTHORIZED, http.HTTPStatus.FORBIDDEN):
            raise Unauthorized(f"{self.url}{path} refused the request: {_reason(data) or reason}")
        if status != http.HTTPStatus.OK:
            text = _reason(data) or reason
            raise ServerError(f"HTTP {status}", text, status >= 500, f"{self.url}{path}")
        return self._decoded(path, data)

    def _answer(
        self, method: str, path: str, body: bytes | None, timeout: float, until: float
    ) -> tuple[int, str, bytes]:
        """Status, reason and body of the answer to one request, before `until`."""
        try:
            status, reason, data = self._exchange(method, path, body, until)
        except STALE_CONNECTION as error:
            if self._fresh:
                raise self._lost(error) from error
            self._connection.close()
            self._connect(0.0)
            try:
                status, reason, data = self._exchange(method, path, body, until)
            except (OSError, http.client.HTTPException) as again:
                raise self._failed(again, path, timeout) from again
        except (OSError, http.client.HTTPException) as error:
            raise self._failed(error, path, timeout) from error
        self._fresh = False
        return status, reason, data

    def close(self) -> None:
        """Close; harmless when closed already."""
        self._connection.close()

    def _connect(self, wait: float) -> None:
        give_up = time.monotonic() + wait
        while True:
            try:
                self._connection.connect()
                self._fresh = True
                return
            except ConnectionRefusedError as error:
                if time.monotonic() >= give_up:
                    raise ConnectFailed(
                        f"cannot connect to {self.url}: nothing listens there; "
                        "start the policy server first"
                    ) from error
                time.sleep(0.05)
            except OSError as error:
                raise ConnectFailed(f"cannot connect to {self.url}: {error}") from error

    def _exchange(
        self, method: str, path: str, body: bytes | None, until: float
    ) -> tuple[int, str, bytes]:
        """Status, reason and body, all of it before `until` on the monotonic clock."""
        if self._connection.sock is None:
            self._connect(0.0)
        sock = self._connection.sock
        if has_unread_bytes(sock):
            self.close()
            raise ProtocolViolation(f"{self.url} sent data that was not requested")
        left = max(until - time.monotonic(), 1e-3)
        sock.settimeout(left)
        # A time limit of a socket is that of a single byte: a server that sends one now and then
        # would never be late.
        late = threading.Event()
        alarm = threading.Timer(left, _shut, (sock, late))
        alarm.daemon = True
        alarm.start()
        try:
            self._connection.request(method, path, body, self._headers)
            response = self._connection.getresponse()
            if (response.length or 0) <= MAX_ANSWER:
                data = response.read(MAX_ANSWER + 1)
                if late.is_set():  # an answer without a length seems to end with its connection
                    raise TimeoutError
                if response.status in MOVED:
                    self.close()
                    target = without_secrets(response.headers.get("Location") or "nowhere")
                    raise HandshakeError(
                        f"{self.url}{path} redirects to {printable(target, 200)}, which is not "
                        "followed: if that is the policy server, give its address"
                    )
                if len(data) <= MAX_ANSWER:
                    return response.status, response.reason, data
        except (OSError, http.client.HTTPException) as error:
            if late.is_set():
                raise TimeoutError from error
            raise
        finally:
            alarm.cancel()
        self.close()
        raise ProtocolViolation(f"{self.url}{path} answered more than {MAX_ANSWER} bytes")

    def _failed(self, error: Exception, path: str, timeout: float) -> Exception:
        if isinstance(error, TimeoutError | socket.timeout):
            self.close()
            return CallTimeout(
                f"{self.url}{path} did not answer within {timeout:g} s; "
                "look at the server's log, or allow more time"
            )
        return self._lost(error)

    def _lost(self, error: Exception) -> ConnectionLost:
        with contextlib.suppress(OSError):
            self.close()
        reason = str(error) or type(error).__name__
        return ConnectionLost(f"the connection to {self.url} ended while waiting: {reason}")

    def _decoded(self, path: str, data: bytes) -> object:
        try:
            return json.loads(data)
        except (ValueError, RecursionError) as error:
            raise ProtocolViolation(f"{self.url}{path} did not answer JSON: {error}") from error


def has_unread_bytes(sock: socket.socket) -> bool:
    """Whether bytes have arrived at `sock` that were not read yet; False if it is closed."""
    if isinstance(sock, ssl_module.SSLSocket):
        return sock.pending() > 0
    if not select.select([sock], [], [], 0)[0]:
        return False
    try:
        return bool(sock.recv(1, socket.MSG_PEEK))
    except OSError:
        return False


def _shut(sock: socket.socket, late: threading.Event) -> None:
    """End a connection that another thread waits for, and say so."""
    late.set()
    with contextlib.suppress(OSError):
        sock.shutdown(socket.SHUT_RDWR)


def _reason(data: bytes) -> str:
    """A server's error text in one line."""
    text = data.decode("utf-8", "replace").strip()
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        value = text
    if isinstance(value, Mapping):
        value = value.get("error", value.get("detail", value.get("message", value)))
    return printable(str(value), MAX_REASON)
