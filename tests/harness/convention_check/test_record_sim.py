"""What `robospa collect --record` writes is a demonstration that can be replayed."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import robospa

from robospa.harness.convention_check.check import check_conventions
from robospa.harness.convention_check.episodes import Episode, read_episode
from robospa.observation import DEFAULT_CAMERAS
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.registry import POLICIES, names

pytestmark = [
    pytest.mark.sim,
    pytest.mark.skipif("oracle" not in names(POLICIES), reason="robospa is not installed"),
]


class ByHeart:
    """Knows the episode; `inverted` has 1 for a closed gripper."""

    spec = PolicySpec("by-heart")

    def __init__(self, made: Episode, inverted: bool) -> None:
        self.made, self.inverted = made, inverted

    def reset(self, trial: TrialInfo) -> None:
        assert trial.task == "Pick_Blocks_Size" and trial.instruction

    def infer(self, observation: Mapping[str, Any]) -> Any:
        t = observation["step"]
        chunk = self.made.commanded[t + 1 : t + 51].astype(np.float32)
        if self.inverted:
            chunk[:, [6, 13]] = 1 - chunk[:, [6, 13]]
        return chunk


def test_a_recorded_trial_is_a_demonstration(tmp_path: Path) -> None:
    file = tmp_path / "demo.hdf5"
    words = ("collect", "--record", "Pick_Blocks_Size", "--seed", 100_000, "--out", file)
    done = robospa(*words)
    assert done.code == 0 and "success" in done.out
    made = read_episode(file)
    assert made.commanded.shape == (len(made), 14) and len(made) > 50
    arms = [c for c in range(14) if c not in (6, 13)]
    assert np.abs(np.diff(made.commanded[:, arms], axis=0)).max() < 0.18  # 3 rad/s for 60 ms
    assert made.measured is not None
    assert np.abs(made.measured - made.commanded)[:, arms].max() < 0.1
    assert set(made.frames) == {camera.name for camera in DEFAULT_CAMERAS}
    pictures = [made.picture(camera, len(made) // 2) for camera in DEFAULT_CAMERAS]
    assert all(picture.shape == (240, 320, 3) and picture.std() > 5 for picture in pictures)
    assert check_conventions(ByHeart(made, False), made, 3).kind == "fits"
    wrong = check_conventions(ByHeart(made, True), made, 4)
    assert wrong.best is not None and wrong.best.names == ("gripper inverted",)
    done = robospa(*words)  # nothing is overwritten
    assert done.code == 1 and "exists already" in done.err
