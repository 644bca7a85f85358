"""A world in which a robot that is sent the same action again stays where it is, and a policy that
walks on from where it sees the robot."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from run_fakes import DECODER, HOME, SPEC, FakePolicy, FakeWorld

from robospa.harness.world import Poll, StepResult
from robospa.protocol.policy import PolicySpec
from robospa.tasks.scene import Scene

STRIDE = 0.5
"""What the first joint turns in an action of the walker: ten of them reach the goal of seed 4."""


class TargetWorld(FakeWorld):
    """The goal is met once the first joint is at the seed's last digit plus one."""

    def __init__(self, action_steps: int = 15) -> None:
        super().__init__()
        self.action_steps = action_steps
        self.commanded = np.zeros(14, np.float32)

    def load(self, scene: Scene, contacts: bool = False) -> None:
        super().load(scene, contacts)
        self.commanded = np.zeros(14, np.float32)

    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        goals = DECODER.decode(action, space, HOME)
        self.commanded = DECODER.joint_action(goals)
        self.total = float(self.commanded[0])
        self.steps += 1
        return StepResult(self.action_steps, poll(self.snapshot()), goals.problems)

    def observe(self, spec: PolicySpec) -> dict[str, Any]:
        seen = super().observe(spec)
        return {**seen, "state": self.commanded.copy()}

    def info(self) -> Mapping[str, Any]:
        return {"simulator": "fake", "action_steps": self.action_steps}


class Walker(FakePolicy):
    """Turns the first joint by STRIDE an action, on from where it sees it."""

    def __init__(self, length: int = 4, execute: int | None = None) -> None:
        super().__init__(replace(SPEC, horizon=length, execute=execute), length)

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        self.seen.append(dict(observation))
        rows = np.zeros((self.length, 14), np.float32)
        rows[:, 0] = observation["state"][0] + STRIDE * np.arange(1, self.length + 1)
        return rows


def walker() -> Walker:
    """For workers, which make their policy themselves."""
    return Walker()
