"""Packing: the same bytes again, nothing half done, nothing of others removed, flat memory."""

import hashlib
import json
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from collect_fakes import contents
from numpy.typing import NDArray
from tiny_datasets import MANIFEST as SETTINGS
from tiny_datasets import SIZE, packed, painted, tiny_dataset, tiny_episode, written

from robospa.action_space import ActionSpace
from robospa.harness.convention_check.episodes import read_episode
from robospa.harness.datasets import lerobot, statistics
from robospa.harness.datasets import verify as verification
from robospa.harness.datasets.episode import DatasetEpisode
from robospa.harness.datasets.features import layout_of
from robospa.harness.datasets.manifest import (
    EPISODES,
    MANIFEST,
    SUMS,
    DatasetError,
    EpisodeLine,
    EpisodeLines,
    file_hash,
    read_lines,
    read_record,
)
from robospa.harness.datasets.pack import FORMATS, pack
from robospa.harness.datasets.verify import verify
from robospa.observation import CameraSpec


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
    with pytest.raises(DatasetError, match="pictures"):
        packed(tmp_path, [first, replace(tiny_episode(1), pictures=seen)])
    key = replace(first.key, embodiment="franka-panda")
    wide = replace(first, key=key, space=ActionSpace("joint", (6, 6)))
    with pytest.raises(DatasetError, match="franka-panda"):
        packed(tmp_path, [first, wide], "lerobot-v2.1")
    with pytest.raises(DatasetError, match="no episode"):
        packed(tmp_path, [])


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


# ---- verification says in a sentence each what is wrong with a data set, and what its sample shows


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
    assert verdict.problems == ()
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
    episodes = packed(tmp_path, [mistake, midstate])
    assert verify(tmp_path, replay=Replayed(episodes)).problems == ()


# ---------------------- statistics of features: exact where they can be, and within a bin where not


def test_the_statistics_of_one_to_a_hundred() -> None:
    found = statistics.row_stats(np.arange(1, 101)[:, None])
    assert [found[name].item() for name in ("min", "max", "mean")] == [1, 100, 50.5]
    assert found["q50"].item() == 50.5 and np.isclose(found["q01"].item(), 1.99)
    assert found["count"].tolist() == [100]


def test_lots_add_up_to_what_all_rows_give_at_once() -> None:
    rng = np.random.default_rng(0)
    lots = [rng.normal(k, 1 + k, (3 + 40 * k, 4)) for k in range(5)]
    moments = statistics.Moments()
    for lot in lots:
        moments.add(statistics.row_stats(lot))
    whole = statistics.row_stats(np.concatenate(lots))
    for name, value in moments.stats().items():
        np.testing.assert_allclose(value, whole[name], rtol=1e-12)


def test_quantiles_of_a_histogram_are_within_a_bin() -> None:
    rng = np.random.default_rng(1)
    rows = np.stack([rng.exponential(2, 4000), rng.normal(size=4000), np.full(4000, 3.0)], axis=1)
    low, high = rows.min(axis=0), rows.max(axis=0)
    histogram = statistics.RangeHistogram(low, high)
    for lot in np.split(rows, 8):
        histogram.add(lot)
    found = histogram.quantiles()
    for name, share in statistics.QUANTILES.items():
        lower, upper = (
            np.quantile(rows, share, axis=0, method=m) for m in ("lower", "higher")
        )  # between two neighbours any value is a quantile
        room = (high - low) / statistics.BINS
        assert (found[name] >= lower - room).all() and (found[name] <= upper + room).all()


def test_colours_are_those_of_the_pixels() -> None:
    rng = np.random.default_rng(2)
    pictures = rng.integers(5, 200, (7, 6, 8, 3)).astype(np.uint8)
    first, second = statistics.ColourHistogram(), statistics.ColourHistogram()
    for picture in pictures[:3]:
        first.add(picture)
    for picture in pictures[3:]:
        second.add(picture)
    first.merge(second)
    pixels = pictures.reshape(-1, 3) / 255
    found = first.stats()
    for name, value in (("mean", pixels.mean(0)), ("std", pixels.std(0)), ("min", pixels.min(0))):
        np.testing.assert_allclose(found[name], value.reshape(3, 1, 1), atol=1e-12)
    assert np.abs(found["q90"].ravel() - np.quantile(pixels, 0.9, axis=0)).max() <= 1 / 255
    assert found["count"].tolist() == [7]


def test_another_suite_cannot_be_replayed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tiny_dataset(tmp_path, count=2)
    monkeypatch.setattr(verification, "SUITE", "robospa-9")
    (problem,) = verify(tmp_path).problems
    assert "of the suite robospa-3, and those of this version of robospa-9" in problem
