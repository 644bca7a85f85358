"""Run a trial again from its recorded actions, without the model.

The world decides everything else, so a repeatable world gives the same record. Refuses nothing by
itself: what differs is for the caller to judge.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from robospa.harness.trial import Recorder, TrialParts, run_trial, task_parts
from robospa.harness.world import World
from robospa.observation import Observation
from robospa.protocol.errors import PolicyAnswerError
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

CHUNK = 1000


class Recorded:
    """A policy that sends recorded `actions`, float32 (T, D), of the action `space`; then it has
    nothing more to say, which counts as an answer that cannot be executed."""

    def __init__(self, actions: NDArray[np.float32], space: str) -> None:
        self._actions = actions
        self.spec = PolicySpec(
            name="recorded", cameras=(), state="none", action=space, horizon=CHUNK, seeded=True
        )

    def reset(self, trial: TrialInfo) -> None:
        """Nothing depends on the trial."""

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        """The recorded actions from this step on; PolicyAnswerError after the last."""
        chunk = self._actions[int(observation["step"]) :][:CHUNK]
        if not len(chunk):
            raise PolicyAnswerError("the recorded actions end here")
        return chunk


def rerun(
    world: World,
    key: TrialKey,
    actions: NDArray[np.float32],
    space: str,
    *,
    policy_seed: int = 0,
    recorder: Recorder | None = None,
    parts: Callable[[TrialKey], TrialParts] = task_parts,
) -> TrialRecord:
    """The record that `actions` give on `key` in `world`."""
    policy = Recorded(actions, space)
    return run_trial(world, policy, key, policy_seed=policy_seed, recorder=recorder, parts=parts)
