"""Verification says in a sentence each what is wrong with a data set, and what its sample shows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tiny_datasets import MANIFEST as SETTINGS
from tiny_datasets import tiny_dataset, tiny_episode, written

from robospa.harness.datasets import verify as verification
from robospa.harness.datasets.episode import DatasetEpisode
from robospa.harness.datasets.manifest import (
    EPISODES,
    MANIFEST,
    SUMS,
    DatasetError,
    EpisodeLine,
    file_hash,
)
from robospa.harness.datasets.pack import FORMATS, pack
from robospa.harness.datasets.verify import REPLAYS, replayed_sentence, verify


class Replayed:
    """A simulator that ends as the episodes say, if their commands are right."""

    def __init__(self, episodes: list[DatasetEpisode]) -> None:
        self.episodes, self.seen = episodes, list[int]()

    def __call__(self, line: EpisodeLine, commanded: NDArray[np.float32]) -> tuple[bool, str]:
        episode = self.episodes[line.episode_index]
        self.seen.append(line.episode_index)
        right = np.array_equal(commanded, episode.commanded)
        right &= np.reshape(line.prefix_action, (-1, 14)).tolist() == episode.prefix_action.tolist()
        return bool(right and episode.success), episode.replay_digest


@pytest.mark.parametrize("layout", FORMATS)
def test_a_sound_data_set_of_every_format(layout: str, tmp_path: Path) -> None:
    episodes = tiny_dataset(tmp_path, layout, FORMATS[layout].images[0], count=4)
    simulator = Replayed(episodes)
    verdict = verify(tmp_path, 3, simulator)
    assert verdict.problems == () and verdict.sound
    assert len(simulator.seen) == 3 and len(verdict.checked) == 3
    assert "3 of 4 episodes" in verdict.checked[2]
    assert verify(tmp_path, 0).checked[2] == "No episode was replayed."
    assert "All 4 episodes" in verify(tmp_path, replay=Replayed(episodes)).checked[2]


def change(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


@pytest.mark.parametrize(
    ("name", "harm", "said"),
    [
        ("data/chunk-000/file-000.parquet", cut, "was changed or torn"),
        ("videos/observation.images.head/chunk-000/file-000.mp4", change, "was changed or torn"),
        ("meta/info.json", Path.unlink, "meta/info.json is missing"),
        (SUMS, change, f"not the one that {MANIFEST} names"),
        (SUMS, Path.unlink, f"{SUMS} is missing"),
        ("data/chunk-000/file-001.parquet", Path.touch, "is not part of the data set: move it"),
    ],
)
def test_a_harmed_file_is_one_sentence(
    name: str, harm: Callable[[Path], None], said: str, tmp_path: Path
) -> None:
    tiny_dataset(tmp_path, count=2)
    harm(tmp_path / name)
    (problem,) = verify(tmp_path).problems
    assert said in problem and name in problem


def test_what_is_no_data_set_is_one_sentence(tmp_path: Path) -> None:
    def refused(match: str, folder: Path = tmp_path) -> None:
        with pytest.raises(DatasetError, match=match):
            verify(folder)

    refused("no folder", tmp_path / "nowhere")
    refused("no data set")
    (tmp_path / "episodes").mkdir()
    refused("--resume")
    (tmp_path / MANIFEST).write_text('{"format": 2}')
    refused("version 2")
    (tmp_path / MANIFEST).write_text('{"format":')
    refused("cannot be read")


def resealed(folder: Path, name: str, text: str) -> None:
    """Change a file, and the hashes with it."""
    (folder / name).write_text(text)
    lines = [line.split("  ") for line in (folder / SUMS).read_text().splitlines()]
    sums = "".join(f"{file_hash(folder / path)}  {path}\n" for _, path in lines)
    (folder / SUMS).write_text(sums)
    made = json.loads((folder / MANIFEST).read_text())
    made["sums"] = hashlib.sha256(sums.encode()).hexdigest()
    (folder / MANIFEST).write_text(json.dumps(made))


def test_counts_that_do_not_agree_are_found(tmp_path: Path) -> None:
    tiny_dataset(tmp_path, count=3)
    text = (tmp_path / EPISODES).read_text()
    first = text.splitlines()[0]
    resealed(tmp_path, EPISODES, text.replace(first, first.replace('"frames": 6', '"frames": 7')))
    problems = verify(tmp_path).problems
    assert any("says 3 episodes with 21 frames" in problem for problem in problems)
    assert "episode 0 has 6 rows, not 7" in problems
    assert any(problem.startswith("the films of observation.images.head") for problem in problems)
    again = first.replace('"episode_index": 0', '"episode_index": 3').replace("train", "heldout")
    resealed(tmp_path, EPISODES, text + first + "\n" + again + "\n")
    said = " ".join(verify(tmp_path).problems)
    assert "is there twice" in said and "has sentences of evaluation" in said
    resealed(tmp_path, EPISODES, text.replace('"seed": 1000002', '"seed": 100002'))
    (problem,) = verify(tmp_path).problems
    assert "has a seed of evaluation" in problem


def test_replays_that_end_otherwise_are_told(tmp_path: Path) -> None:
    episodes = tiny_dataset(tmp_path, count=3)
    first, second, third = episodes
    others = [replace(first, success=False), replace(second, replay_digest="00" * 32), third]

    def broken(line: EpisodeLine, commanded: NDArray[np.float32]) -> tuple[bool, str]:
        if line.episode_index == 2:
            raise RuntimeError("the scene does not come to rest")
        return Replayed(others)(line, commanded)

    fails, differs, ends = verify(tmp_path, replay=broken).problems
    assert "fails when" in fails and "another state" in differs and "cannot be replayed" in ends


def test_mistakes_and_midstates_are_replayed_as_what_they_are(tmp_path: Path) -> None:
    mistake = replace(tiny_episode(0), kind="mistake:drop", success=False, failure="dropped")
    prefix = np.linspace(0, 1, 28, dtype=np.float32).reshape(2, 14) / 3
    midstate = replace(tiny_episode(1), kind="midstate", prefix_action=prefix)
    episodes = [mistake, midstate]
    pack("lerobot-v3", tmp_path / "set", written(tmp_path, episodes), SETTINGS)
    assert verify(tmp_path / "set", replay=Replayed(episodes)).problems == ()


def test_another_suite_cannot_be_replayed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tiny_dataset(tmp_path, count=2)
    monkeypatch.setattr(verification, "SUITE", "robospa-9")
    (problem,) = verify(tmp_path).problems
    assert "of the suite robospa-3, and those of this version of robospa-9" in problem


def test_the_default_sample_finds_a_twentieth_of_bad_episodes() -> None:
    assert 0.95**REPLAYS <= 0.05 < 0.95 ** (REPLAYS - 1)
    assert "Were 5.0% of all episodes bad" in replayed_sentence(REPLAYS, 14_000)
