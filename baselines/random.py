"""Random walk of both arms: the floor that a task's success criterion must not reach by chance.

Repeatable: the walk of a trial follows from its policy seed and the step alone.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.baselines.hold import CHUNK, Hold
from robospa.observation import Observation
from robospa.protocol.policy import TrialInfo

STRIDE = 0.15
"""Standard deviation of one action's joint change [rad]."""


class Random:
    """Walks from where the arms are; grippers open and close at random. Needs no image."""

    spec = replace(Hold.spec, name="random")

    def __init__(self) -> None:
        self._seed, self._grippers = 0, ActionSpace("joint").grippers

    def reset(self, trial: TrialInfo) -> None:
        """Start the walk of this trial."""
        self._seed = trial.policy_seed
        self._grippers = ActionSpace("joint", trial.joints).grippers

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        """The next stretch of the walk, float32 (CHUNK, D)."""
        generator = np.random.default_rng([self._seed, int(observation["step"])])
        state = np.asarray(observation["state"], dtype=np.float32)
        strides = generator.normal(0.0, STRIDE, (CHUNK, len(state)))
        walk = state + np.cumsum(strides, axis=0)
        walk[:, self._grippers] = generator.uniform(0.0, 1.0, (CHUNK, 2))
        return walk.astype(np.float32)
