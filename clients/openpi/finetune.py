"""openpi's configuration for a dataset of `robospa collect`, without an edit of openpi's files.

A dataset `robospa/NAME` (the folder $HF_LEROBOT_HOME/robospa/NAME, format lerobot-v2.1) is trained
on as `pi05_robospa_NAME`, all parameters, or `pi05_lora_robospa_NAME`. Neither name is in openpi's
own list, so its scripts are started from here, in openpi's environment and folder:

    python -m robospa.clients.openpi.finetune scripts/train.py pi05_robospa_NAME --exp-name=first

    our dataset                      openpi
    observation.images.head          images.cam_high
    observation.images.left_wrist    images.cam_left_wrist
    observation.images.right_wrist   images.cam_right_wrist
    observation.state                state: what was commanded
    action                           actions, joints as differences to the state, grippers as
                                     they are
    the episode's sentence           prompt

They are what `to_openpi` sends at evaluation. openpi's own Aloha configurations name no prompt
among what they take from a dataset; without it, `prompt_from_task` has no effect.
"""

from __future__ import annotations

import re
import runpy
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from robospa.clients.model_policy import import_code
from robospa.protocol.openpi import CAMERA_NAMES

NAME = re.compile(r"pi05_(?P<lora>lora_)?robospa_(?P<dataset>[A-Za-z0-9][A-Za-z0-9._-]*)")
SOURCES = "openpi's sources"
CAMERAS = {theirs: ours for ours, theirs in CAMERA_NAMES.items() if ours != "front"}
"""Our camera for each image of openpi's Aloha transform."""
WEIGHTS = "gs://openpi-assets/checkpoints/pi05_base/params"
STEPS = 20_000
BATCH = 16
"""Of the paper: its appendix on training; all parameters, from the released weights."""


def repack() -> dict[str, Any]:
    """What openpi is to take from a frame of our dataset, under its own names."""
    images = {theirs: f"observation.images.{ours}" for theirs, ours in CAMERAS.items()}
    return {
        "images": images,
        "state": "observation.state",
        "actions": "action",
        "prompt": "prompt",
    }


def train_config(name: str, code: str | None = None) -> Any:
    """The `TrainConfig` called `name`; ValueError for a name that is not of the form above.

    `code` is a folder with openpi's sources, where they are not installed. Raises ModelMissing.
    """
    match = NAME.fullmatch(name)
    if match is None:
        raise ValueError(
            f"{name!r} is no configuration of ours: pi05_robospa_NAME or pi05_lora_robospa_NAME, "
            "NAME being the folder of a dataset in $HF_LEROBOT_HOME/robospa"
        )
    configs = import_code("openpi.training.config", code, SOURCES)
    models = import_code("openpi.models.pi0_config", code, SOURCES)
    transforms = import_code("openpi.transforms", code, SOURCES)
    loaders = import_code("openpi.training.weight_loaders", code, SOURCES)
    kind: dict[str, bool | str] = {"pi05": True}
    extra: dict[str, Any] = {}
    if match["lora"]:
        kind |= {
            "paligemma_variant": "gemma_2b_lora",
            "action_expert_variant": "gemma_300m_lora",
        }
        extra = {"freeze_filter": models.Pi0Config(**kind).get_freeze_filter(), "ema_decay": None}
    return configs.TrainConfig(
        name=name,
        model=models.Pi0Config(**kind),
        data=configs.LeRobotAlohaDataConfig(
            repo_id=f"robospa/{match['dataset']}",
            adapt_to_pi=False,
            use_delta_joint_actions=True,
            repack_transforms=transforms.Group(inputs=[transforms.RepackTransform(repack())]),
            base_config=configs.DataConfig(prompt_from_task=True),
        ),
        weight_loader=loaders.CheckpointWeightLoader(WEIGHTS),
        num_train_steps=STEPS,
        batch_size=BATCH,
        **extra,
    )


def register(name: str, code: str | None = None) -> None:
    """Add the configuration called `name` to openpi's list, from which its scripts take them."""
    configs = import_code("openpi.training.config", code, SOURCES)
    configs._CONFIGS_DICT.setdefault(name, train_config(name, code))


def main(words: Sequence[str]) -> None:
    """Run openpi's script `words[0]` with the configurations that the other words name."""
    if not words:
        raise SystemExit("usage: python -m robospa.clients.openpi.finetune SCRIPT ARGUMENTS")
    script, *rest = words
    for word in rest:
        value = word.rpartition("=")[2]
        if NAME.fullmatch(value):
            register(value)
    sys.argv = [script, *rest]
    sys.path.insert(0, str(Path(script).resolve().parent))
    runpy.run_path(script, run_name="__main__")


if __name__ == "__main__":
    main(sys.argv[1:])
