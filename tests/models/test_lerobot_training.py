"""LeRobot's own trainer on a dataset of ours, and its checkpoint in our server: the commands of
docs/policies/lerobot.md, with a small ACT and two steps. `make test-models` runs it."""

import json
from pathlib import Path

import numpy as np
import pytest
from outside import PATIENT, SMALL_ACT, environment, ran, served
from tiny_datasets import tiny_dataset

from robospa.action_space import ActionSpace
from robospa.clients import connect
from robospa.protocol.conformance import synthetic_observation
from robospa.protocol.policy import TrialInfo

SERVED = "robospa.clients.lerobot:create"
SIZES = {**SMALL_ACT, "chunk_size": 10, "n_action_steps": 10}
SMALL = [f"--policy.{name}={value}" for name, value in SIZES.items()]
SHORT = ["--batch_size=2", "--steps=2", "--num_workers=0"]

pytestmark = [pytest.mark.models, pytest.mark.timeout(900)]


def trained(tmp_path: Path) -> Path:
    """The checkpoint of a small ACT after two steps."""
    episodes = tiny_dataset(tmp_path / "data", "lerobot-v3", "h264", 3)
    done = ran(
        *("-m", "lerobot.scripts.lerobot_train", "--policy.type=act"),
        *("--dataset.repo_id=robospa/tiny", f"--dataset.root={tmp_path / 'data'}"),
        *("--dataset.video_backend=pyav", "--policy.device=cpu", "--policy.push_to_hub=false"),
        *(f"--output_dir={tmp_path / 'out'}", *SMALL, *SHORT),
        given=environment(tmp_path / "home"),
    )
    assert f"num_frames={sum(len(episode.commanded) for episode in episodes)} " in done.stderr
    return tmp_path / "out" / "checkpoints" / "last" / "pretrained_model"


def test_act_learns_from_a_dataset_and_is_served(tmp_path: Path) -> None:
    checkpoint = trained(tmp_path)
    config = json.loads((checkpoint / "config.json").read_text())
    images = [f"observation.images.{name}" for name in ("head", "left_wrist", "right_wrist")]
    assert sorted(config["input_features"]) == [*images, "observation.state"], "and nothing else"
    assert list(config["output_features"]) == ["action"]
    words = [f"--option=path={checkpoint}", "--option=device=cpu"]
    with served(SERVED, *words) as url, connect(url, timeouts=PATIENT) as policy:
        policy.reset(TrialInfo("Pick_Blocks_Size", "aloha-agilex", "Go.", 1))
        chunk = policy.infer(synthetic_observation(policy.spec))
    assert chunk.shape == (10, ActionSpace().width) and np.isfinite(chunk).all()
