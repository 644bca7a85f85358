"""The examples of the documentation run as printed, and fit what our clients and data sets have."""

from __future__ import annotations

import json
import re
import runpy
import subprocess
import sys
import types
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from model_fakes import install

from robospa.action_space import ActionSpace
from robospa.clients import connect
from robospa.clients.go1 import Go1Conventions
from robospa.clients.xvla import XvlaConventions
from robospa.harness.convention_check.episodes import VIEWS, Episode, write_episode
from robospa.observation import CAMERAS
from robospa.protocol.policy import TrialInfo
from robospa.protocol.server import ServerThread

DOCS = Path(__file__).resolve().parents[1] / "docs"
EXAMPLES = DOCS / "examples"


def example(name: str) -> Any:
    """The names in `docs/examples/NAME.py`, fresh."""
    return types.SimpleNamespace(**runpy.run_path(str(EXAMPLES / f"{name}.py")))


def test_the_example_policy_is_served_repeats_itself_and_stands_on_its_page() -> None:
    trial = TrialInfo("Pick_Blocks_Size", "aloha-agilex", "Pick up the largest cube.", 5)
    seen: dict[str, Any] = {
        "images": {"head": np.zeros((224, 224, 3), np.uint8)},
        "state": np.linspace(0, 1, 14, dtype=np.float32),
        "ee": np.zeros((2, 8), np.float32),
        "instruction": trial.instruction,
        "step": 0,
    }
    made = example("my_policy").MyPolicy
    with ServerThread(policy_factory=made) as server, connect(server.url) as policy:
        chunks = []
        for _ in range(2):
            policy.reset(trial)
            chunks.append(policy.infer(seen))
    assert chunks[0].shape == (8, 14) and np.array_equal(*chunks)
    arms = [i for i in range(14) if i not in (6, 13)]
    assert np.array_equal(chunks[0][:, arms], np.tile(seen["state"][arms], (8, 1)))
    code = (EXAMPLES / "my_policy.py").read_text().split("\n\n\n", 1)[1].strip()
    assert code in (DOCS / "adding-a-policy.md").read_text()


@dataclass
class Stock:
    """Stands for each of GO-1's four classes."""

    data_root_dir: list[str] | None = None
    max_steps: int = -1
    per_device_train_batch_size: int = 16
    space_repack: dict[str, str] = field(default_factory=dict)
    ctrl_freq: int = 30


def test_go1_trains_as_the_paper_did_on_the_images_that_its_client_sends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names = ("DatasetArguments", "GOModelArguments", "GOTrainingArguments", "SpaceArguments")
    install(monkeypatch, "go1.configs.go1_sft_agilex", **dict.fromkeys(names, Stock))
    for name in ("go1", "go1.configs"):
        install(monkeypatch, name)
    monkeypatch.setenv("ROBOSPA_DATASET", "/data/robospa/Pick_Blocks_Size")
    monkeypatch.setenv("WORLD_SIZE", "2")
    go1 = example("go1_robospa")
    assert set(names) <= set(vars(go1)), "go1_train.py asks the file for these four"
    space = go1.SpaceArguments()
    places = {"top": "head", "left": "hand_left", "right": "hand_right"}
    for theirs, ours in Go1Conventions().cameras.items():
        assert space.space_repack[f"cam_{places[theirs]}_color"] == f"observation.images.{ours}"
    told = {"state": "observation.state", "action": "action", "final_prompt": "task"}
    assert told.items() <= space.space_repack.items(), "else it learns one constant prompt"
    assert space.ctrl_freq == Go1Conventions().ctrl_freq
    assert go1.GOTrainingArguments().max_steps == 20_000
    assert go1.GOTrainingArguments().per_device_train_batch_size == 8, "16 on two GPUs"
    assert go1.DatasetArguments().data_root_dir == ["/data/robospa/Pick_Blocks_Size"]


def recording(path: Path, *left_out: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        for name in ("head", "left_wrist", "right_wrist"):
            if name not in left_out:
                file[VIEWS[name]] = np.array([b"jpeg"])
        file["endpose/left_gripper"] = np.zeros(1)
        if "sentence" not in left_out:
            file["language_instruction"] = "Go."
    return path


def test_xvla_is_given_every_file_and_the_views_that_its_client_sends(tmp_path: Path) -> None:
    folder = tmp_path / "Pick_Blocks_Size" / "demo_clean" / "data"
    files = [recording(folder / f"episode{i}.hdf5") for i in range(3)]
    out = tmp_path / "meta.json"
    script = EXAMPLES / "xvla_robospa.py"
    subprocess.run([sys.executable, str(script), str(tmp_path), str(out)], check=True)
    made = json.loads(out.read_text())
    assert made["datalist"] == [str(path) for path in files]
    assert made["observation_key"] == [VIEWS[name] for name in XvlaConventions().views]
    with h5py.File(files[0]) as file:
        assert file[made["language_instruction_key"]][()].decode() == "Go."
    assert made["dataset_name"] == "robotwin2_clean", "domain 6, the client's default"
    assert XvlaConventions().domain_id == 6


@pytest.mark.parametrize("left_out", ["sentence", "left_wrist"])
def test_a_file_that_xvla_would_skip_in_silence_is_named(tmp_path: Path, left_out: str) -> None:
    path = recording(tmp_path / "episode0.hdf5", left_out)
    with pytest.raises(ValueError, match=re.escape(path.name)):
        example("xvla_robospa").describe([path])


class FakeDataset:
    """Keeps what it is given, as LeRobot's class would."""

    made: FakeDataset

    def __init__(self, **arguments: Any) -> None:
        self.arguments, self.frames = arguments, []
        self.saved, self.finalized = 0, False

    @classmethod
    def create(cls, **arguments: Any) -> FakeDataset:
        cls.made = cls(**arguments)
        return cls.made

    def add_frame(self, frame: dict[str, Any]) -> None:
        features = self.arguments["features"]
        assert set(frame) == {*features, "task"}
        assert all(frame[k].shape == tuple(f["shape"]) for k, f in features.items())
        self.frames.append(frame)

    def save_episode(self) -> None:
        self.saved += 1

    def finalize(self) -> None:
        self.finalized = True


def test_the_converter_gives_lerobot_what_it_wants(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commanded = np.arange(3 * 14, dtype=float).reshape(3, 14)
    frames = dict.fromkeys(CAMERAS[:3], [np.zeros((240, 320, 3), np.uint8)] * 3)
    made = Episode("e", commanded, np.zeros((3, 2, 8)), frames, ActionSpace("joint"), "Go.")
    for i in range(2):
        write_episode(tmp_path / "data" / f"episode{i}.hdf5", made)
    install(monkeypatch, "lerobot.datasets.lerobot_dataset", LeRobotDataset=FakeDataset)
    for name in ("lerobot", "lerobot.datasets"):
        install(monkeypatch, name)
    files = sorted((tmp_path / "data").glob("*.hdf5"))
    example("to_lerobot").convert(files, tmp_path / "out")
    dataset = FakeDataset.made
    assert (dataset.saved, len(dataset.frames), dataset.finalized) == (2, 4, True)
    assert np.array_equal(dataset.frames[0]["action"], commanded[1].astype(np.float32))
    assert dataset.frames[0]["task"] == "Go."
