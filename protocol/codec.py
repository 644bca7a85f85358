"""Values to bytes and back: msgpack, with numpy arrays as raw bytes, dtype and shape.

An array is a map with the four binary keys `__ndarray__` (true), `data`, `dtype`, `shape`: the
layout of openpi, so one codec serves both dialects. Decoding copies none (arrays are read-only
views of the received bytes; only multi-byte items at an odd address are copied, so that every array
is aligned).

Refused, with EncodeError or DecodeError: object, string, structured and complex dtypes (there is
no pickle here), extension types, repeated keys, anything beyond `Limits`. All lengths are compared
with the bytes that are really there before anything is allocated. That is why the decoder is
written here: the msgpack package copies binary values, and its hooks see a list only when it is
whole, so that 64 MiB of nested lists of short texts cost it 1.5 GB and 7 s, this reader 0.5 s.
"""

from __future__ import annotations

import io
import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from robospa.protocol.errors import DecodeError, EncodeError

Buffer = bytes | bytearray | memoryview


@dataclass(frozen=True)
class Limits:
    """Upper bounds per message. `message`, `array` and `text` in bytes; `ndim` axes per array;
    `depth` levels of nesting; `items` values and keys in all."""

    message: int = 64 * 2**20
    array: int = 64 * 2**20
    text: int = 2**20
    depth: int = 32
    items: int = 200_000
    ndim: int = 8


DEFAULT_LIMITS = Limits()

_NAMES = ["|b1", "|i1", "|u1", "<i2", "<i4", "<i8", "<u2", "<u4", "<u8", "<f2", "<f4", "<f8"]
DTYPES = {name: np.dtype(name) for name in _NAMES}
"""The dtypes that exist on the wire, by the name they have there (little endian)."""

_MARK, _DATA, _DTYPE, _SHAPE = b"__ndarray__", b"data", b"dtype", b"shape"
_SCALAR = b"__npgeneric__"
_ARRAY_KEYS = frozenset((_MARK, _DATA, _DTYPE, _SHAPE))
_SCALAR_KEYS = frozenset((_SCALAR, _DATA, _DTYPE))
_BINARY_KEYS = _ARRAY_KEYS | _SCALAR_KEYS


# ---------------------------------------------------------------- encoding

Form = Callable[[NDArray[Any]], dict[Any, object]]
"""An array as the map that stands for it in a message."""


def array_map(array: NDArray[Any]) -> dict[Any, object]:
    """An array in the layout of openpi; its bytes stay where they are."""
    name = array.dtype.newbyteorder("<").str
    flat = np.ascontiguousarray(array, dtype=DTYPES[name]).reshape(-1)
    return {_MARK: True, _DTYPE: name, _SHAPE: array.shape, _DATA: flat.view(np.uint8).data}


def encode(value: object, limits: Limits = DEFAULT_LIMITS, form: Form = array_map) -> bytes:
    """One contiguous message from None, bool, int, float, str, bytes, lists, maps and arrays.

    Tuples become lists and numpy scalars become Python numbers; `form`: of arrays. Raises
    EncodeError.
    """

    def plain(item: Any) -> object:
        """What msgpack does not know by itself."""
        if isinstance(item, np.ndarray):
            return form(item)
        if isinstance(item, int):
            raise OverflowError(f"{item} has more than 64 bits")
        return dict(item) if isinstance(item, Mapping) else item.item()

    try:
        _check(value, limits)
        data: bytes = msgpack.packb(value, default=plain, use_bin_type=True)
    except (TypeError, ValueError, OverflowError) as error:
        raise EncodeError(f"cannot encode a value: {error}") from error
    if len(data) > limits.message:
        raise EncodeError(f"message of {len(data)} bytes is over the limit of {limits.message}")
    return data


def _check(value: object, limits: Limits) -> None:
    """Raises EncodeError for what cannot be sent, before anything is written."""
    items, left = 0, [(value, 0)]
    while left:
        value, depth = left.pop()
        items += 1
        if depth > limits.depth or items > limits.items:
            raise EncodeError(f"a message may have {limits.depth} levels and {limits.items} items")
        if isinstance(value, np.ndarray):
            if value.dtype.newbyteorder("<").str not in DTYPES:
                known = list(DTYPES)
                raise EncodeError(f"array of dtype {value.dtype} cannot be sent, only {known}")
            if value.nbytes > limits.array or value.ndim > limits.ndim:
                raise EncodeError(
                    f"array of shape {value.shape} ({value.nbytes} bytes) is over a limit"
                )
            items += 7 + value.ndim
        elif isinstance(value, Mapping):
            for key in value:
                if type(key) is not str and type(key) is not int:
                    raise EncodeError(f"map key {key!r} is neither a string nor an integer")
            left += ((one, depth + 1) for one in (*value, *value.values()))
        elif isinstance(value, list | tuple):
            left += ((one, depth + 1) for one in value)
        elif isinstance(value, np.generic):
            if value.dtype.kind not in "biuf":
                raise EncodeError(f"numpy scalar of dtype {value.dtype} cannot be sent")
        elif isinstance(value, str):
            if len(value.encode()) > limits.text:
                raise EncodeError(f"text of {len(value)} characters is over the limit")
        elif value is not None and not isinstance(value, bool | int | float | bytes | bytearray):
            raise EncodeError(f"a value of type {type(value).__name__} cannot be sent")


# ---------------------------------------------------------------- decoding


def decode(
    buffer: Buffer, limits: Limits = DEFAULT_LIMITS, kind: type[Reader] | None = None
) -> object:
    """The value in `buffer`, which must hold exactly one. Raises DecodeError and nothing else."""
    if len(buffer) > limits.message:
        raise DecodeError(f"message of {len(buffer)} bytes is over the limit of {limits.message}")
    reader = (kind or Reader)(buffer, limits)
    value = reader.value(0)
    if reader.pos != reader.end:
        raise DecodeError(f"{reader.end - reader.pos} bytes follow the message's end")
    return value


_FIXED = {tag: struct.Struct(f">{form}") for tag, form in enumerate("fdBHIQbhiq", 0xCA)}
_LENGTHS = {1: struct.Struct(">B"), 2: struct.Struct(">H"), 4: struct.Struct(">I")}
_CONSTANTS = {0xC0: None, 0xC2: False, 0xC3: True}
_BIN = {0xC4: 1, 0xC5: 2, 0xC6: 4}
_STR = {0xD9: 1, 0xDA: 2, 0xDB: 4}
_LIST = {0xDC: 2, 0xDD: 4}
_MAP = {0xDE: 2, 0xDF: 4}


class Reader:
    """A cursor over one message. Every length is checked against what is left before use."""

    __slots__ = ("bytes", "end", "items", "limits", "pos", "view")

    def __init__(self, buffer: Buffer, limits: Limits) -> None:
        # Items and text are read from `bytes`, which is faster; arrays are cut out of `view`.
        self.bytes = bytes(buffer) if isinstance(buffer, memoryview) else buffer
        self.view = memoryview(self.bytes)
        self.pos = 0
        self.end = len(self.bytes)
        self.items = 0
        self.limits = limits

    def fail(self, reason: str) -> DecodeError:
        return DecodeError(f"byte {self.pos}: {reason}")

    def take(self, size: int) -> int:
        """Advance by `size` bytes; returns where they start."""
        start = self.pos
        if size > self.end - start:
            raise self.fail(f"{size} bytes announced, {self.end - start} left")
        self.pos = start + size
        return start

    def length(self, width: int) -> int:
        number: int = _LENGTHS[width].unpack_from(self.bytes, self.take(width))[0]
        return number

    def value(self, depth: int) -> object:
        self.items += 1
        if self.items > self.limits.items:
            raise self.fail(f"more than {self.limits.items} items")
        if depth > self.limits.depth:
            raise self.fail(f"nested deeper than {self.limits.depth} levels")
        tag = self.bytes[self.take(1)]
        if tag < 0x80:
            return tag
        if 0xA0 <= tag < 0xC0:
            return self.text(tag & 0x1F)
        if tag >= 0xE0:
            return tag - 0x100
        if tag < 0x90:
            return self.map(tag & 0x0F, depth)
        if tag < 0xA0:
            return self.list(tag & 0x0F, depth)
        if tag in _FIXED:
            form = _FIXED[tag]
            number: object = form.unpack_from(self.bytes, self.take(form.size))[0]
            return number
        if tag in _CONSTANTS:
            return _CONSTANTS[tag]
        if tag in _STR:
            return self.text(self.length(_STR[tag]))
        if tag in _BIN:
            start = self.take(self.length(_BIN[tag]))
            return bytes(self.bytes[start : self.pos])
        if tag in _LIST:
            return self.list(self.length(_LIST[tag]), depth)
        if tag in _MAP:
            return self.map(self.length(_MAP[tag]), depth)
        raise self.fail(f"extension or unused type 0x{tag:02x} does not exist in this protocol")

    def text(self, size: int) -> str:
        if size > self.limits.text:
            raise self.fail(f"text of {size} bytes is over the limit of {self.limits.text}")
        start = self.take(size)
        try:
            return self.bytes[start : self.pos].decode()
        except UnicodeDecodeError as error:
            raise self.fail("text is not UTF-8") from error

    def count(self, count: int, least: int) -> None:
        """`count` members of at least `least` bytes each must fit into what is left."""
        if count * least > self.end - self.pos:
            raise self.fail(f"{count} members announced, only {self.end - self.pos} bytes left")
        if self.items + count * least > self.limits.items:
            raise self.fail(f"more than {self.limits.items} items")

    def list(self, count: int, depth: int) -> list[object]:
        self.count(count, 1)
        return [self.value(depth + 1) for _ in range(count)]

    def map(self, count: int, depth: int) -> object:
        self.count(count, 2)
        if count and self.bytes[self.pos] in _BIN:
            return self.numpy(count)
        result: dict[str | int, object] = {}
        for _ in range(count):
            key = self.value(depth + 1)
            if type(key) is not str and type(key) is not int:
                raise self.fail("a map key is neither a string nor an integer")
            if key in result:
                raise self.fail(f"map key {str(key)[:50]!r} appears twice")
            result[key] = self.value(depth + 1)
        return result

    def binary(self) -> memoryview:
        tag = self.bytes[self.take(1)]
        if tag not in _BIN:
            raise self.fail("binary data expected")
        start = self.take(self.length(_BIN[tag]))
        return self.view[start : self.pos]

    def numpy(self, count: int) -> object:
        """A map with binary keys: an array, or a scalar as openpi sends it."""
        found: dict[bytes, object] = {}
        for _ in range(count):
            key = bytes(self.binary()[:16])
            if key not in _BINARY_KEYS or key in found:
                raise self.fail(f"unknown or repeated binary key {key!r}")
            self.items += 2
            binary = self.pos < self.end and self.bytes[self.pos] in _BIN
            if key == _DATA and _SCALAR not in found and binary:
                found[key] = self.binary()
            else:
                found[key] = self.value(self.limits.depth - 1)
        if found.keys() == _ARRAY_KEYS and found[_MARK] is True:
            return self.array(found[_DATA], found[_DTYPE], found[_SHAPE])
        if found.keys() == _SCALAR_KEYS and type(found[_DATA]) in (bool, int, float):
            return found[_DATA]
        raise self.fail("a map with binary keys is neither an array nor a scalar")

    def array(self, data: object, name: object, shape: object) -> NDArray[np.generic]:
        dtype = DTYPES.get(name) if isinstance(name, str) else None
        if dtype is None:
            raise self.fail(f"array dtype {str(name)[:20]!r} is no plain number")
        if not isinstance(data, memoryview):
            raise self.fail("array data is not binary")
        if not isinstance(shape, list) or not all(type(n) is int and n >= 0 for n in shape):
            raise self.fail("array shape is not a list of numbers from 0 up")
        if len(shape) > self.limits.ndim:
            raise self.fail(f"array of {len(shape)} axes, at most {self.limits.ndim} are allowed")
        expected = dtype.itemsize * math.prod(shape)
        if expected != len(data):
            raise self.fail(f"array {name} of shape {shape} has {len(data)} bytes, not {expected}")
        if expected > self.limits.array:
            raise self.fail(f"array of {expected} bytes is over the limit of {self.limits.array}")
        if max(shape, default=0) > self.limits.array:
            raise self.fail(f"array axis of {max(shape)} is over the limit")
        array = np.frombuffer(data, dtype=dtype) if expected else np.empty(0, dtype)
        if not array.flags.aligned:
            array = array.copy()
        array = array.reshape(shape)
        array.flags.writeable = False
        return array


# ---------------------------------------------------------------- JPEG, as a declared image codec
# An encoded image travels as binary data in place of the array; Pillow is imported on first use.

Images = dict[str, object]
QUALITY = 90


def encode_jpeg(image: NDArray[np.uint8], quality: int = QUALITY) -> bytes:
    """uint8 (H, W, 3) RGB to JPEG of `quality`, 4:2:0. Raises EncodeError."""
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or not image.size:
        raise EncodeError(f"{image.dtype} array of shape {image.shape} cannot become a JPEG")
    stream = io.BytesIO()
    _pillow().fromarray(np.ascontiguousarray(image)).save(stream, "JPEG", quality=quality)
    return stream.getvalue()


def decode_jpeg(data: bytes, limits: Limits = DEFAULT_LIMITS) -> NDArray[np.uint8]:
    """JPEG to uint8 (H, W, 3) RGB; the size is checked before a pixel is decoded."""
    try:
        with _pillow().open(io.BytesIO(data), formats=("JPEG",)) as picture:
            if picture.width * picture.height * 3 > limits.array:
                raise DecodeError(f"JPEG of {picture.width} x {picture.height} is over the limit")
            return np.asarray(picture.convert("RGB"))
    except DecodeError:
        raise
    except Exception as error:  # Pillow raises many kinds for broken files
        raise DecodeError(f"an image is no JPEG: {error}") from error


def encode_images(observation: Mapping[str, object]) -> Images:
    """The observation with every image as JPEG; nothing else is touched."""
    return _map_images(
        observation, lambda image: encode_jpeg(image) if isinstance(image, np.ndarray) else image
    )


def decode_images(observation: Mapping[str, object], limits: Limits = DEFAULT_LIMITS) -> Images:
    """The observation with every JPEG as an array."""
    return _map_images(
        observation, lambda image: decode_jpeg(image, limits) if isinstance(image, bytes) else image
    )


def _map_images(view: Mapping[str, object], change: Callable[[object], object]) -> Images:
    changed = dict(view)
    images, history = changed.get("images"), changed.get("history")
    if isinstance(images, dict):
        changed["images"] = {name: change(image) for name, image in images.items()}
    if isinstance(history, dict):
        changed["history"] = {
            offset: _map_images(past, change) if isinstance(past, dict) else past
            for offset, past in history.items()
        }
    return changed


def _pillow() -> Any:
    try:
        from PIL import Image
    except ImportError as error:
        raise EncodeError(
            "images as JPEG need Pillow, which is not installed: pip install pillow"
        ) from error
    return Image
