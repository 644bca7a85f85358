"""The codec: everything survives the round trip, and no bytes crash or over-allocate it."""

import struct
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from wire_helpers import allocating_less_than

from robospa.protocol.codec import DTYPES, Limits, decode, encode
from robospa.protocol.errors import DecodeError, EncodeError

DTYPE = st.sampled_from(sorted(DTYPES))
ARRAYS = hnp.arrays(DTYPE, hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4))
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats(allow_nan=False)
    | st.text(max_size=40)
    | st.binary(max_size=40)
)
KEYS = st.text(max_size=8) | st.integers(-100, 100)
VALUES = st.recursive(
    SCALARS | ARRAYS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4),
    max_leaves=20,
)


def same(a: Any, b: Any) -> bool:
    """Equal in value, type, dtype and shape."""
    if isinstance(a, np.ndarray):
        alike = isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape
        return alike and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return isinstance(b, dict) and list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list):
        return isinstance(b, list) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and bool(a == b)


@given(VALUES)
def test_any_value_survives(value: Any) -> None:
    assert same(value, decode(encode(value)))


@given(st.binary(max_size=200))
@settings(max_examples=500)
def test_no_bytes_raise_anything_but_decode_error(data: bytes) -> None:
    try:
        decode(data)
    except DecodeError as error:
        assert str(error)


@given(VALUES, st.data())
@settings(max_examples=300)
def test_damaged_messages_raise_nothing_but_decode_error(value: Any, data: st.DataObject) -> None:
    message = bytearray(encode(value))
    for _ in range(data.draw(st.integers(1, 3))):
        message[data.draw(st.integers(0, len(message) - 1))] = data.draw(st.integers(0, 255))
    try:
        decode(bytes(message[: data.draw(st.integers(0, len(message)))]))
    except DecodeError as error:
        assert str(error)


@given(st.sampled_from([0xDC, 0xDD, 0xDE, 0xDF, 0xC4, 0xC5, 0xC6, 0xD9, 0xDA, 0xDB]), st.binary())
def test_claimed_lengths_allocate_nothing(tag: int, rest: bytes) -> None:
    claim = bytes([tag]) + b"\xff" * 4
    with allocating_less_than(200_000), pytest.raises(DecodeError):
        decode(b"\x91" * 20 + claim + rest[:50])


def test_many_lists_that_each_claim_much_allocate_little() -> None:
    claims = b"".join(b"\xdd" + struct.pack(">I", 60_000 - 6 * n) for n in range(30))
    with allocating_less_than(2_000_000), pytest.raises(DecodeError):
        decode(claims + b"\xc0" * 60_000)


def wire_array(dtype: Any = "|u1", shape: Any = (2,), data: Any = b"ab") -> bytes:
    fields = {b"__ndarray__": True, b"data": data, b"dtype": dtype, b"shape": shape}
    return bytes(msgpack.packb(fields))


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (wire_array(dtype="|O"), "dtype"),
        (wire_array(dtype="<c8"), "dtype"),
        (wire_array(dtype="<U1"), "dtype"),
        (wire_array(dtype=">f4"), "dtype"),
        (wire_array(dtype=7), "dtype"),
        (wire_array(shape=(-2,)), "shape"),
        (wire_array(shape=(-1, -2)), "shape"),
        (wire_array(shape=(2.0,)), "shape"),
        (wire_array(shape=(True, 2)), "shape"),
        (wire_array(shape="2"), "shape"),
        (wire_array(shape=(3,)), "bytes, not 3"),
        (wire_array(shape=(2**62, 2**62)), "bytes, not"),
        (wire_array(shape=(0, 2**63), data=b""), "axis"),
        (wire_array(shape=(1,) * 9, data=b"a"), "axes"),
        (wire_array(data="ab"), "not binary"),
        (msgpack.packb({b"__ndarray__": True, b"data": b""}), "neither"),
        (msgpack.packb({b"other": 1}), "binary key"),
        (msgpack.packb({None: 1}), "map key"),
        (b"\x82\xa1a\x01\xa1a\x02", "twice"),
        (msgpack.packb(msgpack.ExtType(1, b"x")), "extension"),
        (b"\xc1", "unused"),
        (b"\xa2\xff\xff", "UTF-8"),
        (b"\x01\x02", "follow"),
        (b"", "announced"),
        (b"\x91" * 100 + b"\xc0", "deeper"),
    ],
)
def test_refusals_name_the_reason(message: bytes, reason: str) -> None:
    with pytest.raises(DecodeError, match=reason):
        decode(message)


@pytest.mark.parametrize(
    "value",
    [
        np.array([object()]),
        np.array(["a"]),
        np.zeros(2, complex),
        np.zeros(2, "M8[s]"),
        object(),
        {1.5: 2},
        {True: 2},
        2**64,
        {"a": {1, 2}},
    ],
)
def test_what_cannot_be_sent_is_refused(value: Any) -> None:
    with pytest.raises(EncodeError):
        encode(value)


@pytest.mark.parametrize(
    ("value", "limits"),
    [
        ("x" * 20, Limits(text=10)),
        (np.zeros(20, np.uint8), Limits(array=10)),
        (np.zeros((1, 1, 1)), Limits(ndim=2)),
        ([0] * 20, Limits(items=10)),
        ([[[[]]]], Limits(depth=2)),
        (b"x" * 20, Limits(message=10)),
    ],
)
def test_limits_hold_at_both_ends(value: Any, limits: Limits) -> None:
    with pytest.raises(EncodeError):
        encode(value, limits)
    with pytest.raises(DecodeError):
        decode(encode(value), limits)


def test_images_are_views_and_cannot_be_written() -> None:
    message = encode({"image": np.ones((4, 4, 3), np.uint8)})
    image = decode(message)["image"]
    assert np.shares_memory(image, np.frombuffer(message, np.uint8))
    assert not image.flags.writeable


@given(st.integers(0, 7))
def test_numbers_are_aligned_wherever_they_lie(pad: int) -> None:
    array = decode(encode(["x" * pad, np.arange(5, dtype=np.float64)]))[1]
    assert array.flags.aligned
    assert array.tolist() == [0, 1, 2, 3, 4]


def test_views_and_foreign_byte_orders_are_sent_as_their_values() -> None:
    array = np.arange(12, dtype=">i4").reshape(3, 4)[::-1, ::2]
    assert decode(encode(array)).tolist() == array.tolist()


def test_numpy_scalars_become_numbers() -> None:
    assert decode(encode([np.float32(1.5), np.int8(-3), np.bool_(True)])) == [1.5, -3, True]


def test_bytearrays_and_memoryviews_can_be_decoded() -> None:
    message = encode({"a": np.arange(3), "b": "c"})
    for buffer in (bytearray(message), memoryview(message)):
        assert decode(buffer)["a"].tolist() == [0, 1, 2]


def test_keys_of_an_array_in_any_order() -> None:
    usual = {b"__ndarray__": True, b"dtype": "|u1", b"data": b"ab", b"shape": [2]}
    for keys in (usual, dict(reversed(usual.items()))):
        assert decode(msgpack.packb(keys)).tolist() == [97, 98]
