"""msgpack with arrays in the forms that other projects give them.

    text     {"__ndarray__": true, "data": bytes, "dtype": "<f4", "shape": [..]}      (vla-eval)
    binary   {b"nd": true, b"type": "<f4", b"kind": b"", b"shape": [..], b"data": bytes}
                                                           (XPolicyLab, after msgpack-numpy)
    openpi   {b"__ndarray__": true, b"data": bytes, b"dtype": "<f4", b"shape": [..]}
                                             (read here, written by `robospa.protocol.codec`)

Reading understands all. Plain numbers only: object, structured and complex arrays are refused, and
extension types too, so nothing that comes over the wire is ever executed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from robospa.clients.chunks import plain_dtype
from robospa.clients.dialect import ConnectionParams
from robospa.protocol.client import violation
from robospa.protocol.codec import Limits
from robospa.protocol.errors import DecodeError, EncodeError, TransportError, printable
from robospa.protocol.transport import Transport

Form = Callable[[NDArray[Any]], dict[object, object]]
KINDS = "biuf"


def text_form(array: NDArray[Any]) -> dict[object, object]:
    """An array as vla-eval writes it."""
    return {
        "__ndarray__": True,
        "data": array.tobytes(),
        "dtype": array.dtype.str,
        "shape": list(array.shape),
    }


def binary_form(array: NDArray[Any]) -> dict[object, object]:
    """An array as msgpack-numpy writes it."""
    return {
        b"nd": True,
        b"type": array.dtype.str,
        b"kind": b"",
        b"shape": list(array.shape),
        b"data": array.tobytes(),
    }


def pack(value: object, form: Form, limits: Limits) -> bytes:
    """One message; raises EncodeError."""

    def default(item: object) -> object:
        if isinstance(item, np.ndarray) and item.dtype.kind in KINDS:
            return form(item)
        if isinstance(item, np.generic) and item.dtype.kind in KINDS:
            return item.item()
        raise TypeError(f"{type(item).__name__} cannot be sent")

    try:
        data: bytes = msgpack.packb(value, default=default, use_bin_type=True)
    except (TypeError, ValueError, OverflowError) as error:
        raise EncodeError(f"cannot encode a message: {error}") from error
    if len(data) > limits.message:
        raise EncodeError(f"message of {len(data)} bytes is over the limit of {limits.message}")
    return data


def check_structure(data: bytes, limits: Limits) -> None:
    """Raises DecodeError unless everything that `data` announces is there and within `limits`.

    msgpack itself allocates by announced counts: a few kilobytes of lists in lists would cost it
    gigabytes.
    """
    position, announced, left = 0, 0, [1]
    while left:
        if left[-1] == 0:
            left.pop()
            continue
        left[-1] -= 1
        if position >= len(data):
            raise DecodeError("the message ends in the middle of a value")
        tag = data[position]
        position += 1
        if tag in _COUNTED or 0x80 <= tag < 0xA0:
            width, each = _COUNTED.get(tag, (0, 1 if tag >= 0x90 else 2))
            count = (
                int.from_bytes(data[position : position + width], "big") if width else tag & 0x0F
            )
            position += width
            count *= each
            if count > len(data) - position:
                raise DecodeError(f"{count} members announced, {len(data) - position} bytes left")
            left.append(count)
            announced += count
            if announced > limits.items or len(left) > limits.depth + 1:
                raise DecodeError(
                    f"more than {limits.items} items, or nested deeper than {limits.depth} levels"
                )
        elif tag in _SIZED:
            width = _SIZED[tag]
            position += width + int.from_bytes(data[position : position + width], "big")
        elif 0xA0 <= tag < 0xC0:
            position += tag & 0x1F
        else:
            position += _FIXED.get(tag, 0)
    if position > len(data):
        raise DecodeError("the message ends in the middle of a value")


_COUNTED = {0xDC: (2, 1), 0xDD: (4, 1), 0xDE: (2, 2), 0xDF: (4, 2)}
"""Tag of a list or map -> bytes of its count, values of each member."""
_SIZED = {0xC4: 1, 0xC5: 2, 0xC6: 4, 0xD9: 1, 0xDA: 2, 0xDB: 4}
_FIXED = {
    **dict.fromkeys((0xCC, 0xD0), 1),
    **dict.fromkeys((0xCD, 0xD1), 2),
    **dict.fromkeys((0xCA, 0xCE, 0xD2), 4),
    **dict.fromkeys((0xCB, 0xCF, 0xD3), 8),
    **{0xD4 + power: 1 + 2**power for power in range(5)},
}
"""Tag -> bytes that follow."""


def unpack(data: bytes, limits: Limits, *, lenient: bool = False) -> object:
    """The value of one message; raises DecodeError.

    `lenient`: an array of something else than plain numbers becomes a text that says so, for wires
    whose own client reads it.
    """
    if len(data) > limits.message:
        raise DecodeError(f"message of {len(data)} bytes is over the limit of {limits.message}")
    check_structure(data, limits)
    try:
        return msgpack.unpackb(
            data,
            raw=False,
            strict_map_key=False,
            object_hook=_array_or_note if lenient else _array,
            ext_hook=_refuse,
            max_array_len=limits.items,
            max_map_len=limits.items,
            max_str_len=limits.text,
            max_bin_len=limits.array,
        )
    except DecodeError:
        raise
    except Exception as error:  # msgpack's errors have no common base but this one
        raise DecodeError(f"no readable msgpack: {error}") from error


def _refuse(code: int, data: bytes) -> object:
    raise DecodeError(f"extension type {code} is refused")


def _array(value: dict[object, object]) -> object:
    if value.get(b"nd") is True:
        if value.get(b"kind") not in (b"", None, ""):
            raise DecodeError("an array of objects or structures is refused")
        return _build(value.get(b"type"), value.get(b"shape"), value.get(b"data"))
    if value.get(b"nd") is False:
        return _build(value.get(b"type"), [], value.get(b"data")).item()
    if value.get("__ndarray__") is True:
        return _build(value.get("dtype"), value.get("shape"), value.get("data"))
    if b"__ndarray__" in value:
        return _build(value.get(b"dtype"), value.get(b"shape"), value.get(b"data"))
    if b"__npgeneric__" in value:
        return value.get(b"data")
    return value


def _array_or_note(value: dict[object, object]) -> object:
    dtype = value.get(b"dtype")
    if b"__ndarray__" in value and plain_dtype(dtype) is None:
        return f"array of {str(dtype)[:40]} {str(value.get(b'shape'))[:80]}"
    return _array(value)


def _build(dtype: object, shape: Any, data: object) -> NDArray[Any]:
    kind = plain_dtype(dtype)
    if kind is None:
        raise DecodeError(f"an array of dtype {str(dtype)[:40]!r} is refused")
    if not isinstance(data, bytes):
        raise DecodeError("an array without bytes")
    try:
        return np.frombuffer(data, kind).reshape(tuple(shape))
    except (TypeError, ValueError) as error:
        raise DecodeError(f"an array that cannot be: {error}") from error


class MsgpackSocket:
    """Whole maps over a WebSocket, every failure an error of the protocol; `form` of arrays."""

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
