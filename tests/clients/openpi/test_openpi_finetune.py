"""openpi's configuration for our datasets: what is read at training is what is sent later."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from model_fakes import install

from robospa.action_space import ActionSpace
from robospa.clients.openpi import finetune, serve
from robospa.protocol.openpi import CAMERA_NAMES, to_openpi


def kept(kind: str) -> Any:
    """A stand-in of one of openpi's dataclasses: keeps its fields."""
    return lambda *args, **fields: SimpleNamespace(kind=kind, args=args, **fields)


@pytest.fixture
def configs(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """openpi without weights; its list of configurations."""
    known: dict[str, Any] = {}

    def model(**fields: Any) -> Any:
        sizes = {"action_horizon": 50, "action_dim": 32, "max_token_len": 200}
        return SimpleNamespace(
            discrete_state_input=True,
            get_freeze_filter=lambda: sorted(fields),
            fields=fields,
            **sizes,
        )

    install(
        monkeypatch,
        "openpi.training.config",
        _CONFIGS_DICT=known,
        get_config=known.__getitem__,
        TrainConfig=kept("train"),
        LeRobotAlohaDataConfig=kept("aloha"),
        DataConfig=kept("data"),
    )
    install(monkeypatch, "openpi.models.pi0_config", Pi0Config=model)
    install(
        monkeypatch,
        "openpi.transforms",
        Group=kept("group"),
        RepackTransform=kept("repack"),
    )
    install(
        monkeypatch,
        "openpi.training.weight_loaders",
        CheckpointWeightLoader=kept("weights"),
    )
    return known


def test_the_configuration_is_the_papers(configs: dict[str, Any]) -> None:
    made = finetune.train_config("pi05_robospa_Pick_Blocks_Size")
    assert made.name == "pi05_robospa_Pick_Blocks_Size"
    assert (made.num_train_steps, made.batch_size) == (20_000, 16)
    assert made.model.fields == {"pi05": True}
    assert made.weight_loader.args == ("gs://openpi-assets/checkpoints/pi05_base/params",)
    data = made.data
    assert data.kind == "aloha" and data.repo_id == "robospa/Pick_Blocks_Size"
    assert (data.adapt_to_pi, data.use_delta_joint_actions) == (False, True)
    assert data.base_config.prompt_from_task is True
    assert not hasattr(made, "freeze_filter")


def test_the_names_read_at_training_are_those_sent_at_evaluation(configs: dict[str, Any]) -> None:
    made = finetune.train_config("pi05_robospa_x")
    (repacked,) = made.data.repack_transforms.inputs
    (structure,) = repacked.args
    observation: Any = {
        "images": {name: np.zeros((2, 2, 3), np.uint8) for name in finetune.CAMERAS.values()},
        "state": np.zeros(ActionSpace("joint").width),
        "instruction": "Go.",
    }
    sent = to_openpi(observation, CAMERA_NAMES, {})
    assert set(structure) == {*sent, "actions"}
    assert set(structure["images"]) == set(sent["images"])  # type: ignore[call-overload]
    assert structure["images"]["cam_left_wrist"] == "observation.images.left_wrist"
    assert {CAMERA_NAMES[ours]: ours for ours in finetune.CAMERAS.values()} == finetune.CAMERAS


def test_low_memory_freezes_what_openpi_freezes(configs: dict[str, Any]) -> None:
    made = finetune.train_config("pi05_lora_robospa_x")
    variants = ["action_expert_variant", "paligemma_variant", "pi05"]
    assert sorted(made.model.fields) == variants == made.freeze_filter
    assert made.ema_decay is None and made.data.repo_id == "robospa/x"


@pytest.mark.parametrize("name", ["pi05_robospa_", "pi05_aloha", "pi05_robospa_a/b", "x"])
def test_another_name_is_refused(name: str, configs: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="no configuration of ours"):
        finetune.train_config(name)


def test_a_script_of_openpi_finds_the_configurations_that_it_is_given(
    configs: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "train.py"
    script.write_text(
        "import importlib, pathlib, sys\n"
        "c = importlib.import_module('openpi.training.config')\n"
        "pathlib.Path(sys.argv[-1]).write_text(' '.join([__name__, *sorted(c._CONFIGS_DICT)]))\n"
    )
    monkeypatch.setattr(sys, "argv", ["before"])
    monkeypatch.setattr(sys, "path", list(sys.path))
    out = tmp_path / "out"
    finetune.main([str(script), "pi05_robospa_a", "--policy.config=pi05_lora_robospa_b", str(out)])
    assert out.read_text() == "__main__ pi05_lora_robospa_b pi05_robospa_a"


def test_our_server_finds_the_configuration_of_a_dataset(
    configs: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Any] = []
    install(
        monkeypatch,
        "openpi.policies.policy_config",
        create_trained_policy=lambda config, folder: given.append(config) or SimpleNamespace(),
    )
    options = serve.OpenPiServerOptions(config="pi05_robospa_x", checkpoint="19999")
    policy = serve.create(options)
    assert given == [configs["pi05_robospa_x"]]
    assert (policy.spec.name, policy.spec.horizon) == ("openpi:pi05_robospa_x", 50)
