"""Commands of one or more primitives, made without a scene, and an episode that has them."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from dataset_fakes import fake_episode
from numpy.typing import NDArray
from PIL import Image

from robospa.baselines.learned.maps.lowering import lowered
from robospa.baselines.learned.maps.primitives import Primitive
from robospa.harness.datasets.episode import DatasetEpisode, Stills, episode_bytes
from robospa.harness.demonstrations.recorder import KEYFRAMES
from robospa.harness.robots import embodiment
from robospa.trial import TrialKey
from robospa.workcell import HEIGHT, TABLE_TOP, WIDTH, WORKCELL

ROBOT = embodiment("aloha-agilex")
START = np.array([0.0] * 6 + [1.0] + [0.0] * 6 + [1.0])
"""Both arms at home, grippers open."""
GRASP = Primitive("grasp", 0, (-0.15, -0.02, TABLE_TOP + 0.03), 0.3, 0.2, 0.6)
RELEASE = Primitive("release", 0, (-0.2, -0.1, TABLE_TOP + 0.05), 1.2, 0.0, 0.0)
TOUCH = Primitive("touch", 1, (0.18, -0.05, TABLE_TOP + 0.04), 2.5, -0.2, 0.0)


def rows_of(primitives: Sequence[Primitive]) -> NDArray[np.float32]:
    """(T, D): the start, then the actions of the primitives, one after the other."""
    rows = START[None].astype(np.float32)
    holding = [False, False]
    for one in primitives:
        more = lowered(ROBOT, rows[-1].astype(float), one, (holding[0], holding[1]))
        rows = np.concatenate([rows, more])
        holding[one.arm] = one.kind == "grasp"
    return rows


def picture_with(x: float, y: float, side: int = 5) -> NDArray[np.uint8]:
    """(240, 320, 3): grey, with a red square of `side` pixels at a place [m] on the table."""
    seen = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    column, row = WORKCELL.head.pixel(np.array(x), np.array(y), TABLE_TOP)
    half = side // 2
    at = int(row), int(column)
    seen[at[0] - half : at[0] + half + 1, at[1] - half : at[1] + half + 1] = (255, 0, 0)
    return seen


def grasping_episode(seed: int, sentence: str = "Pick the block.") -> DatasetEpisode:
    """An episode that grasps where its pictures have a red square, at a place that follows from
    its seed."""
    rng = np.random.default_rng(seed)
    x, y = float(rng.uniform(-0.22, -0.08)), float(rng.uniform(-0.15, 0.0))
    commanded = rows_of([replace(GRASP, point=(x, y, TABLE_TOP + 0.03))])
    stream = io.BytesIO()
    Image.fromarray(picture_with(x, y, 11)).save(stream, "PNG")
    key = TrialKey("Pick_Blocks_Size", 1, 1_000_000 + seed, split="train")
    frames = Stills("png", WIDTH, HEIGHT, (stream.getvalue(),) * len(commanded))
    return replace(
        fake_episode(key, len(commanded)),
        commanded=commanded,
        measured=commanded,
        stride=KEYFRAMES,
        instructions=(sentence, "Take it."),
        pictures={"head": frames},
    )


def written_set(folder: Path, episodes: Sequence[DatasetEpisode]) -> Path:
    """The folder of a data set that holds these episodes."""
    for episode in episodes:
        path = folder / "episodes" / episode.key.task / f"{episode.key.seed}.zip"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(episode_bytes(episode))
    return folder
