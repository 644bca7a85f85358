"""Tiny LeRobot policies with random weights, made offline; runs in the models' environment.

python tiny.py make NAME FOLDER [CAMERA CAMERA CAMERA]     write a checkpoint of a model of MAKERS
python tiny.py batch NAME FOLDER    load it as we serve it and compare a batch with single queries
python tiny.py prompt pi05 FOLDER   how many numbers of state its prompt has, by `state_prompt`
python tiny.py noise                 which of torch's random functions follow the seeds row by row

`serve_pi05` serves the tiny pi0.5: LeRobot builds that model in two sizes only, so three of its
functions are replaced by smaller ones while it is made and loaded.
"""

import json
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

os.environ.setdefault("HF_HUB_OFFLINE", "1")

import numpy as np
import torch
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.policies.factory import make_pre_post_processors

from robospa.clients import lerobot as served
from robospa.clients.model_policy import NotByRow, Query, seeded_rows
from robospa.protocol.conformance import synthetic_observation
from robospa.protocol.policy import TrialInfo

Views = tuple[str, ...]
VIEWS = ("head_camera", "left_camera", "right_camera")
WORDS = "Pick up the largest cube."


def features(width: int, size: tuple[int, int], views: Views = VIEWS) -> dict[str, Any]:
    """Inputs and outputs of a policy with `width` numbers; `size` (height, width) of images."""
    inputs = {
        f"observation.images.{view}": PolicyFeature(FeatureType.VISUAL, (3, *size))
        for view in views
    }
    inputs["observation.state"] = PolicyFeature(FeatureType.STATE, (width,))
    outputs = {"action": PolicyFeature(FeatureType.ACTION, (width,))}
    return {"input_features": inputs, "output_features": outputs}


def statistics(width: int, views: Views = VIEWS) -> dict[str, dict[str, torch.Tensor]]:
    """Means, deviations, bounds and quantiles of a data set that never was."""
    zero, one = torch.zeros(width), torch.ones(width)
    numbers = {"mean": zero, "std": 0.2 * one, "min": -one, "max": one, "q01": -one, "q99": one}
    image = {
        "mean": torch.full((3, 1, 1), 0.5),
        "std": torch.full((3, 1, 1), 0.25),
        "min": torch.zeros(3, 1, 1),
        "max": torch.ones(3, 1, 1),
    }
    images = {f"observation.images.{view}": image for view in views}
    return {"observation.state": numbers, "action": numbers, **images}


def tokenizer(folder: Path) -> str:
    """A tokenizer of single bytes, 260 ids; its folder."""
    from tokenizers import Tokenizer, decoders, models, pre_tokenizers
    from transformers import PreTrainedTokenizerFast

    specials = ["<pad>", "<eos>", "<bos>", "<unk>"]
    alphabet = sorted(pre_tokenizers.ByteLevel.alphabet())
    vocabulary = {word: i for i, word in enumerate([*specials, *alphabet])}
    made = Tokenizer(models.BPE(vocabulary, [], unk_token="<unk>"))
    made.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    made.decoder = decoders.ByteLevel()
    PreTrainedTokenizerFast(
        tokenizer_object=made,
        pad_token="<pad>",
        eos_token="<eos>",
        bos_token="<bos>",
        unk_token="<unk>",
    ).save_pretrained(str(folder))
    return str(folder)


def built(kind: str, **config: Any) -> Any:
    """LeRobot's policy whose classes begin with `kind`, of this configuration."""
    name = kind.lower()
    settings = import_module(f"lerobot.policies.{name}.configuration_{name}")
    models = import_module(f"lerobot.policies.{name}.modeling_{name}")
    config_of, policy_of = getattr(settings, f"{kind}Config"), getattr(models, f"{kind}Policy")
    return policy_of(config_of(device="cpu", **config))


def act(folder: Path, views: Views) -> Any:
    """ACT without patches: one camera, no pre-trained backbone."""
    return built(
        "ACT",
        **features(14, (240, 320), views[:1]),
        chunk_size=50,
        n_action_steps=50,
        dim_model=128,
        n_heads=4,
        dim_feedforward=512,
        n_encoder_layers=2,
        n_decoder_layers=1,
        use_vae=False,
        pretrained_backbone_weights=None,
    )


def diffusion(folder: Path, views: Views) -> Any:
    """Diffusion policy without patches: one camera, two frames."""
    return built(
        "Diffusion",
        **features(14, (96, 128), views[:1]),
        n_obs_steps=2,
        horizon=16,
        n_action_steps=8,
        crop_shape=(84, 112),
        pretrained_backbone_weights=None,
        down_dims=(32, 64),
        diffusion_step_embed_dim=16,
        spatial_softmax_num_keypoints=8,
        num_train_timesteps=10,
        num_inference_steps=4,
    )


def xvla(folder: Path, views: Views) -> Any:
    """X-VLA without patches, 0.86 million parameters."""

    vision = {
        "embed_dim": [16, 32, 64, 64],
        "num_heads": [1, 2, 4, 4],
        "num_groups": [1, 2, 4, 4],
        "depths": [1, 1, 1, 1],
        "window_size": 7,
        "projection_dim": 64,
        "max_position_embeddings": 50,
        "max_temporal_embeddings": 100,
    }
    text = {
        "vocab_size": 512,
        "d_model": 64,
        "encoder_layers": 2,
        "decoder_layers": 1,
        "encoder_attention_heads": 2,
        "decoder_attention_heads": 2,
        "encoder_ffn_dim": 128,
        "decoder_ffn_dim": 128,
        "pad_token_id": 0,
        "eos_token_id": 1,
        "bos_token_id": 2,
    }
    return built(
        "XVLA",
        **features(20, (224, 224), views),
        florence_config={"vision_config": vision, "text_config": text, "image_token_id": 300},
        tokenizer_name=tokenizer(folder / "tokenizer"),
        tokenizer_max_length=50,
        hidden_size=64,
        depth=2,
        num_heads=4,
        chunk_size=30,
        n_action_steps=30,
        max_state_dim=20,
        action_mode="ee6d",
    )


def shrink_pi05() -> None:
    """Let LeRobot build a pi0.5 of half a million parameters."""
    from lerobot.policies.pi05 import modeling_pi05 as module

    if hasattr(module, "robospa_shrunk"):
        return
    module.robospa_shrunk = True
    paligemma = module.PaliGemmaForConditionalGenerationWithPiGemma
    gemma = module.PiGemmaForCausalLM

    def small_gemma(variant: str) -> Any:
        return module.GemmaConfig(
            width=64, depth=2, mlp_dim=128, num_heads=8, num_kv_heads=1, head_dim=16
        )

    def small_paligemma(config: Any) -> Any:
        config._vocab_size = config.text_config.vocab_size = 512
        vision = config.vision_config
        vision.hidden_size, vision.num_hidden_layers, vision.num_attention_heads = 64, 2, 2
        vision.intermediate_size, vision.projection_dim = 128, 64
        config.projection_dim = 64
        return paligemma(config=config)

    def small_expert(config: Any) -> Any:
        config.vocab_size = 512
        return gemma(config=config)

    module.get_gemma_config = small_gemma
    module.PaliGemmaForConditionalGenerationWithPiGemma = small_paligemma
    module.PiGemmaForCausalLM = small_expert


def pi05(folder: Path, views: Views) -> Any:
    """pi0.5 with the three patches."""
    shrink_pi05()

    tokenizer(folder / "tokenizer")
    return built(
        "PI05",
        **features(14, (240, 320), views),
        image_resolution=(56, 56),
        chunk_size=10,
        n_action_steps=10,
        num_inference_steps=2,
    )


def smolvla(folder: Path, views: Views) -> Any:
    """SmolVLA without patches: LeRobot takes its language model's sizes from a folder."""
    from transformers import (
        AutoTokenizer,
        SmolVLMConfig,
        SmolVLMImageProcessor,
        SmolVLMProcessor,
        SmolVLMVideoProcessor,
    )

    language = folder / "language"
    tokenizer(language)
    words = AutoTokenizer.from_pretrained(
        str(language),
        extra_special_tokens={
            "image_token": "<image>",
            "fake_image_token": "<fake_token_around_image>",
            "global_image_token": "<global-img>",
            "end_of_utterance_token": "<end_of_utterance>",
        },
    )
    side = {"hidden_size": 64, "intermediate_size": 128, "num_hidden_layers": 2}
    SmolVLMConfig(
        vision_config={**side, "num_attention_heads": 2, "image_size": 64, "patch_size": 16},
        text_config={
            **side,
            "model_type": "llama",
            "num_attention_heads": 4,
            "num_key_value_heads": 2,
            "head_dim": 16,
            "vocab_size": 512,
        },
        scale_factor=2,
    ).save_pretrained(str(language))
    SmolVLMProcessor(SmolVLMImageProcessor(), words, SmolVLMVideoProcessor()).save_pretrained(
        str(language)
    )
    return built(
        "SmolVLA",
        **features(14, (240, 320), views),
        vlm_model_name=str(language),
        resize_imgs_with_padding=(64, 64),
        num_vlm_layers=2,
        chunk_size=10,
        n_action_steps=10,
        num_steps=2,
    )


MAKERS = {"act": act, "xvla": xvla, "pi05": pi05, "diffusion": diffusion, "smolvla": smolvla}


def make(name: str, where: str, *views: str) -> None:
    """Write the checkpoint, of cameras by these names, and its processors."""
    torch.manual_seed(0)
    folder = Path(where).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    policy = MAKERS[name](folder, views or VIEWS)
    config = policy.config
    width = config.output_features["action"].shape[0]
    cameras = tuple(key.rpartition(".")[2] for key in config.image_features)
    if name == "pi05":  # its factory looks for a gated tokenizer, by this name, in the hub or here
        link = folder / "google" / "paligemma-3b-pt-224"
        link.parent.mkdir(exist_ok=True)
        tokenizer(link)
        os.chdir(folder)
    before, after = make_pre_post_processors(config, dataset_stats=statistics(width, cameras))
    for part in (policy, before, after):
        part.save_pretrained(str(folder))
    parameters = sum(parameter.numel() for parameter in policy.parameters())
    print(json.dumps({"name": name, "parameters": parameters}))


def options(name: str, folder: str) -> served.LeRobotServerOptions:
    """How the tests serve the checkpoint."""
    words = str(Path(folder) / "tokenizer") if name in ("pi05", "xvla") else None
    domain = 6 if name == "xvla" else None
    return served.LeRobotServerOptions(path=folder, device="cpu", tokenizer=words, domain_id=domain)


def serve_pi05(options: served.LeRobotServerOptions) -> served.LeRobot:
    """The tiny pi0.5 as `robospa serve lerobot` would serve a large one."""
    shrink_pi05()
    return served.create(options)


def batch(name: str, folder: str) -> None:
    """Print how far a batch of three trials is from the three alone, and from another seed."""
    if name == "pi05":
        shrink_pi05()
    policy = served.create(options(name, folder))
    seen = []
    for session in range(3):
        seen.append(synthetic_observation(policy.spec, seed=session))
        seen[-1]["instruction"] = f"{WORDS} {session}"
        policy.reset_session(session, trial(session))
        policy.reset_session(session + 3, trial(session + 100))
    together = policy.infer_batch(seen, [0, 1, 2])
    alone = [policy.infer_batch([one], [i])[0] for i, one in enumerate(seen)]
    other = [policy.infer_batch([one], [i + 3])[0] for i, one in enumerate(seen)]

    def apart(a: Any, b: Any) -> float:
        return float(max(np.abs(x - y).max() for x, y in zip(a, b, strict=True)))

    again = [policy.infer_batch([one], [i])[0] for i, one in enumerate(seen)]
    report = {
        "batch_against_singles": apart(together, alone),
        "repeated": apart(alone, again),
        "another_seed": apart(alone, other),
        "shape": list(together[0].shape),
        "finite": bool(all(np.isfinite(chunk).all() for chunk in together)),
    }
    print(json.dumps(report))


def prompt(name: str, folder: str) -> None:
    """Print the count of state numbers in pi0.5's prompt for each option, and the last prompt."""
    shrink_pi05()
    counts: dict[str, Any] = {}
    for width in (None, 14, 32):
        policy = served.create(replace(options(name, folder), state_prompt=width))
        policy.reset(trial(0))
        seen = synthetic_observation(policy.spec)
        seen["state"] = np.linspace(-1, 0.99, 14, dtype=np.float32)
        policy.infer(seen)
        batch = policy._batch([Query(seen, trial(0), 0)], None)
        transition = policy.before.to_transition(batch)
        for step in policy.before.steps:
            transition = step(transition)
            if type(step).__name__ == served.STATE_STEP:
                break
        text = transition["complementary_data"]["task"][0]
        numbers = text.partition("State: ")[2].partition(";")[0].split()
        counts[str(width)] = len(numbers)
    print(json.dumps({**counts, "text": text}))


DRAWS: dict[str, Callable[[int], Any]] = {
    "randn": lambda n: torch.randn(n, 3),
    "randn_of_a_tuple": lambda n: torch.randn((n, 3), dtype=torch.bfloat16),
    "randn_by_name": lambda n: torch.randn(size=(n, 3), generator=None),
    "rand": lambda n: torch.rand(n, 3),
    "randn_like": lambda n: torch.randn_like(torch.zeros(n, 3)),
    "rand_like": lambda n: torch.rand_like(torch.zeros(n, 3)),
    "normal": lambda n: torch.normal(mean=1.0, std=2.0, size=(n, 3), dtype=torch.float32),
    "normal_": lambda n: torch.empty(n, 3).normal_(1.0, 2.0),
    "normal_by_name": lambda n: torch.empty(n, 3).normal_(std=2.0),
    "uniform_": lambda n: torch.empty(n, 3).uniform_(-2.0, 2.0),
}
"""Draws of n rows, as models make them."""


def noise() -> None:
    """Print, for each draw, whether two rows are those of two single calls and no other's."""

    def drawn(draw: Callable[[int], Any], *seeds: int) -> Any:
        with seeded_rows(seeds):
            return draw(len(seeds))

    right = {}
    for name, draw in DRAWS.items():
        both, one, two = drawn(draw, 5, 6), drawn(draw, 5), drawn(draw, 6)
        same = torch.equal(both[:1], one) and torch.equal(both[1:], two)
        right[name] = same and not torch.equal(one, two)
    try:
        drawn(lambda n: torch.randperm(7), 5, 6)
        right["others_refused"] = False
    except NotByRow:
        right["others_refused"] = True
    print(json.dumps(right))


def trial(policy_seed: int) -> TrialInfo:
    """A trial of that policy seed."""
    return TrialInfo("t", "aloha-agilex", WORDS, policy_seed)


if __name__ == "__main__":
    what, *rest = sys.argv[1:]
    {"make": make, "batch": batch, "prompt": prompt, "noise": noise}[what](*rest)  # type: ignore[operator]
