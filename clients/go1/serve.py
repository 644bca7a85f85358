"""GO-1's official inference class in this process, with noise from our seeds.

Its own server (`evaluate/deploy.py`, reached by `go1+http://`) needs none of this; here the policy
seed of a trial decides the noise, and nothing is coded as JSON. The class takes one observation at
a time.

    PYTHONPATH=AgiBot-World robospa serve go1 --option checkpoint=... --option stats=...
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robospa.clients.model_policy import (
    Ask,
    Chunk,
    ModelPolicy,
    check_horizon,
    existing,
    import_code,
    import_torch,
)
from robospa.clients.seeded_noise import seeded_rows
from robospa.protocol.options import option
from robospa.protocol.policy import PolicySpec

VIEWS = {"top": "head", "right": "right_wrist", "left": "left_wrist"}
"""Our camera for each image of the model."""


@dataclass(frozen=True)
class Options:
    """How GO-1 is loaded and fed."""

    checkpoint: str = option("", "folder of the fine-tuned model")
    stats: str | None = option(None, "dataset_stats.json of its training run, if it normalises")
    code: str | None = option(None, "checkout of AgiBot-World, or set PYTHONPATH")
    wrists: str = option(
        "correct",
        "`swapped` shows each wrist image as the other's, as RoboTwin's client does",
        ("correct", "swapped"),
    )
    ctrl_freq: float = option(30.0, "ctrl_freq [Hz] of its training config")
    horizon: int = option(30, "actions in a chunk, at most")
    execute: int | None = option(None, "actions executed before the next query; none for all")

    def __post_init__(self) -> None:
        """ValueError for options that cannot be."""
        check_horizon(self.horizon, self.execute)
        if not self.checkpoint:
            raise ValueError("option checkpoint is needed: the folder of the fine-tuned model")
        if not 0 < self.ctrl_freq < 10_000:
            raise ValueError(f"option ctrl_freq={self.ctrl_freq:g} is no frequency in Hz")


class Go1(ModelPolicy):
    """The official class, one observation at a time."""

    def __init__(self, model: Any, options: Options) -> None:
        super().__init__()
        self.model, self.options = model, options
        self.spec = PolicySpec(
            name="go1",
            horizon=options.horizon,
            execute=options.execute,
            seeded=True,
            action_dim=14,
        )

    def predict(self, asks: Sequence[Ask]) -> list[Chunk]:
        """One chunk (T, 14) of absolute joint targets per query."""
        chunks = []
        for ask in asks:
            with seeded_rows([ask.seed]):
                answer = self.model.inference(self._payload(ask))
            chunks.append(np.array(answer, np.float32)[: self.options.horizon])
        return chunks

    def _payload(self, ask: Ask) -> dict[str, Any]:
        """What its server would have read from the wire; the class adds to it."""
        images, views = ask.observation["images"], dict(VIEWS)
        if self.options.wrists == "swapped":
            views["right"], views["left"] = views["left"], views["right"]
        payload: dict[str, Any] = {theirs: np.array(images[ours]) for theirs, ours in views.items()}
        payload["instruction"] = ask.observation["instruction"]
        payload["state"] = np.array(ask.observation["state"], np.float32)[None]
        payload["ctrl_freqs"] = np.array([self.options.ctrl_freq], np.float32)
        return payload


def create(options: Options) -> Go1:
    """Load the model. Raises ModelMissing."""
    import_torch()
    source = import_code("evaluate.deploy", options.code, "a checkout of AgiBot-World")
    stats = None if options.stats is None else existing(options.stats, "stats")
    return Go1(source.GO1Infer(existing(options.checkpoint, "checkpoint"), stats), options)
