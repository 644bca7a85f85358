"""A policy server in thirty lines: replace the body of `infer` by your model.

python docs/examples/my_policy.py
robospa eval ws://127.0.0.1:8000 --tasks Pick_Blocks_Size --levels 1 --trials 5 --out runs/mine
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robospa import CameraSpec, Observation, PolicySpec, TrialInfo, serve


class MyPolicy:
    """Holds the arms where they are and nods with the grippers. One object a connection."""

    spec = PolicySpec(
        name="my-policy",
        cameras=(CameraSpec("head", 224, 224),),  # also left_wrist, right_wrist, front, third
        action="joint",  # left arm 6, left gripper, right arm 6, right gripper
        horizon=8,  # at most 8 actions a chunk
        checkpoint="no weights",  # else a text that changes with them: a revision, a hash
    )

    def reset(self, trial: TrialInfo) -> None:
        """A new trial begins: forget the last one, prepare for `trial.instruction`."""
        self.random = np.random.default_rng(trial.policy_seed)

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        """From images, state and instruction to a chunk: float32 (T, 14), T <= horizon."""
        image = observation["images"]["head"]  # uint8 (224, 224, 3), RGB
        assert image.shape == (224, 224, 3)
        chunk = np.tile(observation["state"], (8, 1))
        chunk[:, [6, 13]] = self.random.uniform(0.5, 1.0, (8, 2))
        return chunk.astype(np.float32)


if __name__ == "__main__":
    serve(policy_factory=MyPolicy, host="127.0.0.1", port=8000, on_ready=print)
