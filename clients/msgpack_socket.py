"""Whole msgpack messages over a WebSocket, with every failure turned into an error of the protocol.

What the two dialects of this form, XPolicyLab's and vla-eval's, have in common.
"""

from __future__ import annotations

from robospa.clients.dialect import ConnectionParams
from robospa.clients.numpy_msgpack import Form, pack, unpack
from robospa.protocol.client import violation
from robospa.protocol.errors import DecodeError, TransportError, printable
from robospa.protocol.transport import Transport


class MsgpackSocket:
    """Sends and receives maps; `form` is how arrays are written."""

    def __init__(self, params: ConnectionParams, form: Form) -> None:
        address = params.websocket_address()
        self._transport = Transport(address, params.timeouts, params.limits, None)
        self._form, self._limits = form, params.limits
        self.url = params.endpoint.url

    def send(self, message: dict[str, object]) -> None:
        """Raises EncodeError and ConnectionLost."""
        self._transport.send(pack(message, self._form, self._limits))

    def receive(self, timeout: float, what: str) -> dict[str, object]:
        """The next message; raises CallTimeout, ConnectionLost, ProtocolViolation."""
        data = self._transport.receive(timeout, what)
        if isinstance(data, str):
            raise self.violation(f"a text frame came instead of {what}: {printable(data, 200)!r}")
        try:
            value = unpack(data, self._limits)
        except DecodeError as error:
            raise self.violation(f"the answer cannot be read: {error}") from error
        if not isinstance(value, dict):
            raise self.violation(f"{what} is not a map")
        return value

    def violation(self, reason: str) -> TransportError:
        """The error for an answer that the protocol does not allow; closes the connection."""
        self.close()
        return violation(self.url, printable(reason))

    def close(self) -> None:
        """Close; harmless when closed already."""
        self._transport.close()
