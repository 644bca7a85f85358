"""LeRobot's own evaluation, with a tiny policy, on our tasks. `make test-models` runs it."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from installed import installed
from outside import HERE, ROOT, environment, ran
from tiny_datasets import CAMERAS, STEP, painted, tiny_dataset

from robospa.harness.datasets.episode import DatasetEpisode
from robospa.harness.demonstrations.noise import LABELS

pytestmark = [pytest.mark.models, pytest.mark.timeout(600)]

RENAMED = {"observation.images.head": "observation.images.head_camera"}
"""Of the tiny policy, which has RoboTwin's names."""


def test_lerobot_eval_runs_its_policy_on_two_levels(tmp_path: Path) -> None:
    ran(HERE / "tiny.py", "make", "act", tmp_path / "act")
    site = tmp_path / "site"  # robospa is not installed there: its robots are found by these notes
    site.mkdir()
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    installed(site, groups)
    ran(
        *("-m", "lerobot.scripts.lerobot_eval", f"--policy.path={tmp_path / 'act'}"),
        *("--policy.device=cpu", "--env.discover_packages_path=robospa.harness.gym"),
        *("--env.type=robospa", "--env.task=Pick_Blocks_Size", "--env.levels=1,2"),
        *("--env.cameras=head", "--env.world=run_fakes:FakeWorld", "--env.parts=run_fakes:parts"),
        *("--env.step_scale=0.05", "--eval.n_episodes=2", "--eval.batch_size=1", "--seed=0"),
        *(f"--output_dir={tmp_path / 'out'}", f"--rename_map={json.dumps(RENAMED)}"),
        given=environment(tmp_path / "home", ROOT / "tests" / "helpers", site),
        cwd=tmp_path,
    )
    found = json.loads((tmp_path / "out" / "eval_info.json").read_text())
    tasks = [(one["task_group"], one["task_id"]) for one in found["per_task"]]
    assert tasks == [("Pick_Blocks_Size", 1), ("Pick_Blocks_Size", 2)]
    assert all(len(one["metrics"]["successes"]) == 2 for one in found["per_task"])
    assert found["overall"]["n_episodes"] == 4
    assert list((tmp_path / "out" / "videos").rglob("*.mp4"))


# ------ the real LeRobot loads packed data sets: every frame, action, task and statistic as written


CASES = [
    ("lerobot-v3", "h264"),
    ("lerobot-v3", "av1"),
    ("lerobot-v3", "png"),
    ("lerobot-v3", "jpeg"),
    ("lerobot-v2.1", "h264"),
    ("lerobot-v2.1", "png"),
]
TOLERANCE = {"h264": 6.0, "av1": 6.0, "jpeg": 6.0, "png": 0.01}
"""Largest mean difference of a picture's values, 0 to 255."""


def loaded(folder: Path, layout: str) -> dict[str, np.ndarray]:
    """Every frame of the data set, as LeRobot gives it."""
    out = folder.parent / "loaded.npz"
    convert = ["--convert"] if layout == "lerobot-v2.1" else []
    home = environment(folder.parent / "home")
    ran(HERE / "loaded.py", *convert, folder, out, given=home, limit=300)
    with np.load(out) as file:
        return dict(file)


@pytest.mark.parametrize(("layout", "codec"), CASES)
def test_lerobot_gives_what_was_written(layout: str, codec: str, tmp_path: Path) -> None:
    episodes = tiny_dataset(tmp_path / "set", layout, codec, count=6)
    found = loaded(tmp_path / "set", layout)
    about = json.loads(str(found["about"]))
    frames = sum(len(episode) for episode in episodes)
    assert len(found["index"]) == frames and about["batch"] == [8, 3, 48, 64]
    start = 0
    for number, episode in enumerate(episodes):
        rows = slice(start, start + len(episode))
        start += len(episode)
        assert set(about["tasks"][rows]) == {episode.instructions[0]}
        assert (found["episode_index"][rows] == number).all()
        assert (found["observation.state"][rows] == episode.commanded).all()
        assert (found["measured_state"][rows] == episode.measured).all()
        assert (found["ee_pose"][rows] == episode.ee.reshape(len(episode), 16)).all()
        assert np.allclose(found["sim_time"][rows], episode.sim_time)
        assert (found["label"][rows] == LABELS.index("expert")).all()
        same_chunks(found["chunks"][rows], found["padded"][rows], episode)
        for i, camera in enumerate(CAMERAS):
            seen = 255 * found[f"observation.images.{camera}"][rows].transpose(0, 2, 3, 1)
            same_pictures(seen, painted(10 * number + i, len(episode)), TOLERANCE[codec])
    same_statistics(about["stats"], episodes, layout)


def same_chunks(chunks: np.ndarray, padded: np.ndarray, episode: DatasetEpisode) -> None:
    """Every frame has its own action and the next three; beyond the end the last is repeated."""
    last = len(episode) - 1
    for t in range(len(episode)):
        wanted = np.minimum(np.arange(t, t + chunks.shape[1]), last)
        assert (chunks[t] == episode.action[wanted]).all()
        assert (padded[t] == (np.arange(t, t + chunks.shape[1]) > last)).all()


def same_pictures(seen: np.ndarray, wanted: np.ndarray, tolerance: float) -> None:
    """Pictures (T, height, width, 3) are those wanted, and none is its neighbour."""
    assert np.abs(seen - wanted).mean(axis=(1, 2, 3)).max() < tolerance
    brighter = np.diff(seen.mean(axis=(1, 2, 3)))
    assert (np.abs(brighter - STEP) < STEP / 2).all()


def same_statistics(
    stats: dict[str, dict[str, object]], episodes: list[DatasetEpisode], layout: str
) -> None:
    """The library's statistics are those of all frames."""
    actions = np.concatenate([episode.action for episode in episodes]).astype(float)
    np.testing.assert_allclose(stats["action"]["mean"], actions.mean(axis=0), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(stats["action"]["std"], actions.std(axis=0), rtol=1e-5)
    assert np.shape(stats["observation.images.head"]["mean"]) == (3, 1, 1)
    if layout == "lerobot-v3":
        low, high = np.quantile(actions, [0.005, 0.995], axis=0, method="nearest")
        assert (np.array(stats["action"]["q01"]) >= low - 1e-3).all()
        assert (np.array(stats["action"]["q99"]) <= high + 1e-3).all()
