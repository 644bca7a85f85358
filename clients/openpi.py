"""openpi's models behind our own server, and their training on our datasets.

`robospa serve openpi` runs openpi's policy in this process, with noise from our seeds. A
configuration whose `adapt_to_pi` is on is refused: it turns joints and grippers of another robot
into ours silently, which is invisible on the wire. (The client to openpi's own server is
`robospa.clients.openpi_family`.)

A dataset `robospa/NAME` is trained on as `pi05_robospa_NAME`, all parameters, or
`pi05_lora_robospa_NAME` (`docs/policies/pi05.md`). Neither name is in openpi's own list, so its
scripts are started from here, in openpi's environment and folder.
"""

import re
import runpy
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robospa.action_space import ActionSpace
from robospa.clients import model_policy
from robospa.clients.chunks import STATE_TOKENS, Count, RobotOption
from robospa.clients.openpi_family import FamilyOptions
from robospa.protocol.openpi import CAMERA_NAMES
from robospa.protocol.options import option
from robospa.protocol.policy import PolicySpec

NAME = re.compile(r"pi05_(?P<lora>lora_)?robospa_(?P<dataset>[A-Za-z0-9][A-Za-z0-9._-]*)")
SOURCES = "openpi's sources"
CAMERAS = {theirs: ours for ours, theirs in CAMERA_NAMES.items() if ours != "front"}
"""Our camera for each image of openpi's Aloha transform."""
REPACKED = {
    "images": {theirs: f"observation.images.{ours}" for theirs, ours in CAMERAS.items()},
    "state": "observation.state",
    "actions": "action",
    "prompt": "prompt",
}
"""What openpi is to take from a frame of our dataset, under the names that the client sends at
evaluation. Without the prompt, which openpi's Aloha configurations lack, `prompt_from_task` has no
effect."""
WEIGHTS = "gs://openpi-assets/checkpoints/pi05_base/params"
STEPS = 20_000
BATCH = 16
"""Of the paper: its appendix on training; all parameters, from the released weights."""


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
    configs = model_policy.import_code("openpi.training.config", code, SOURCES)
    models = model_policy.import_code("openpi.models.pi0_config", code, SOURCES)
    transforms = model_policy.import_code("openpi.transforms", code, SOURCES)
    loaders = model_policy.import_code("openpi.training.weight_loaders", code, SOURCES)
    kind: dict[str, bool | str] = {"pi05": True}
    extra: dict[str, Any] = {}
    if match["lora"]:
        kind["paligemma_variant"] = "gemma_2b_lora"
        kind["action_expert_variant"] = "gemma_300m_lora"
        extra = {"freeze_filter": models.Pi0Config(**kind).get_freeze_filter(), "ema_decay": None}
    return configs.TrainConfig(
        name=name,
        model=models.Pi0Config(**kind),
        data=configs.LeRobotAlohaDataConfig(
            repo_id=f"robospa/{match['dataset']}",
            adapt_to_pi=False,
            use_delta_joint_actions=True,
            repack_transforms=transforms.Group(inputs=[transforms.RepackTransform(REPACKED)]),
            base_config=configs.DataConfig(prompt_from_task=True),
        ),
        weight_loader=loaders.CheckpointWeightLoader(WEIGHTS),
        num_train_steps=STEPS,
        batch_size=BATCH,
        **extra,
    )


def register(name: str, code: str | None = None) -> None:
    """Add the configuration called `name` to openpi's list, from which its scripts take them."""
    configs = model_policy.import_code("openpi.training.config", code, SOURCES)
    configs._CONFIGS_DICT.setdefault(name, train_config(name, code))


@dataclass(frozen=True)
class OpenPiServerOptions(RobotOption):
    """How the policy is loaded."""

    config: str = option(
        "",
        "name of the training configuration in openpi, or pi05_robospa_NAME of our datasets",
        needed=True,
    )
    checkpoint: str = option("", "its folder (or gs:// address)", needed=True)
    code: str | None = option(None, "folder with openpi's sources, if it is not installed")
    adapt_to_pi: str = option(
        "refuse",
        "`refuse` a configuration with adapt_to_pi on, or `accept` it",
        ("refuse", "accept"),
    )
    batch: Count = option(8, "observations in one call, where the class has infer_batch")
    execute: Count | None = option(None, "actions executed before the next query; none for all")


class OpenPi(model_policy.ModelPolicy):
    """A policy of openpi's `create_trained_policy`."""

    def __init__(
        self,
        policy: Any,
        horizon: int,
        width: int,
        options: OpenPiServerOptions,
        text_budget: int | None = None,
        said: tuple[str, ...] = (),
    ) -> None:
        """`horizon` and `width`: the shape of the model's noise; `said`: its contract."""
        super().__init__()
        if options.execute is not None and options.execute > horizon:
            raise ValueError(f"option execute={options.execute}: at most the horizon {horizon}")
        self.policy, self.shape = policy, (horizon, width)
        self.batches = hasattr(policy, "infer_batch")
        self.spec = PolicySpec(
            name=f"openpi:{options.config}",
            horizon=horizon,
            execute=options.execute,
            batch=options.batch if self.batches else 1,
            seeded=True,
            embodiments=(options.embodiment,),
            action_dim=ActionSpace().width,
            text_budget=text_budget,
            checkpoint=model_policy.describe_checkpoint(options.checkpoint),
            contract=said,
        )

    def predict(self, queries: Sequence[model_policy.Query]) -> list[model_policy.Chunk]:
        inputs = [FamilyOptions().request(query.observation) for query in queries]
        generators = [np.random.default_rng(query.seed) for query in queries]
        noise = [one.standard_normal(self.shape, np.float32) for one in generators]
        if self.batches and len(queries) > 1:
            answer = self.policy.infer_batch(inputs, noise=np.stack(noise))["actions"]
            return [np.array(chunk, np.float32) for chunk in answer]
        pairs = zip(inputs, noise, strict=True)
        return [np.array(self.policy.infer(i, noise=n)["actions"], np.float32) for i, n in pairs]


def create(options: OpenPiServerOptions) -> OpenPi:
    """Load the policy. Raises ModelMissing, and ValueError for a configuration that is refused."""
    configs = model_policy.import_code("openpi.training.config", options.code, SOURCES)
    loading = model_policy.import_code("openpi.policies.policy_config", options.code, SOURCES)
    if NAME.fullmatch(options.config):
        register(options.config, options.code)
    config = configs.get_config(options.config)
    if options.adapt_to_pi == "refuse" and getattr(config.data, "adapt_to_pi", False):
        raise ValueError(
            f"openpi's configuration {options.config!r} has adapt_to_pi on, which bends joints and "
            "grippers for another robot; use one with adapt_to_pi=False, or say "
            "--option adapt_to_pi=accept"
        )
    policy = loading.create_trained_policy(config, options.checkpoint)
    model = config.model
    tokens = getattr(model, "max_token_len", None)
    if tokens is not None and getattr(model, "discrete_state_input", False):
        tokens = max(tokens - STATE_TOKENS, 1)
    stats = sorted(Path(options.checkpoint).expanduser().glob("assets/**/norm_stats.json"))
    delta: bool | None = getattr(config.data, "use_delta_joint_actions", None)
    learned = {True: "joints, learned as differences", False: "absolute joints", None: ""}
    said = model_policy.contract(
        options,
        normalisation=" ".join(model_policy.sample_hash(file) for file in stats),
        actions=learned[delta],
        pictures="224x224, padded",
        dtype=getattr(model, "dtype", ""),
    )
    return OpenPi(policy, model.action_horizon, model.action_dim, options, tokens, said)


def main(words: Sequence[str]) -> None:
    """Run openpi's script `words[0]` with the configurations that the other words name."""
    if not words:
        raise SystemExit("usage: python -m robospa.clients.openpi SCRIPT ARGUMENTS")
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
