"""The same motions in every action space: an oracle in disguise must still solve its trial."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from unequal_arms import READY, unequal_arms

from robospa.baselines.oracle import Oracle
from robospa.geometry import Pose
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.harness.sim import sapien_world
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.tasks.catalog import build_scene
from robospa.trial import TrialKey

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


@pytest.mark.sim
@pytest.mark.parametrize("space", ["ee", "delta_ee"])
def test_an_oracle_in_disguise_solves_its_trial(space: str) -> None:
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.trial import run_trial

    key = TrialKey("Pick_Blocks_Size", 2, 7_000_000)
    record = run_trial(SapienWorld(render=False), Disguised(space), key, policy_seed=0)
    assert record.success, record.message or record.diagnostics
    assert "unreachable_actions" not in record.diagnostics


@pytest.mark.sim
def test_a_robot_whose_arms_have_different_joint_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = unequal_arms()
    monkeypatch.setattr(sapien_world, "embodiment_named", lambda name: robot)
    world = sapien_world.SapienWorld(render=False)
    world.load(build_scene("Pick_Blocks_Size", 1, 100_000))
    action = np.array([*READY, 0.25, *READY, 0.3, 0.75], np.float32)
    world.step(action, "joint", lambda snapshot: False)
    for state in ("commanded", "measured"):
        seen = world.observe(PolicySpec("test", (), state=state))
        assert seen["state"] == pytest.approx(action, abs=0.1)
    assert [len(joints) for joints in world.snapshot().joints] == [6, 7]
    world.close()
