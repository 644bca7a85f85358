"""What is announced is there, before anything is allocated for it."""

from __future__ import annotations

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robospa.clients.numpy_msgpack import binary_form, check_structure, pack, text_form, unpack
from robospa.protocol.codec import DEFAULT_LIMITS, Limits
from robospa.protocol.errors import DecodeError

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats(allow_nan=False)
    | st.text(max_size=40)
    | st.binary(max_size=300),
    lambda inner: st.lists(inner, max_size=20) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=30,
)


@settings(deadline=None, max_examples=60)
@given(VALUES)
def test_sound_messages_pass_and_shorter_ones_do_not(value: Any) -> None:
    data = msgpack.packb(value)
    check_structure(data, DEFAULT_LIMITS)
    for end in {0, 1, len(data) // 2, len(data) - 1} - {len(data)}:
        with pytest.raises(DecodeError):
            check_structure(data[:end], DEFAULT_LIMITS)


@settings(deadline=None, max_examples=100)
@given(st.binary(max_size=200))
def test_noise_raises_nothing_else(data: bytes) -> None:
    try:
        unpack(data, DEFAULT_LIMITS)
    except DecodeError:
        return


@pytest.mark.parametrize("form", [binary_form, text_form])
def test_arrays_come_back(form: Any) -> None:
    sent = np.arange(6, dtype=np.float32).reshape(2, 3)
    assert np.array_equal(unpack(pack([sent], form, DEFAULT_LIMITS), DEFAULT_LIMITS)[0], sent)


@pytest.mark.parametrize(
    ("data", "limits", "told"),
    [
        (b"\xdd\x00\x03\x0d\x40" * 1000, DEFAULT_LIMITS, "200000 members announced"),
        (b"\xdf\x00\x03\x0d\x40" * 1000, DEFAULT_LIMITS, "400000 members announced"),
        (b"\x91" * 1000 + b"\xc0", DEFAULT_LIMITS, "nested deeper than 32"),
        (b"\xdc\x01\x00" + b"\xc0" * 256, Limits(items=200), "more than 200 items"),
        (b"\xc6\xff\xff\xff\xff", DEFAULT_LIMITS, "in the middle of a value"),
        (b"\xc7\x01\x05x", DEFAULT_LIMITS, "extension type 5"),
    ],
)
def test_what_is_refused(data: bytes, limits: Limits, told: str) -> None:
    with pytest.raises(DecodeError, match=told):
        unpack(data, limits)
