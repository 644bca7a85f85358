"""Action files: the same bits come back, and nothing else is read."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from robospa.harness.quantize import quantize
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.traces import decode, encode

ANY = st.integers(0, 5).flatmap(
    lambda n: arrays(np.float32, (n, 3), elements=st.floats(width=32, allow_nan=False)).map(
        quantize
    )
)


@settings(max_examples=50, deadline=None)
@given(st.lists(ANY, max_size=4))
def test_every_bit_comes_back(traces: list[np.ndarray]) -> None:
    back = decode(encode(traces), "x")
    assert len(back) == len(traces)
    for one, other in zip(traces, back, strict=True):
        assert len(one) == len(other)
        assert one.tobytes() == other.tobytes()


def test_smooth_actions_shrink() -> None:
    time = np.linspace(0, 6, 500, dtype=np.float32)[:, None]
    trace = quantize(np.sin(time + np.arange(14, dtype=np.float32)))
    packed = zlib.compress(encode([trace]), 6)
    assert len(packed) < 0.6 * len(zlib.compress(trace.tobytes(), 6))


def test_actions_of_two_widths_are_refused() -> None:
    with pytest.raises(ValueError, match=r"\[2, 3\] columns"):
        encode([np.zeros((1, 2), np.float32), np.zeros((1, 3), np.float32)])


@pytest.mark.parametrize("cut", [0, 7, 15, 20, -1])
def test_a_file_cut_short_is_refused(cut: int) -> None:
    data = encode([np.ones((3, 14), np.float32)])
    with pytest.raises(BundleError, match="it"):
        decode(data[:cut], "it")


def test_another_magic_is_refused() -> None:
    data = encode([np.ones((3, 14), np.float32)])
    with pytest.raises(BundleError, match="no action file of this version"):
        decode(b"rspa-a9\n" + data[8:], "it")
