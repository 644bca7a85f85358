"""The oracle in disguise: its motions, sent as end-effector poses or as changes of them."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.baselines.oracle import Oracle
from robospa.geometry import Pose
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.protocol.policy import TrialInfo

CHAINS = [chain_of(arm) for arm in embodiment("aloha-agilex").arms]


def tools(row: NDArray[np.float32]) -> list[tuple[Pose, float]]:
    """End-effector pose and gripper of both arms after one joint action."""
    parts = (row[:7], row[7:])
    return [
        (end_effector(chain, part[:6].tolist()), float(part[6]))
        for chain, part in zip(CHAINS, parts, strict=True)
    ]


class Disguised:
    """The oracle, answering end-effector poses or changes of them."""

    def __init__(self, space: str) -> None:
        self._oracle = Oracle()
        self.spec = replace(self._oracle.spec, action=space)
        self._last: list[tuple[Pose, float]] = []

    def reset(self, trial: TrialInfo) -> None:
        self._oracle.reset(trial)
        self._last = tools(np.zeros(14, np.float32))

    def infer(self, observation: dict[str, Any]) -> NDArray[np.float32]:
        rows = []
        for row in self._oracle.infer(observation):
            now = tools(row)
            numbers: list[float] = []
            for (pose, gripper), (before, _) in zip(now, self._last, strict=True):
                sent = pose if self.spec.action == "ee" else before.inverse() * pose
                numbers += [*sent.position, *sent.rotation, gripper]
            self._last = now
            rows.append(numbers)
        return np.array(rows, np.float32)
