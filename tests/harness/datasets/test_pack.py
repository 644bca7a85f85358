"""Packing: the same bytes again, nothing half done, nothing of others removed, flat memory."""

from __future__ import annotations

import json
import tracemalloc
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from tiny_datasets import MANIFEST as SETTINGS
from tiny_datasets import SIZE, painted, tiny_dataset, tiny_episode, written

from robospa.action_space import ActionSpace
from robospa.harness.convention_check.episodes import read_episode
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
from robospa.harness.datasets.robotwin import configuration
from robospa.harness.running.atomic_file import StorageError
from robospa.observation import CameraSpec
from robospa.trial import TrialKey


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

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("robospa.harness.datasets.pack.write_card", stop)
        pack("lerobot-v3", folder, files, SETTINGS)
    assert not (folder / MANIFEST).exists() and not (folder / "meta").exists()
    pack("lerobot-v3", folder, files, SETTINGS)
    tiny_dataset(tmp_path / "other", count=2)
    assert contents(folder) == contents(tmp_path / "other")


def test_episodes_that_do_not_go_together_are_refused_in_a_sentence(tmp_path: Path) -> None:
    first = tiny_episode(0)
    seen = dict(first.pictures)
    del seen["head"]
    files = written(tmp_path, [first, replace(tiny_episode(1), pictures=seen)])
    with pytest.raises(DatasetError, match="pictures"):
        pack("lerobot-v3", tmp_path / "set", files, SETTINGS)
    key = replace(first.key, embodiment="franka-panda")
    wide = replace(first, key=key, space=ActionSpace("joint", (6, 6)))
    with pytest.raises(DatasetError, match="franka-panda"):
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


def test_levels_of_a_task_count_on_in_one_folder(tmp_path: Path) -> None:
    episodes = tiny_dataset(tmp_path, "robotwin-hdf5", "png", count=6)
    base = tmp_path / "Pick_Blocks_Size" / "demo_clean"
    assert sorted(p.name for p in (base / "data").iterdir()) == [
        f"episode{i}.hdf5" for i in range(3)
    ]
    sentences = json.loads((base / "instructions/episode1.json").read_text())
    assert sentences == {"seen": list(episodes[2].instructions), "unseen": []}
    with h5py.File(base / "data/episode1.hdf5") as file:
        assert file["language_instruction"][()] == b"pick block 2"
        assert set(file["observation"]) == {"head_camera", "left_camera", "right_camera"}
        assert (file["robospa/action"][()] == episodes[2].action).all()
        assert (file["robospa/subtask"][()] == episodes[2].subtask).all()
        vector = np.hstack(
            [
                file[f"joint_action/{side}_{part}"][()].reshape(len(episodes[2]), -1)
                for side in ("left", "right")
                for part in ("arm", "gripper")
            ]
        )
        assert (vector == file["joint_action/vector"][()]).all()
    read = read_episode(base / "data/episode1.hdf5")
    assert read.instruction == "pick block 2" and read.about["level"] == 3
    assert (read.actions == episodes[2].executed[:-1]).all()
    seen = read.picture(CameraSpec("right_wrist", *SIZE), 3).astype(int)
    assert np.abs(seen - painted(22, 8)[3]).mean() < 4  # red and blue are where they were


def test_configurations_are_the_official_names() -> None:
    assert configuration(TrialKey("A", 1, 1)).as_posix() == "A/demo_clean"
    key = TrialKey("A", 1, 1, mode="randomized-seen")
    assert configuration(key).as_posix() == "A/demo_randomized"
