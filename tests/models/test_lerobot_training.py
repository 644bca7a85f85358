"""LeRobot's own trainer on a dataset of ours, and its checkpoint in our server: the commands of
docs/policies/lerobot.md, with a small ACT and two steps. `make test-models` runs it."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from tiny_datasets import tiny_dataset

from robospa.action_space import ActionSpace
from robospa.clients import connect
from robospa.protocol.policy import TrialInfo
from robospa.protocol.transport import Timeouts

ROOT = Path(__file__).resolve().parents[2]
PYTHON = os.environ.get("ROBOSPA_MODELS_PYTHON", str(ROOT / ".venv-models" / "bin" / "python"))
SERVED = "robospa.clients.lerobot:create"
SIZES = {
    "dim_model": 32,
    "n_heads": 2,
    "dim_feedforward": 32,
    "n_encoder_layers": 1,
    "n_vae_encoder_layers": 1,
    "pretrained_backbone_weights": "null",
    "chunk_size": 10,
    "n_action_steps": 10,
}
SMALL = [f"--policy.{name}={value}" for name, value in SIZES.items()]
SHORT = ["--batch_size=2", "--steps=2", "--num_workers=0"]
PATIENT = Timeouts(wait=60, hello=60, reset=300, first_infer=300, infer=300)

pytestmark = [pytest.mark.models, pytest.mark.timeout(900)]


def environment(home: Path) -> dict[str, str]:
    return {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "PYTHONDONTWRITEBYTECODE": "1",
        "HF_HUB_OFFLINE": "1",
        "HF_HOME": str(home),
        "CUDA_VISIBLE_DEVICES": "",
    }


def trained(tmp_path: Path) -> Path:
    """The checkpoint of a small ACT after two steps."""
    episodes = tiny_dataset(tmp_path / "data", "lerobot-v3", "h264", 3)
    command = [
        *(PYTHON, "-m", "lerobot.scripts.lerobot_train", "--policy.type=act"),
        *("--dataset.repo_id=robospa/tiny", f"--dataset.root={tmp_path / 'data'}"),
        *("--dataset.video_backend=pyav", "--policy.device=cpu", "--policy.push_to_hub=false"),
        *(f"--output_dir={tmp_path / 'out'}", *SMALL, *SHORT),
    ]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=600, env=environment(tmp_path / "home")
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert f"num_frames={sum(len(episode.commanded) for episode in episodes)} " in done.stderr
    return tmp_path / "out" / "checkpoints" / "last" / "pretrained_model"


def test_act_learns_from_a_dataset_and_is_served(tmp_path: Path) -> None:
    checkpoint = trained(tmp_path)
    config = json.loads((checkpoint / "config.json").read_text())
    images = [f"observation.images.{name}" for name in ("head", "left_wrist", "right_wrist")]
    assert sorted(config["input_features"]) == [*images, "observation.state"], "and nothing else"
    assert list(config["output_features"]) == ["action"]
    words = [f"--option=path={checkpoint}", "--option=device=cpu", "--port=0"]
    command = [PYTHON, "-m", "robospa.harness.cli.main", "serve", SERVED, *words]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env=environment(tmp_path / "home")
    ) as server:
        assert server.stdout is not None
        try:
            line = next((text for text in server.stdout if text.startswith("serving ")), "")
            assert " at ws://" in line, "the server did not start; see its messages above"
            with connect(line.split(" at ")[1].split()[0], timeouts=PATIENT) as policy:
                policy.reset(TrialInfo("Pick_Blocks_Size", "aloha-agilex", "Go.", 1))
                chunk = policy.infer(
                    {
                        "images": {
                            camera.name: np.zeros((camera.height, camera.width, 3), np.uint8)
                            for camera in policy.spec.cameras
                        },
                        "state": np.zeros(ActionSpace().width, np.float32),
                        "ee": np.zeros((2, 8), np.float32),
                        "instruction": "Go.",
                        "step": 0,
                    }
                )
        finally:
            server.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                server.wait(20)
            server.kill()
    assert chunk.shape == (10, ActionSpace().width) and np.isfinite(chunk).all()
