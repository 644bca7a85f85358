"""The policy that does not see, with LeRobot's ACT: trained to the bit, resumed, served."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dataset_fakes import fake_episode
from outside import PATIENT, ran, served
from tiny_datasets import MANIFEST, written

from robospa.clients import connect
from robospa.harness.datasets.pack import pack
from robospa.protocol.conformance import synthetic_observation
from robospa.protocol.policy import TrialInfo
from robospa.trial import TrialKey

SMALL = {
    "steps": 4, "save": 2, "batch": 4, "width": 16, "heads": 2, "layers": 1, "chunk": 3,
    "threads": 1, "warmup": 1, "dropout": 0.1,
}  # fmt: skip
TWICE = """
import json, shutil, sys
from pathlib import Path
from robospa.baselines.learned.act.examples import read_examples
from robospa.baselines.learned.act.settings import ActOptions
from robospa.baselines.learned.act.training import Training, describe, train

data, out = [Path(sys.argv[1])], Path(sys.argv[2])
options = ActOptions(**json.loads(sys.argv[3]))
said = []
for name in ("one", "two"):
    train(data, out / name, False, options, said.append)
examples = read_examples(data)
about = describe(examples, options)
half = Training(examples, about, out / "half", False)
while half.step < 2:
    half._one_step()
half._save(half._validate()["error_mm"])
half._one_step()  # a step that no checkpoint has
train(data, out / "half", True, options, said.append)
weights = {n: (out / n / "model.safetensors").read_bytes() for n in ("one", "two", "half")}
refused = ""
try:
    train(data, out / "half", False, options, said.append)
except ValueError as error:
    refused = str(error)
print(json.dumps({
    "repeated": weights["one"] == weights["two"], "resumed": weights["one"] == weights["half"],
    "refused": refused, "said": said,
}))
"""

CHOOSING = """
import sys
from pathlib import Path
import numpy as np
from robospa.baselines.learned.act.examples import Examples
from robospa.baselines.learned.act.network import inputs, keyframes
from robospa.baselines.learned.act.objects import _PLACE
from robospa.baselines.learned.act.settings import ActOptions
from robospa.baselines.learned.act.training import Training, describe
from robospa.observation import FEATURES, SLOTS

rng = np.random.default_rng(0)
scenes, frames = 300, 4
objects = np.zeros((scenes, SLOTS, len(FEATURES)), np.float32)
column = FEATURES.index
objects[:, :3, column("present")] = 1
objects[:, :3, column("x")] = [-0.2, 0.0, 0.2] + rng.uniform(-0.08, 0.08, (scenes, 3))
objects[:, :3, column("y")] = rng.uniform(-0.1, 0.1, (scenes, 3))
half = 0.022 + 0.005 * rng.random((scenes, 3)).argsort(axis=1)
for name in ("half_x", "half_y", "half_z"):
    objects[:, :3, column(name)] = half
wanted = rng.integers(2, size=scenes)
meant = np.where(wanted, half.argmin(axis=1), half.argmax(axis=1))
plans = np.zeros((scenes, frames, 20), np.float32)
plans[:, 1:, :3] = objects[np.arange(scenes), meant][:, None, _PLACE] + (0, 0, 0.15)
rows = np.repeat(objects, frames, axis=0)
arms = np.zeros((scenes * frames, 20), np.float32)
made = Examples(
    "aloha-agilex", arms, plans.reshape(-1, 20), rows, np.arange(0, len(rows) + 1, frames),
    tuple(np.array([w], np.int32) for w in wanted),
    ("lift the largest block", "lift the smallest block"), ("Pick_Blocks_Size-L2",) * scenes,
)
options = ActOptions(steps=250, batch=32, width=32, heads=2, layers=1, chunk=3, threads=1,
                     warmup=20, rate=2e-3, held_out=0.3)
run = Training(made, about := describe(made, options), Path(sys.argv[1]), False)
while run.step < options.steps:
    run._one_step()
unseen = run._validation
answer = keyframes(run.network.predict_action_chunk(inputs(unseen, about)), about)
print(float((np.abs(answer[:, :, :2] - unseen.target[:, :, :2]).max(axis=(1, 2)) < 0.03).mean()))
"""

pytestmark = [pytest.mark.models, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Checkpoints `one`, `two` and `half`, and what was said, in `said.json`."""
    path = tmp_path_factory.mktemp("act")
    episodes = []
    for seed in range(1_000_000, 1_000_006):
        made = fake_episode(TrialKey("Pick_Blocks_Size", 1, seed, split="train"), 5, objects=True)
        ee = made.ee.copy()
        ee[..., 3:7] = (1.0, 0.0, 0.0, 0.0)
        objects = made.environment_state.reshape(5, 20, 32).copy()
        objects[:, 2:] = 0.0
        objects[:, :2, 0] = 1.0
        flat = objects.reshape(5, -1)
        episodes.append(replace(made, ee=ee, environment_state=flat, pictures={}))
    pack("lerobot-v3", path / "data", written(path / "files", episodes), MANIFEST)
    done = ran("-c", TWICE, path / "data", path, json.dumps(SMALL))
    (path / "said.json").write_text(done.stdout.splitlines()[-1])
    return path


def test_training_repeats_itself_to_the_bit_also_when_resumed(folder: Path) -> None:
    found = json.loads((folder / "said.json").read_text())
    assert found["repeated"] and found["resumed"]
    assert "has a checkpoint already: add --resume" in found["refused"]
    assert "6 episodes of 1 variants, 30 keyframes" in found["said"][0]
    about = json.loads((folder / "one" / "policy.json").read_text())
    assert (about["learner"], about["step"], about["slots"], about["episodes"]) == ("act", 4, 2, 5)


def test_a_checkpoint_is_served_and_repeats_itself(folder: Path) -> None:
    option = f"--option=path={folder / 'one'}"
    with served("learned", option) as url, connect(url, timeouts=PATIENT) as policy:
        assert policy.spec.environment_state and policy.spec.cameras == ()
        seen = synthetic_observation(policy.spec)
        chunks = []
        for _ in range(2):
            policy.reset(TrialInfo("Pick_Blocks_Size", "aloha-agilex", "take it"))
            chunks.append(policy.infer(seen))
    assert np.array_equal(*chunks) and chunks[0].shape[1] == 16


def test_it_takes_the_object_that_is_asked_for_in_scenes_that_it_has_not_seen(
    tmp_path: Path,
) -> None:
    """Blocks that differ by 5 mm, 210 scenes to learn from; one in three is right by chance."""
    done = ran("-c", CHOOSING, tmp_path)
    assert float(done.stdout) > 0.9
