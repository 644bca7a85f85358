"""Hold still: sends the commanded joints back. What a policy that does nothing scores."""

import numpy as np
from numpy.typing import NDArray

from robospa.observation import Observation
from robospa.protocol.policy import PolicySpec, TrialInfo

CHUNK = 10


class Hold:
    """Never moves. Needs no image."""

    spec = PolicySpec(
        name="hold",
        cameras=(),
        state="commanded",
        horizon=CHUNK,
        seeded=True,
        checkpoint="no weights",
    )

    def reset(self, trial: TrialInfo) -> None:
        """Nothing to prepare."""

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        """The present command, float32 (CHUNK, D)."""
        state = np.asarray(observation["state"], dtype=np.float32)
        return np.tile(state, (CHUNK, 1))
