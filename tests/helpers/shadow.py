"""A policy that is no privileged one and can yet do something: it rehearses in a world of its own.

What it knows it has from the trial's key, so it serves where a model with some success is wanted.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robospa.baselines.oracle import Oracle
from robospa.harness.pictures.video import TrialRecorder
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import run_trial
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.trial import TrialKey

HORIZON = 50


class Shadow:
    """Sends what the expert does in a private world; with `clumsy`, stands still instead."""

    spec = PolicySpec(
        name="shadow", cameras=(), state="commanded", action="joint", horizon=HORIZON, seeded=True
    )

    def __init__(self, clumsy: bool = False) -> None:
        self.clumsy = clumsy
        self._world = SapienWorld(render=False)
        self._actions = np.zeros((0, 14), np.float32)

    def reset(self, trial: TrialInfo) -> None:
        key = TrialKey(trial.task, trial.level, trial.seed)
        recorder = TrialRecorder()
        if not self.clumsy:
            run_trial(self._world, Oracle(), key, policy_seed=0, recorder=recorder)
        self._actions = recorder.actions

    def infer(self, observation: Any) -> Any:
        chunk = self._actions[int(observation["step"]) :][:HORIZON]
        return chunk if len(chunk) else np.asarray(observation["state"], np.float32)[None]
