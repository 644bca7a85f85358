"""msgpack with arrays in the forms that other projects give them.

    text     {"__ndarray__": true, "data": bytes, "dtype": "<f4", "shape": [..]}      (vla-eval)
    binary   {b"nd": true, b"type": "<f4", b"kind": b"", b"shape": [..], b"data": bytes}
                                                           (XPolicyLab, after msgpack-numpy)
    npy      {"__ndarray_class__": true, "as_npy": bytes of a .npy file}             (GR00T)
    openpi   {b"__ndarray__": true, b"data": bytes, b"dtype": "<f4", b"shape": [..]}
                                             (read here, written by `robospa.protocol.codec`)

`robospa.protocol.codec.encode` writes any of them; reading understands all. Plain numbers only:
object, structured and complex arrays are refused, and extension types too, so nothing that comes
over the wire is ever executed.
"""

import io
import re
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.clients.chunks import plain_dtype
from robospa.clients.dialect import ConnectionParams
from robospa.protocol.client import violation
from robospa.protocol.codec import Form, Limits, Reader, decode, encode
from robospa.protocol.errors import DecodeError, TransportError, printable
from robospa.protocol.transport import Transport

NPY = re.compile(
    rb"\x93NUMPY(?:\x01\x00..|\x02\x00....)"
    rb"\{'descr': '([^']*)', 'fortran_order': (True|False), "
    rb"'shape': \(((?:\d{1,18}(?:, ?|(?=\))))*)\), \} *\n",
    re.DOTALL,
)
"""How numpy begins a .npy file of plain numbers; its own reader takes Python's parser for this."""


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


def npy_form(array: NDArray[Any]) -> dict[object, object]:
    """An array as GR00T writes it, whatever the version reads."""
    data = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
    npy = b"".join((_npy_header(array.dtype.str, array.shape), data.data))
    return {"__ndarray_class__": True, "as_npy": npy}


@cache
def _npy_header(dtype: str, shape: tuple[int, ...]) -> bytes:
    file = io.BytesIO()
    header = {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
    return file.getvalue()


def read_npy(data: object) -> NDArray[Any]:
    """The array of plain numbers in a .npy file; raises DecodeError."""
    begin = NPY.match(data) if isinstance(data, bytes) else None
    if begin is None:
        raise DecodeError("an array that is no .npy file of plain numbers")
    dtype, fortran, sizes = (text.decode() for text in begin.groups())
    shape = [int(size) for size in sizes.split(",") if size.strip()]
    rows = memoryview(data)[begin.end() :]  # type: ignore[arg-type]
    if fortran == "True":
        return _build(dtype, shape[::-1], rows).T
    return _build(dtype, shape, rows)


class _AnyForm(Reader):
    """Reads arrays in all forms."""

    __slots__ = ()

    def map(self, count: int, depth: int) -> object:
        self.count(count, 2)
        found: dict[object, object] = {}
        for _ in range(count):
            key = self.value(depth + 1)
            if isinstance(key, list | dict | np.ndarray):
                raise self.fail("a map key is no plain value")
            found[key] = self.value(depth + 1)
        return self.meant(found)

    def meant(self, value: dict[object, object]) -> object:
        """The array that a map stands for, or the map."""
        if value.get(b"nd") is True:
            if value.get(b"kind") not in (b"", None, ""):
                raise DecodeError("an array of objects or structures is refused")
            return _build(value.get(b"type"), value.get(b"shape"), value.get(b"data"))
        if value.get(b"nd") is False:
            return _build(value.get(b"type"), [], value.get(b"data")).item()
        if value.get("__ndarray__") is True:
            return _build(value.get("dtype"), value.get("shape"), value.get("data"))
        if value.get("__ndarray_class__") is True:
            return read_npy(value.get("as_npy"))
        if b"__ndarray__" in value:
            return _build(value.get(b"dtype"), value.get(b"shape"), value.get(b"data"))
        return value.get(b"data") if b"__npgeneric__" in value else value


class _Lenient(_AnyForm):
    """An array of something else than plain numbers becomes a text that says so."""

    __slots__ = ()

    def meant(self, value: dict[object, object]) -> object:
        dtype = value.get(b"dtype")
        if b"__ndarray__" in value and plain_dtype(dtype) is None:
            return f"array of {str(dtype)[:40]} {str(value.get(b'shape'))[:80]}"
        return super().meant(value)


def unpack(data: bytes, limits: Limits, *, lenient: bool = False) -> object:
    """The value of one message; raises DecodeError. `lenient`: for wires whose own client reads
    arrays of anything, see `_Lenient`."""
    return decode(data, limits, _Lenient if lenient else _AnyForm)


def _build(dtype: object, shape: Any, data: object) -> NDArray[Any]:
    kind = plain_dtype(dtype)
    if kind is None:
        raise DecodeError(f"an array of dtype {str(dtype)[:40]!r} is refused")
    if not isinstance(data, bytes | memoryview):
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
        self._transport.send(encode(message, self._limits, self._form))

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
        self._transport.close()
