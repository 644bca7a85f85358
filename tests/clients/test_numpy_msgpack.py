"""What is announced is there, before anything is allocated for it."""

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robospa.clients.numpy_msgpack import binary_form, text_form, unpack
from robospa.protocol.codec import DEFAULT_LIMITS, encode
from robospa.protocol.errors import DecodeError

NPY = b"\x93NUMPY\x01\x00vv{'descr': '<f4', 'fortran_order': False, 'shape': (%b), }\n"


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
    assert np.array_equal(unpack(encode([sent], form=form), DEFAULT_LIMITS)[0], sent)


def array(**changes: Any) -> Any:
    good = {"__ndarray__": True, "data": bytes(56), "dtype": "<f4", "shape": [1, 14]}
    return msgpack.packb({**good, **changes})


@pytest.mark.parametrize(
    ("data", "told"),
    [
        *((array(dtype=kind), "refused") for kind in ("|O", "V4", "<c8", 7, "f4,(", "3f4")),
        *((array(shape=shape), "cannot be") for shape in ([2, 14], "x")),
        (array(data="text"), "without bytes"),
        (b"\xdf\x00\x01\x86\x9f" * 1000, "99999 members announced"),
        (msgpack.packb({b"nd": True, b"type": "<f4", b"kind": b"V"}), "objects or structures"),
        (b"\x81\x90\xc0", "key"),
        *(
            (msgpack.packb({"__ndarray_class__": True, "as_npy": NPY % sizes}), "no .npy file")
            for sizes in (b"1 2,", b",", b"9" * 5000 + b",")
        ),
    ],
)
def test_what_is_refused(data: bytes, told: str) -> None:
    with pytest.raises(DecodeError, match=told):
        unpack(data, DEFAULT_LIMITS)
