"""Policies that are not privileged and can yet do something: they rehearse in a world of their own.

`Shadow` stands for a model with some success: the test says which trial has which id. `Thief` is
the cheat that a leaderboard has to stop: it knows the installed package, what `reset` gives
and the seed of the run, which its owner read from the run's folder.
"""

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
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
TOLD_SEED = "ab" * 32
"""The seed of runs whose policies were told it."""
TOLD = {"task", "embodiment", "instruction", "policy_seed", "id", "key", "extra", "joints"}


def ids(keys: list[TrialKey], salt: str = "") -> dict[str, tuple[TrialKey, str]]:
    """What only a test knows: the trial behind each id."""
    return {trial_id(key, TOLD_SEED): (key, salt) for key in keys}


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
                if policy_seed(key, TOLD_SEED) == trial.policy_seed:
                    return key, ""
        return None


class Shy(Thief):
    """The same, on a detour of its own, and still where the sentence is not the scene's."""

    def found(self, trial: TrialInfo) -> tuple[TrialKey, str] | None:
        found = super().found(trial)
        return found if found and task_parts(found[0]).instruction == trial.instruction else None

    def reset(self, trial: TrialInfo) -> None:
        super().reset(trial)
        random, rows = np.random.default_rng(trial.policy_seed), list(self._actions[:1])
        for here, there in pairwise(self._actions):
            if np.abs(there - here).max() > 0.3:
                detour = (here + there) / 2 + random.normal(0, 0.12, len(here))
                detour[[6, 13]] = here[[6, 13]]
                rows.append(detour.astype(np.float32))
            rows.append(there)
        self._actions = np.array(rows) if rows else self._actions
