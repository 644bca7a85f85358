"""Chunks out of whatever a server calls one."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.action_space import ActionSpace
from robospa.clients.chunks import as_chunk, invert_grippers


@pytest.mark.parametrize(
    "value", [None, "x", {}, [[1], [2, 3]], [["a"]], [[10**400]], [["1.5"]], [[True]]]
)
def test_what_is_no_chunk_stays_what_it_is(value: object) -> None:
    found = as_chunk(value)
    assert found is value


def test_grippers_are_turned_and_nothing_else() -> None:
    chunk = np.arange(28, dtype=np.float32).reshape(2, 14)
    change = invert_grippers(chunk, ActionSpace("joint")) - chunk
    assert np.flatnonzero(change.any(axis=0)).tolist() == [6, 13]
    wrong = np.zeros((1, 3), np.float32)
    assert invert_grippers(wrong, ActionSpace("joint")) is wrong
