"""Rotations as six numbers, both ways."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robospa.clients.state_encoding import LAYOUTS, ORDERS, decode_rotation, encode_rotation

quaternions = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(
    lambda q: np.linalg.norm(q) > 0.1
)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("layout", LAYOUTS)
@given(values=quaternions)
def test_rotations_survive_both_ways(order: str, layout: str, values: list[float]) -> None:
    unit = np.array(values) / np.linalg.norm(values)
    back = decode_rotation(encode_rotation(unit, order, layout), order, layout)
    assert min(np.abs(back - unit).max(), np.abs(back + unit).max()) < 1e-6


def test_six_numbers_of_no_rotation_are_not_finite() -> None:
    assert not np.isfinite(decode_rotation(np.zeros(6), "wxyz", "interleaved")).all()
    assert not np.isfinite(decode_rotation(np.ones(6), "wxyz", "columns")).all()
