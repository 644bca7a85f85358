"""What the soak evaluates: trials of 50 to 300 ms that sleep more than they compute, a stochastic
policy whose answers follow from its seed, and a world that gets stuck in native code when told to.
"""

import ctypes
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from run_fakes import FakePolicy, FakeWorld

from robospa.harness.world import Poll, StepResult
from robospa.protocol.policy import TrialInfo

STUCK = "SOAK_STUCK"
"""Names the file whose removal, by the first world that sees it, makes that world get stuck."""


def stuck_in_native_code() -> None:
    """Sleep for an hour without letting any other Python thread run."""
    ctypes.PyDLL(None).sleep(3600)


class SoakWorld(FakeWorld):
    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        time.sleep(0.008 + 0.002 * (self.seed % 9))
        if mark := os.environ.get(STUCK):
            try:
                Path(mark).unlink()
            except FileNotFoundError:
                pass
            else:
                stuck_in_native_code()
        return super().step(action, space, poll)


class SoakPolicy(FakePolicy):
    """Stochastic; at some seeds it answers nonsense, at others it gives up."""

    def reset(self, trial: TrialInfo) -> None:
        super().reset(trial)
        self.random = np.random.default_rng(trial.policy_seed)

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        assert self.trial is not None
        chunk = self.random.uniform(0.2, 1.4, (3, 14)).astype(np.float32)
        if self.last_digit == 7 and observation["step"] >= 6:
            chunk[1, 1] = 99
        return chunk if self.last_digit != 8 else 0.1 * chunk
