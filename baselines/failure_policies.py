"""Policies that fail on purpose, each in one known way: what the failure analysis is measured on.

They are the oracle with another plan (`robospa.harness.demonstrations.changed_plans`).

    robospa serve mistakes --arg kind=neighbour
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robospa.baselines.oracle import Oracle
from robospa.harness.demonstrations.changed_plans import KINDS, ChangedExpert, wrong_plan
from robospa.harness.robots import embodiment
from robospa.observation import Observation
from robospa.tasks.snapshot import snapshot_from_json


class FailingOracle(Oracle):
    """Makes one mistake, the same one in every trial; where a task has no occasion, it holds."""

    def __init__(self, kind: str) -> None:
        super().__init__()
        if kind not in KINDS:
            raise ValueError(f"no mistake {kind!r}; there are {', '.join(KINDS)}")
        self.kind = kind
        self.spec = replace(Oracle.spec, name=f"mistakes:{kind}")
        self.applies = True

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        """The next actions, float32 (T, D)."""
        if self._scene is None:
            raise RuntimeError("the policy was asked for actions before a reset")
        snapshot = snapshot_from_json(
            observation["privileged"], embodiment(self._scene.embodiment).grippers
        )
        if self._expert is None:
            expert = ChangedExpert(self._scene, snapshot, ())
            try:
                plan = wrong_plan(self.kind, self._scene, expert.workspace)
                self.applies = True
            except ValueError:
                plan, self.applies = (), False
            self._expert = ChangedExpert(self._scene, snapshot, plan)
        return self._expert.next(snapshot)


def create(kind: str = "neighbour") -> FailingOracle:
    """A new policy that makes the mistake `kind`, one per connection."""
    return FailingOracle(kind)
