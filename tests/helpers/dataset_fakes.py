"""Episodes of a data set that no simulator made."""

import numpy as np

from robospa.action_space import ActionSpace
from robospa.harness.datasets.episode import DatasetEpisode, Pictures
from robospa.observation import WIDTH
from robospa.tasks.events import Event
from robospa.trial import TrialKey


def fake_episode(
    key: TrialKey | None = None,
    frames: int = 5,
    kind: str = "expert",
    stills: bool = False,
    objects: bool = False,
) -> DatasetEpisode:
    """An episode whose numbers follow from its `key`, with pictures that are none."""
    key = key or TrialKey("Pick_Blocks_Size", 2, 1_000_007, split="train")
    space = ActionSpace()
    rng = np.random.default_rng(key.seed)
    commanded = rng.normal(size=(frames, space.width)).astype(np.float32)
    pictures = {
        "head": Pictures("h264", 8, 6, (rng.bytes(200),)),
        "left_wrist": Pictures("av1", 8, 6, (b"",)),
    }
    if stills:
        files = tuple(rng.bytes(20 + t) for t in range(frames))
        pictures = {"head": Pictures("jpeg", 8, 6, files), "front": Pictures("png", 8, 6, files)}
    return DatasetEpisode(
        key,
        kind,
        True,
        ("pick up the small block", "lift the smallest block, \u00e9"),
        space,
        15,
        commanded,
        (commanded + np.float32(1e-4)),
        np.concatenate([commanded[1:], commanded[-1:]]),
        rng.normal(size=(frames, 2, 8)).astype(np.float32),
        np.arange(frames) * 0.06,
        np.zeros(frames, np.int32) - 1,
        np.zeros(frames, np.uint8),
        rng.normal(size=(frames, WIDTH * objects)).astype(np.float32),
        commanded[: 2 if kind == "midstate" else 0] / 2,
        subtasks=("pick the small block",),
        events=(Event(0.1 + 0.2, "grasped", "block", 0, "left"), Event(1.0, "success")),
        scene_digest="ab" * 32,
        replay_digest="cd" * 32,
        failure="" if kind in ("expert", "noise", "midstate") else "target_grounding",
        pictures=pictures,
        about={"suite": "robospa-3", "version": "0.1"},
    )
