"""A short run of `scripts/fuzz_wire.py`, and that it would notice."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def script() -> Any:
    found = importlib.util.spec_from_file_location("fuzz_wire", ROOT / "scripts" / "fuzz_wire.py")
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_damaged_messages_end_as_documented(script: Any) -> None:
    found = script.fuzz(3000, 0, script.TARGETS)
    assert found["executions"] == 9000
    assert all(found["ends"].get(f"{name}: read", 0) > 0 for name in script.TARGETS)


def test_every_message_of_the_corpus_is_read_by_a_target(script: Any) -> None:
    for data in script.corpus():
        assert "read" in {script.attempt(target, data) for target in script.TARGETS.values()}


def test_a_crash_names_its_input(script: Any) -> None:
    def broken(data: bytes) -> None:
        raise IndexError("out of range")

    with pytest.raises(IndexError) as caught:
        script.fuzz(1, 5, {"broken": broken})
    assert "seed 5, target broken" in caught.value.__notes__[0]
