"""A short run of `tests/helpers/fuzz_wire.py`, and that it would notice."""

from __future__ import annotations

import fuzz_wire
import pytest


def test_damaged_messages_end_as_documented() -> None:
    found = fuzz_wire.fuzz(3000, 0, fuzz_wire.TARGETS)
    assert found["executions"] == 9000
    assert all(found["ends"].get(f"{name}: read", 0) > 0 for name in fuzz_wire.TARGETS)


def test_every_message_of_the_corpus_is_read_by_a_target() -> None:
    for data in fuzz_wire.corpus():
        assert "read" in {fuzz_wire.attempt(target, data) for target in fuzz_wire.TARGETS.values()}


def test_a_crash_names_its_input() -> None:
    def broken(data: bytes) -> None:
        raise IndexError("out of range")

    with pytest.raises(IndexError) as caught:
        fuzz_wire.fuzz(1, 5, {"broken": broken})
    assert "seed 5, target broken" in caught.value.__notes__[0]
