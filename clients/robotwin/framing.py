"""RoboTwin's framing over TCP: a length of four bytes, then JSON, both ways.

Every frame is read whole, its size is bounded, and every call has one deadline.
"""

from __future__ import annotations

import base64
import json
import socket
import time
from collections.abc import Mapping

import numpy as np

from robospa.clients.chunks import refuse_unread
from robospa.clients.dialect import ConnectionParams
from robospa.clients.http import has_unread_bytes
from robospa.clients.numpy_json import array_of
from robospa.protocol.errors import (
    CallTimeout,
    ConnectFailed,
    ConnectionLost,
    EncodeError,
    ProtocolViolation,
    ServerError,
    printable,
)

MAX_REASON = 240
"""Characters of a server's error text that are repeated."""


def to_json(value: object) -> dict[str, object]:
    """An array as RoboTwin's JSON writes it."""
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{type(value).__name__} cannot be sent")
    data = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode("ascii")
    return {
        "__numpy_array__": True,
        "data": data,
        "dtype": value.dtype.name,
        "shape": list(value.shape),
    }


def from_json(value: dict[str, object]) -> object:
    """The inverse, for `json.loads`; only plain numbers become arrays."""
    return array_of(value, "data") if value.get("__numpy_array__") is True else value


class FramedJson:
    """Calls of a model's methods over one TCP connection, with limits and deadlines."""

    def __init__(self, params: ConnectionParams) -> None:
        self.url = f"robotwin+tcp://{params.endpoint.host}:{params.endpoint.port}"
        self._limit = params.limits.message
        self._socket = self._connect(params)

    def _connect(self, params: ConnectionParams) -> socket.socket | None:
        address = (params.endpoint.host, params.endpoint.port)
        give_up = time.monotonic() + params.timeouts.wait
        while True:
            try:
                found = socket.create_connection(address, params.timeouts.connect)
                found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                return found
            except ConnectionRefusedError as error:
                if time.monotonic() >= give_up:
                    raise ConnectFailed(
                        f"cannot connect to {self.url}: nothing listens there; "
                        "start the policy server first"
                    ) from error
                time.sleep(0.05)
            except OSError as error:
                raise ConnectFailed(f"cannot connect to {self.url}: {error}") from error

    def call(
        self, method: str, value: object, timeout: float, until: float | None = None
    ) -> object:
        """What the model's `method` returned; after any error the connection is closed.

        `until`: an earlier end of the `timeout` s on the monotonic clock, shared by several calls.
        """
        deadline = time.monotonic() + timeout if until is None else until
        try:
            text = json.dumps({"cmd": method, "obs": value}, default=to_json).encode()
        except (TypeError, ValueError) as error:
            raise EncodeError(f"cannot encode the observation: {error}") from error
        if self._socket is None:
            raise ConnectionLost(f"the connection to {self.url} was closed after an error")
        try:
            answer = self._exchange(self._socket, text, deadline)
        except TimeoutError as error:
            self.close()
            raise CallTimeout(
                f"{self.url} did not answer {method} within {timeout:g} s; "
                "look at the server's log, or allow more time"
            ) from error
        except OSError as error:
            self.close()
            reason = str(error) or type(error).__name__
            raise ConnectionLost(
                f"the connection to {self.url} ended while waiting: {reason}"
            ) from error
        return self._result(method, answer)

    def _exchange(self, sock: socket.socket, text: bytes, deadline: float) -> bytes:
        if has_unread_bytes(sock):
            self.close()
            raise ProtocolViolation(f"{self.url} sent data that was not requested")
        sock.settimeout(max(deadline - time.monotonic(), 1e-3))
        # One piece: the server reads the length with a single call and would tear a split one.
        sock.sendall(len(text).to_bytes(4, "big") + text)
        size = int.from_bytes(_read(sock, 4, deadline), "big")
        if size > self._limit:
            self.close()
            raise ProtocolViolation(
                f"{self.url} announced an answer of {size} bytes, over the limit of {self._limit}: "
                "is it RoboTwin's model server?"
            )
        return _read(sock, size, deadline)

    def _result(self, method: str, answer: bytes) -> object:
        try:
            value = json.loads(answer, object_hook=from_json)
        except (ValueError, RecursionError) as error:
            self.close()
            raise ProtocolViolation(f"{self.url} did not answer JSON: {error}") from error
        if isinstance(value, Mapping) and "error" in value:
            self.close()  # so does the server
            text = printable(str(value["error"]), MAX_REASON)
            failure = ServerError("an error", f"{text} (in {method})", True, self.url)
            failure.add_note(str(value.get("traceback", "")))
            raise failure
        if not isinstance(value, Mapping) or "res" not in value:
            self.close()
            raise ProtocolViolation(f"{self.url} answered neither 'res' nor 'error' to {method}")
        refuse_unread(value, ("res",))
        return value["res"]

    def close(self) -> None:
        """Close; harmless when closed already."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def _read(sock: socket.socket, size: int, deadline: float) -> bytes:
    """Exactly `size` bytes by `deadline`; OSError if the other end closes before."""
    data = bytearray()
    while len(data) < size:
        left = deadline - time.monotonic()
        if left <= 0:
            raise TimeoutError
        sock.settimeout(left)
        piece = sock.recv(min(size - len(data), 2**20))
        if not piece:
            raise ConnectionError("the server closed it")
        data += piece
    return bytes(data)
