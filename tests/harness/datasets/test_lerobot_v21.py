"""The files of LeRobot's version 2.1, against what the readers of openpi and others expect."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from tiny_datasets import CAMERAS, tiny_dataset

from robospa.harness.datasets.episode import EpisodeFilm
from robospa.harness.datasets.pictures import FPS


def lines(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_an_episode_has_a_file_and_a_film_a_camera(tmp_path: Path) -> None:
    episodes = tiny_dataset(tmp_path, "lerobot-v2.1", count=3)
    info = json.loads((tmp_path / "meta/info.json").read_text())
    assert info["codebase_version"] == "v2.1" and info["total_videos"] == 9
    assert info["total_chunks"] == 1 and info["total_tasks"] == 3
    where = {"episode_chunk": 0, "episode_index": 1}
    table = pq.read_table(tmp_path / info["data_path"].format(**where))
    assert (np.array(table["action"].to_pylist(), np.float32) == episodes[1].action).all()
    assert table["timestamp"].to_pylist() == pytest.approx(np.arange(len(episodes[1])) / FPS)
    assert b"huggingface" not in (table.schema.metadata or {})
    for camera in CAMERAS:
        key = f"observation.images.{camera}"
        film = episodes[1].pictures[camera]
        assert isinstance(film, EpisodeFilm)
        path = tmp_path / info["video_path"].format(video_key=key, **where)
        assert path.read_bytes() == film.data


def test_lines_of_tasks_episodes_and_statistics(tmp_path: Path) -> None:
    episodes = tiny_dataset(tmp_path, "lerobot-v2.1", "jpeg", count=4)
    meta = tmp_path / "meta"
    assert lines(meta / "tasks.jsonl")[1] == {"task_index": 1, "task": "pick block 1"}
    assert lines(meta / "subtasks.jsonl")[0] == {"subtask_index": 0, "subtask": ""}
    found = lines(meta / "episodes.jsonl")
    assert [row["length"] for row in found] == [len(episode) for episode in episodes]
    assert found[3]["tasks"] == ["pick block 0"]
    stats = lines(meta / "episodes_stats.jsonl")[2]["stats"]
    assert isinstance(stats, dict)
    assert set(stats["action"]) == {"min", "max", "mean", "std", "count"}
    assert np.shape(stats["observation.images.head"]["std"]) == (3, 1, 1)
    assert np.allclose(stats["action"]["max"], episodes[2].action.max(axis=0))
    schema = pq.read_schema(tmp_path / "data/chunk-000/episode_000000.parquet")
    assert b"Image" in schema.metadata[b"huggingface"] and b"List" not in schema.metadata
