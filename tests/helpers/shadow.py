"""Policies that are not privileged and can yet do something: they rehearse in a world of their own.

`Shadow` stands for a model with some success: the test says which trial has which id. `Thief` is
the cheat that a leaderboard has to stop: it knows the installed package and what `reset` gives.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from robospa.baselines.oracle import Oracle
from robospa.harness.running.record_store import ActionRecorder
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import policy_seed, run_trial, task_parts, trial_id
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.tasks.seeds import accepted
from robospa.trial import TrialKey

HORIZON = 50
TOLD = {"task", "embodiment", "instruction", "policy_seed", "id", "key", "extra", "joints"}


def ids(keys: list[TrialKey], salt: str = "") -> dict[str, tuple[TrialKey, str]]:
    """What only a test knows: the trial behind each id."""
    return {trial_id(key, 0, salt): (key, salt) for key in keys}


class Shadow:
    """Sends what the expert does in a private world."""

    spec = PolicySpec(
        name="shadow", cameras=(), state="commanded", action="joint", horizon=HORIZON, seeded=True
    )

    def __init__(self, known: Mapping[str, tuple[TrialKey, str]] | None = None) -> None:
        self._known = known or {}
        self._world = SapienWorld(render=False)
        self._actions = np.zeros((0, 14), np.float32)

    def found(self, trial: TrialInfo) -> tuple[TrialKey, str] | None:
        """Which trial this is, with its salt; None for standing still."""
        return self._known[trial.id]

    def reset(self, trial: TrialInfo) -> None:
        recorder, found = ActionRecorder(), self.found(trial)
        if found is not None:
            key, salt = found
            parts = partial(task_parts, salt=salt)
            expert = Oracle(salt)
            run_trial(self._world, expert, key, policy_seed=0, recorder=recorder, parts=parts)
        self._actions = recorder.actions

    def infer(self, observation: Any) -> Any:
        chunk = self._actions[int(observation["step"]) :][:HORIZON]
        return chunk if len(chunk) else np.asarray(observation["state"], np.float32)[None]


class Thief(Shadow):
    """Tries every public key of the task, and takes the one whose policy seed it was given."""

    def found(self, trial: TrialInfo) -> tuple[TrialKey, str] | None:
        assert trial.key is None and vars(trial).keys() <= TOLD
        for level in range(1, 6):
            for seed in accepted(trial.task, level):
                key = TrialKey(trial.task, level, seed)
                if policy_seed(key) == trial.policy_seed:
                    return key, ""
        return None
