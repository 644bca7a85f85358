"""What was made of a file is kept by the file's content, in the user's cache alone."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from robospa.harness.packs import archive as cache


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "cache"))


class Maker:
    """Counts how often something is made."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> cache.Arrays:
        self.count += 1
        return {"a": np.full(3, self.count), "b": np.zeros(2)}


def test_equal_content_is_made_once_wherever_it_lies(tmp_path: Path) -> None:
    make, files = Maker(), [tmp_path / name for name in "ab"]
    for file in files:
        file.write_bytes(b"mesh")
    first, second = (cache.cached((file,), "how", make) for file in files)
    assert first == second and make.count == 1
    assert cache.load_arrays(first)["a"].tolist() == [1, 1, 1]
    assert [*cache.load_arrays(first, "b")] == ["b"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", "cache"]


def test_other_content_or_another_way_is_made_anew(tmp_path: Path) -> None:
    make, file = Maker(), tmp_path / "a"
    file.write_bytes(b"mesh")
    entries = {cache.cached((file,), "how", make), cache.cached((file,), "else", make)}
    file.write_bytes(b"mess")
    os.utime(file, ns=(0, 0))
    entries.add(cache.cached((file,), "how", make))
    assert len(entries) == make.count == 3


def test_a_damaged_entry_is_thrown_away(tmp_path: Path) -> None:
    make, file = Maker(), tmp_path / "a"
    file.write_bytes(b"mesh")
    entry = cache.cached((file,), "how", make)
    entry.write_bytes(entry.read_bytes()[:50])
    with pytest.raises(ValueError, match="was damaged: start again"):
        cache.load_arrays(entry)
    assert cache.load_arrays(cache.cached((file,), "how", make))["a"].tolist() == [2, 2, 2]


def test_nothing_half_written_is_left_under_the_entry(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"mesh")

    def broken() -> cache.Arrays:
        raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        cache.cached((file,), "how", broken)
    assert list(cache.cache_folder().glob("*.npz")) == []
