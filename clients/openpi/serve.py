"""openpi's policy in this process: noise from our seeds, and its conventions can be looked at.

Its own server (`scripts/serve_policy.py`, reached by `openpi://`) needs none of this. Here a
configuration whose `adapt_to_pi` is on is refused: it turns joints and grippers of another robot
into ours silently, which is invisible on the wire.

    robospa serve openpi --option config=pi05_robotwin --option checkpoint=...
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robospa.action_space import ActionSpace
from robospa.clients.chunks import STATE_TOKENS, RobotOption, check_horizon
from robospa.clients.model_policy import Chunk, ModelPolicy, Query, describe_checkpoint, import_code
from robospa.clients.openpi.finetune import CAMERAS, NAME, SOURCES, register
from robospa.protocol.options import option
from robospa.protocol.policy import PolicySpec


@dataclass(frozen=True)
class OpenPiServerOptions(RobotOption):
    """How the policy is loaded."""

    config: str = option(
        "", "name of the training configuration in openpi, or pi05_robospa_NAME of our datasets"
    )
    checkpoint: str = option("", "its folder (or gs:// address)")
    code: str | None = option(None, "folder with openpi's sources, if it is not installed")
    adapt_to_pi: str = option(
        "refuse",
        "`refuse` a configuration with adapt_to_pi on, or `accept` it",
        ("refuse", "accept"),
    )
    batch: int = option(8, "observations in one call, where the class has infer_batch")
    execute: int | None = option(None, "actions executed before the next query; none for all")

    def __post_init__(self) -> None:
        """ValueError for options that cannot be."""
        if not self.config or not self.checkpoint:
            raise ValueError("options config and checkpoint are needed")
        if self.batch < 1:
            raise ValueError(f"option batch={self.batch}: at least 1")


class OpenPi(ModelPolicy):
    """A policy of openpi's `create_trained_policy`."""

    def __init__(
        self,
        policy: Any,
        horizon: int,
        width: int,
        options: OpenPiServerOptions,
        text_budget: int | None = None,
    ) -> None:
        """`horizon` and `width`: the shape of the model's noise."""
        super().__init__()
        check_horizon(horizon, options.execute)
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
            checkpoint=describe_checkpoint(options.checkpoint),
        )

    def predict(self, queries: Sequence[Query]) -> list[Chunk]:
        """One chunk (T, 14) of absolute joint targets per query."""
        inputs = [_observation(query) for query in queries]
        noise = [self._noise(query.seed) for query in queries]
        if self.batches and len(queries) > 1:
            answer = self.policy.infer_batch(inputs, noise=np.stack(noise))["actions"]
            return [np.array(chunk, np.float32) for chunk in answer]
        pairs = zip(inputs, noise, strict=True)
        return [np.array(self.policy.infer(i, noise=n)["actions"], np.float32) for i, n in pairs]

    def _noise(self, seed: int) -> Chunk:
        return np.random.default_rng(seed).standard_normal(self.shape, np.float32)


def _observation(query: Query) -> dict[str, Any]:
    """What the Aloha input transform takes: images (3, H, W), no other camera."""
    images = query.observation["images"]
    return {
        "state": np.array(query.observation["state"], np.float32),
        "images": {
            theirs: np.ascontiguousarray(images[ours].transpose(2, 0, 1))
            for theirs, ours in CAMERAS.items()
        },
        "prompt": query.observation["instruction"],
    }


def create(options: OpenPiServerOptions) -> OpenPi:
    """Load the policy. Raises ModelMissing, and ValueError for a configuration that is refused."""
    configs = import_code("openpi.training.config", options.code, SOURCES)
    loading = import_code("openpi.policies.policy_config", options.code, SOURCES)
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
    return OpenPi(policy, model.action_horizon, model.action_dim, options, tokens)
