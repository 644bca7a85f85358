"""Gymnasium's spaces of what a policy reads and answers."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.robots.kinematics import chain_of
from robospa.harness.settings import SettingsError
from robospa.protocol.policy import PolicySpec

SENTENCE = 1000
"""Most characters of an instruction."""
LETTERS = "".join(map(chr, range(32, 127)))
"""What instructions are written in: printable ASCII."""
BEYOND = 0.5
"""How far [rad], or of a gripper's unit, a measured joint may be beyond its limit."""
FARTHEST = 3.0
"""[m] No end effector is that far from the world's origin."""

Bounds = tuple[NDArray[np.float32], NDArray[np.float32]]


def check_spec(spec: PolicySpec) -> None:
    """SettingsError for what an environment cannot give."""
    if spec.history:
        raise SettingsError(
            "an environment gives no history: stack its observations with Gymnasium's wrappers"
        )
    if spec.privileged:
        raise SettingsError(
            "an environment gives no privileged state: ask for environment_state, which is numbers"
        )


def action_space(robot: Embodiment, kind: str) -> spaces.Box:
    """Of one action, float32 (D,): joints within the limits in which the robot's own kinematics
    looks, positions [m] over the table, quaternions, grippers from 0 (closed) to 1 (open).

    It is what is sampled from. What lies outside is executed too, as a policy's would be.
    """
    space = robot.action_space(kind)
    low, high = _joint_bounds(robot, space) if kind == "joint" else _pose_bounds(space)
    return spaces.Box(low, high, dtype=np.float32)


def _joint_bounds(robot: Embodiment, space: ActionSpace) -> Bounds:
    low, high = np.zeros(space.width, np.float32), np.ones(space.width, np.float32)
    for columns, arm in zip(space.arms, robot.arms, strict=True):
        chain = chain_of(arm)
        low[columns.body], high[columns.body] = chain.working_lower, chain.working_upper
    return low, high


def _pose_bounds(space: ActionSpace) -> Bounds:
    low, high = np.zeros(space.width, np.float32), np.ones(space.width, np.float32)
    reach = 0.05 if space.kind == "delta_ee" else 1.0
    for columns in space.arms:
        low[columns.position], high[columns.position] = -reach, reach
        low[columns.quaternion], high[columns.quaternion] = -1.0, 1.0
        if space.kind == "ee":
            low[columns.position][2], high[columns.position][2] = 0.7, 1.2
    return low, high


def observation_space(spec: PolicySpec, robot: Embodiment, limit: int) -> spaces.Dict:
    """Of an observation (`robospa.Observation`) as `spec` asks for it; `limit` is the number of
    actions that a trial may have."""
    parts: dict[str, spaces.Space[object]] = {}
    if spec.cameras:
        parts["images"] = spaces.Dict(
            {
                camera.name: spaces.Box(0, 255, (camera.height, camera.width, 3), np.uint8)
                for camera in spec.cameras
            }
        )
    if spec.state != "none":
        low, high = _state_bounds(robot)
        parts["state"] = spaces.Box(low, high, dtype=np.float32)
    parts["ee"] = _ee_space()
    if spec.environment_state:
        from robospa.observation import WIDTH

        parts["environment_state"] = spaces.Box(-np.inf, np.inf, (WIDTH,), np.float32)
    parts["instruction"] = spaces.Text(SENTENCE, charset=LETTERS)
    parts["step"] = spaces.Discrete(limit + 1)
    return spaces.Dict(parts)


def _state_bounds(robot: Embodiment) -> Bounds:
    space = robot.action_space("joint")
    low, high = np.zeros(space.width, np.float32), np.ones(space.width, np.float32)
    for columns, arm in zip(space.arms, robot.arms, strict=True):
        chain = chain_of(arm)
        low[columns.body], high[columns.body] = chain.lower, chain.upper
    return low - np.float32(BEYOND), high + np.float32(BEYOND)


def _ee_space() -> spaces.Box:
    """Per arm x y z [m], qw qx qy qz, gripper."""
    high = np.ones((2, 8), np.float32) * 1.01
    high[:, :3], high[:, 7] = FARTHEST, 1.0 + BEYOND
    low = -high
    low[:, 7] = -BEYOND
    return spaces.Box(low, high, dtype=np.float32)
