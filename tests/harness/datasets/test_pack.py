"""Packing: the same bytes again, nothing half done, nothing of others removed, flat memory."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_datasets import MANIFEST as SETTINGS
from tiny_datasets import tiny_dataset, tiny_episode, written

from robospa.action_space import ActionSpace
from robospa.harness.datasets import lerobot
from robospa.harness.datasets.features import layout_of
from robospa.harness.datasets.manifest import (
    MANIFEST,
    DatasetError,
    EpisodeLines,
    read_lines,
    read_record,
)
from robospa.harness.datasets.pack import FORMATS, files_below, pack
from robospa.harness.running.atomic_file import StorageError


def contents(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files_below(folder)}


@pytest.mark.parametrize("layout", FORMATS)
def test_packing_twice_gives_the_same_bytes(layout: str, tmp_path: Path) -> None:
    codec = FORMATS[layout].images[0]
    for name in "ab":
        tiny_dataset(tmp_path / name, layout, codec, count=2)
    first, second = contents(tmp_path / "a"), contents(tmp_path / "b")
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []
    made = read_record(tmp_path / "a")
    assert (made.episodes, made.layout, made.failures) == (2, layout, SETTINGS.failures)
    assert [line.key.seed for line in read_lines(tmp_path / "a")] == [1_000_000, 1_000_001]


def test_packing_again_replaces_its_own_files_and_no_others(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    tiny_dataset(folder, "lerobot-v2.1", count=3)
    (folder / "notes.txt").write_text("mine")
    tiny_dataset(folder, "lerobot-v2.1", count=2)
    found = contents(folder)
    assert found["notes.txt"] == b"mine"
    assert "data/chunk-000/episode_000002.parquet" not in found
    (folder / "notes.txt").unlink()
    tiny_dataset(tmp_path / "other", "lerobot-v2.1", count=2)
    assert contents(folder) == contents(tmp_path / "other")


def test_what_was_cut_short_is_no_data_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "set"
    files = written(tmp_path / "episodes", [tiny_episode(0), tiny_episode(1)])

    def stop(count: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pack("lerobot-v3", folder, files, SETTINGS, stop)
    assert not (folder / MANIFEST).exists() and not (folder / "meta").exists()
    pack("lerobot-v3", folder, files, SETTINGS)
    tiny_dataset(tmp_path / "other", count=2)
    assert contents(folder) == contents(tmp_path / "other")


def test_episodes_that_do_not_go_together_are_refused_in_a_sentence(tmp_path: Path) -> None:
    first = tiny_episode(0)
    seen = dict(first.pictures)
    del seen["head"]
    files = written(tmp_path, [first, replace(tiny_episode(1), pictures=seen)])
    with pytest.raises(DatasetError, match="collect it with the same cameras and images"):
        pack("lerobot-v3", tmp_path / "set", files, SETTINGS)
    key = replace(first.key, embodiment="franka-panda")
    wide = replace(first, key=key, space=ActionSpace("joint", (6, 6)))
    with pytest.raises(DatasetError, match="a data set has one robot"):
        pack("lerobot-v2.1", tmp_path / "set", [files[0], *written(tmp_path, [wide])], SETTINGS)
    with pytest.raises(DatasetError, match="no episode"):
        pack("lerobot-v3", tmp_path / "set", [], SETTINGS)


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    files = written(tmp_path, [tiny_episode(0)])
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot write"):
        pack("lerobot-v3", tmp_path / "file" / "set", files, SETTINGS)


def test_memory_does_not_grow_with_the_episodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Forty episodes more take less than 5 kB each, though each has 25 kB of rows."""
    monkeypatch.setattr(lerobot, "BUFFERED", 10)
    episode = replace(tiny_episode(0, frames=6), pictures={})
    writer = lerobot.LeRobotV3(tmp_path, layout_of(episode))
    lines = EpisodeLines(tmp_path)

    def add(count: int) -> None:
        for index in range(count):
            lines.add(index, episode, writer.add(episode))

    add(20)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        add(40)
        after, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    writer.close()
    lines.close()
    assert after - before < 40 * 5000 and peak - before < 3e6
