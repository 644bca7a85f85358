"""A model with options, loaded once and shared by all connections.

robospa serve my_model:create --option checkpoint=weights.npz --option rows=16
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robospa.clients.model_policy import Chunk, ModelPolicy, Query
from robospa.observation import CameraSpec
from robospa.protocol.options import option
from robospa.protocol.policy import PolicySpec


@dataclass(frozen=True)
class Options:
    """What `robospa serve my_model:create --show-options` lists."""

    checkpoint: str = option("", "the weights, an .npz with `mean` (14,)")
    rows: int = option(16, "actions in a chunk")


class MyModel(ModelPolicy):
    """Trials of several connections may come in one call."""

    def __init__(self, mean: Chunk, rows: int) -> None:
        super().__init__()
        self.mean, self.rows = mean, rows
        self.spec = PolicySpec(
            "my-model", cameras=(CameraSpec("head"),), horizon=rows, batch=8, seeded=True
        )

    def predict(self, queries: Sequence[Query]) -> list[Chunk]:
        """One chunk per query; `query.seed` follows from the trial's policy seed and its step."""
        generators = [np.random.default_rng(query.seed) for query in queries]
        noise = [generator.normal(0, 0.02, (self.rows, 14)) for generator in generators]
        return [(self.mean + one).astype(np.float32) for one in noise]


def create(options: Options) -> MyModel:
    """Load the weights: called once, before anybody connects."""
    with np.load(options.checkpoint) as data:
        return MyModel(data["mean"], options.rows)
