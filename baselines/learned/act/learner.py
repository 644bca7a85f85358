"""`robospa learn train act`: what it can be told, how it trains, and how its checkpoint is loaded.

Torch and LeRobot (Python 3.12) are needed to train and to serve, and imported only then.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.baselines.learned.act.settings import About, ActOptions
from robospa.baselines.learned.learner import CheckpointError, Learner, read_about
from robospa.schema import read

if TYPE_CHECKING:
    from robospa.baselines.learned.act.policy import ActPolicy

NEEDED = ("torch", "lerobot.policies.act.modeling_act", "safetensors")


class LeRobotMissing(ImportError):
    """LeRobot is not installed here; the message says what to do."""


def require() -> None:
    """Raises LeRobotMissing unless LeRobot can be imported here."""
    for module in NEEDED:
        try:
            importlib.import_module(module)
        except ImportError as error:
            raise LeRobotMissing(
                f"LeRobot's ACT cannot be imported here ({error}): use the environment that "
                "scripts/models.sh makes (.venv-models, Python 3.12), or pip install "
                "'robospa[learn]' under Python 3.12"
            ) from error


def train(data: Sequence[Path], out: Path, resume: bool, options: ActOptions) -> None:
    """Train, as `robospa.baselines.learned.act.training.train` says."""
    require()
    from robospa.baselines.learned.act.training import train as run

    run(data, out, resume, options)


def load(folder: Path) -> ActPolicy:
    """The policy of a checkpoint. Raises CheckpointError and LeRobotMissing."""
    about = read(About, read_about(folder), f"the checkpoint {folder}", CheckpointError)
    require()
    import torch

    from robospa.baselines.learned.act.examples import Batch
    from robospa.baselines.learned.act.network import inputs, keyframes
    from robospa.baselines.learned.act.policy import ActPolicy
    from robospa.baselines.learned.act.training import load_network
    from robospa.clients.model_policy import describe_checkpoint

    torch.set_num_threads(1)
    network = load_network(folder, about)

    def predict(batch: Batch) -> NDArray[np.float32]:
        with torch.inference_mode():
            return keyframes(network.predict_action_chunk(inputs(batch, about)), about)

    return ActPolicy(about, predict, describe_checkpoint(str(folder / "model.safetensors")))


LEARNER = Learner(ActOptions, train, load)
