"""JSON over HTTP to a model server, with every failure turned into an error of the protocol.

One connection that is kept open; a server that closed it between two requests is connected to once
more, because such a request never reached a model. The size of an answer is bounded. Standard
library only, and no proxies: a model server is a machine of one's own.
"""

import base64
import contextlib
import http.client
import json
import select
import socket
import ssl as ssl_module
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.clients.chunks import as_chunk, plain_dtype
from robospa.clients.dialect import ConnectionParams, StatelessSession, explain_error
from robospa.protocol import errors
from robospa.protocol.messages import BUSY
from robospa.protocol.policy import PolicySpec
from robospa.protocol.transport import MOVED, NotYet, connect_until, refuse_tls

MAX_ANSWER = 64 * 2**20
"""Bytes of an answer; a chunk as JSON is some kilobytes."""
MAX_REASON = 300
"""Characters of a server's error text that are repeated."""
WRONG_ADDRESS = {
    "HTTP 404": "does not exist there: is it another server, or another path?",
    "HTTP 426": "is a WebSocket, not an HTTP endpoint",
}
"""What the status of a first request says about the address."""
UNAVAILABLE = (429, 502, 503, 504)
"""The server is not there, or has no room: what stands before it answers in its place."""
TEXT = "an error"
"""Code of an answer that is a bare text."""
STALE_CONNECTION = (http.client.RemoteDisconnected, ConnectionResetError, BrokenPipeError)


class JsonServer:
    """The HTTP server at `params.endpoint`. Not thread-safe."""

    def __init__(self, params: ConnectionParams) -> None:
        endpoint, timeouts, token = params.endpoint, params.timeouts, params.token
        self.url = f"{'https' if endpoint.secure else 'http'}://{endpoint.authority}"
        self._connection = params.open_http()
        self._headers = {"Content-Type": "application/json", "Accept": "application/json"}
        if token is not None:
            self._headers["Authorization"] = f"Bearer {token}"
        self._fresh, self._wait = False, timeouts.wait
        self._connect(timeouts.wait)

    def greet(self, path: str, timeout: float) -> None:
        """Ask whether `path` takes POST at all, without running a model.

        Raises HandshakeError if it does not exist or is a WebSocket's, and what `request` does. An
        endpoint for POST answers a GET with 405, which is as good as anything else.
        """

        def ask() -> None:
            try:
                self.request("GET", path, None, timeout)
            except errors.ServerError as error:
                if error.code != BUSY:
                    raise
                raise NotYet(errors.ConnectFailed(error.message)) from error

        try:
            connect_until(self.url, self._wait, ask)
        except errors.ServerError as error:
            if error.code in WRONG_ADDRESS:
                raise errors.HandshakeError(
                    f"{self.url}{path} {WRONG_ADDRESS[error.code]} ({error.code}: {error.message})"
                ) from error
        except errors.ProtocolViolation:
            return  # it answered, only not in JSON
        except errors.ConnectionLost as error:
            refuse_tls(self.url, error)
            raise

    def request(self, method: str, path: str, body: bytes | None, timeout: float) -> object:
        """The decoded JSON answer to one request.

        Raises ConnectFailed, ConnectionLost, CallTimeout, Unauthorized, ServerError for any other
        status that is not 200 (with the code BUSY while the server is not there or has no room),
        ProtocolViolation for an answer that is no JSON.
        """
        url, until = f"{self.url}{path}", time.monotonic() + timeout
        try:
            try:
                status, reason, data = self._exchange(method, path, body, until)
            except STALE_CONNECTION:
                if self._fresh:
                    raise
                self._connection.close()
                self._connect(0.0)
                status, reason, data = self._exchange(method, path, body, until)
        except (OSError, http.client.HTTPException) as error:
            with contextlib.suppress(OSError):
                self.close()
            raise call_failure(error, self.url, path, timeout) from error
        self._fresh = False
        if status == http.HTTPStatus.OK:
            try:
                return json.loads(data)
            except (ValueError, RecursionError) as error:
                raise errors.ProtocolViolation(f"{url} did not answer JSON: {error}") from error
        text = _reason(data) or reason
        if status in UNAVAILABLE:
            advice = "start the policy server behind it, or allow more time"
            raise errors.ServerError(BUSY, f"{url} answered HTTP {status}: {text}; {advice}", True)
        if status in (http.HTTPStatus.UNAUTHORIZED, http.HTTPStatus.FORBIDDEN):
            raise errors.Unauthorized(f"{url} refused the request: {text}")
        raise errors.ServerError(f"HTTP {status}", text, status >= 500, url)

    def close(self) -> None:
        self._connection.close()

    def _connect(self, wait: float) -> None:
        connect_until(self.url, wait, self._connection.connect)
        self._fresh = True

    def _exchange(
        self, method: str, path: str, body: bytes | None, until: float
    ) -> tuple[int, str, bytes]:
        """Status, reason and body, all of it before `until` on the monotonic clock."""
        if self._connection.sock is None:
            self._connect(0.0)
        sock = self._connection.sock
        if has_unread_bytes(sock):
            self.close()
            raise errors.ProtocolViolation(f"{self.url} sent data that was not requested")
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
                    target = errors.without_secrets(response.headers.get("Location") or "nowhere")
                    raise errors.HandshakeError(
                        f"{self.url}{path} redirects to {errors.printable(target, 200)}, which is "
                        "not followed: if that is the policy server, give its address"
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
        raise errors.ProtocolViolation(f"{self.url}{path} answered more than {MAX_ANSWER} bytes")


def call_failure(
    error: Exception, url: str, path: str, timeout: float, what: str = ""
) -> errors.TransportError:
    """What `error` means for a call: no answer within `timeout` s, or the end of the connection."""
    if isinstance(error, TimeoutError):
        return errors.CallTimeout(
            f"{url}{path} did not answer {what}within {timeout:g} s; look at the server's log, or "
            "allow more time"
        )
    reason = str(error) or type(error).__name__
    return errors.ConnectionLost(f"the connection to {url} ended while waiting: {reason}")


class HttpSession(StatelessSession):
    """One kept-alive HTTP connection, over which every query is a POST of JSON.

    `path` is used where the URL has none. `silent`: a status (or TEXT) that the server answers to
    any failure, without a reason, and what to say.
    """

    path = "/act"

    def __init__(
        self,
        params: ConnectionParams,
        dialect: str,
        spec: PolicySpec,
        options: object,
        warnings: Sequence[str],
        silent: tuple[str, str] = ("", ""),
    ) -> None:
        super().__init__(dialect, spec, options, warnings)
        self._params, self._silent, self._answered = params, silent, False
        if params.endpoint.path.strip("/"):
            self.path = params.endpoint.path
        self._server = JsonServer(params)
        self._server.greet(self.path, params.timeouts.hello)

    def ask(self, body: bytes, timeout: float) -> object:
        """The decoded answer to one query; before the first one, an error says what server it may
        be. Raises what `JsonServer.request` raises."""
        try:
            answer = self._server.request("POST", self.path, body, timeout)
            if isinstance(answer, str):  # in place of actions, with status 200 (OpenVLA-OFT)
                raise errors.ServerError(TEXT, answer, True, f"{self._server.url}{self.path}")
        except (errors.ServerError, errors.TransportError) as error:
            if isinstance(error, errors.ServerError):
                if error.code == BUSY:
                    raise
                if error.code == self._silent[0]:
                    text = f"{error.message}; {self._silent[1]}"
                    error = errors.ServerError(error.code, text, True)
            raise error if self._answered else explain_error(error, self._params) from error
        self._answered = True
        return answer

    def close(self) -> None:
        self._server.close()


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
    return errors.printable(str(value), MAX_REASON)


def array_object(array: NDArray[Any]) -> dict[str, object]:
    """The JSON object of an array; C order, little-endian."""
    plain = np.ascontiguousarray(array)
    if plain.dtype.byteorder == ">":
        plain = plain.astype(plain.dtype.newbyteorder("<"))
    data = base64.b64encode(plain.tobytes()).decode("ascii")
    return {"__numpy__": data, "dtype": plain.dtype.str, "shape": list(array.shape)}


def dumps(value: object) -> str:
    """JSON text in which arrays, anywhere, are their objects."""
    return json.dumps(value, default=_default, separators=(",", ":"))


def _default(value: object) -> object:
    if isinstance(value, np.ndarray):
        return array_object(value)
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def chunk_of(value: object) -> object:
    """An action chunk in a decoded answer as float32 (T, D), wherever that is possible.

    Lists of lists and array objects are understood; anything else is returned as it is, and
    refused by the check that follows every answer.
    """
    if isinstance(value, Mapping) and "__numpy__" in value:
        value = array_of(value, "__numpy__")
    return as_chunk(value)


def array_of(value: Mapping[str, Any], data: str) -> object:
    """The array whose base64 bytes are under the key `data`; `value` itself if it is none."""
    try:
        raw = base64.b64decode(value[data], validate=True)
        dtype = plain_dtype(value["dtype"])
        if dtype is None:
            return value
        return np.frombuffer(raw, dtype).reshape(tuple(value["shape"]))
    except (KeyError, TypeError, ValueError):
        return value
