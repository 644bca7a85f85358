"""Small data sets with real pictures, made without a simulator."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
from dataset_fakes import fake_episode
from numpy.typing import NDArray

from robospa.harness.datasets.episode import DatasetEpisode, Pictures, episode_bytes
from robospa.harness.datasets.manifest import DatasetManifest, SeedFailure
from robospa.harness.datasets.pack import pack
from robospa.harness.datasets.pictures import ENCODERS, encode
from robospa.harness.running.atomic_file import replace_file
from robospa.observation import CameraSpec
from robospa.trial import TrialKey

CAMERAS = ("head", "left_wrist", "right_wrist")
SIZE = (64, 48)
STEP = 3
"""How much brighter a frame is than the one before; at most 30 frames."""
TASKS = ("Pick_Blocks_Size", "Place_Bowls_Plates")
OPTIONS = {
    "h264": ("libx264", {"crf": "12", "preset": "ultrafast", "g": "2", "bf": "0"}),
    "av1": ("libsvtav1", {"crf": "5", "preset": "10", "g": "2"}),
}


def painted(seed: int, frames: int) -> NDArray[np.uint8]:
    """uint8 (frames, 48, 64, 3): a smooth pattern whose brightness tells the frame."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(40, 160, (3, 4, 3), np.uint8).repeat(16, 0).repeat(16, 1)
    steps = np.arange(frames, dtype=np.uint8)[:, None, None, None] * STEP
    return (coarse[None] + steps).astype(np.uint8)


def seen_as(codec: str, *cameras: NDArray[np.uint8]) -> dict[str, Pictures]:
    """What each of CAMERAS saw, (T, height, width, 3), so encoded that frames can be told apart."""
    specs = [CameraSpec(n, *of.shape[2:0:-1]) for n, of in zip(CAMERAS, cameras, strict=False)]
    with patch.dict(ENCODERS, OPTIONS):
        return encode(zip(*cameras, strict=True), specs, codec)


def film_of(pictures: NDArray[np.uint8]) -> bytes:
    """An MP4 file of `pictures`."""
    (film,) = seen_as("h264", pictures)["head"].files
    return film


def tiny_episode(number: int, codec: str = "h264", frames: int | None = None) -> DatasetEpisode:
    """Episode `number` of a small data set: two tasks, five levels, three cameras, and 6 to 10
    frames if not told."""
    frames = frames or 6 + number % 5
    key = TrialKey(TASKS[number % 2], 1 + number % 5, 1_000_000 + number, split="train")
    pictures = seen_as(codec, *(painted(10 * number + i, frames) for i in range(len(CAMERAS))))
    made = fake_episode(key, frames)
    return replace(
        made,
        instructions=(f"pick block {number % 3}", f"take block {number % 3}", "grasp it"),
        subtasks=("reach", f"grasp {number % 2}"),
        subtask=np.minimum(np.arange(frames) // 3 - 1, 1).astype(np.int32),
        pictures=pictures,
    )


def written(folder: Path, episodes: Sequence[DatasetEpisode]) -> list[Path]:
    """The episodes' files, below `folder`."""
    files = []
    for episode in episodes:
        path = folder / f"{episode.key.slug}.zip"
        replace_file(path, episode_bytes(episode))
        files.append(path)
    return files


FAILED = SeedFailure(
    TrialKey("Place_Bowls_Plates", 2, 1_000_900, split="train"), "the goal was not met"
)
MANIFEST = DatasetManifest("robospa collect --tasks all", {"episodes": 4}, (FAILED,))


def tiny_dataset(
    folder: Path, layout: str = "lerobot-v3", codec: str = "h264", count: int = 4
) -> list[DatasetEpisode]:
    """Packs a data set of `count` episodes into `folder`; returns the episodes."""
    return packed(folder, [tiny_episode(number, codec) for number in range(count)], layout)


def packed(
    folder: Path, episodes: list[DatasetEpisode], layout: str = "lerobot-v3"
) -> list[DatasetEpisode]:
    """Packs a data set of `episodes` into `folder`."""
    with TemporaryDirectory() as kept:
        pack(layout, folder, written(Path(kept), episodes), MANIFEST)
    return episodes
