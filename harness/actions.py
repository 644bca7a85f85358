"""From a policy's numbers to joint goals: lengths, finiteness, limits, inverse kinematics.

What a policy sends is checked here, before anything moves. A wrong length or a number that is not
finite refuses the whole action (`ActionError`); a joint beyond its limit or a gripper outside 0..1
is clipped, as the drive would stop there; a pose out of reach leaves that arm where it is and is
reported in `Goals.problems`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robospa.geometry import Pose, to_transform
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.robots.kinematics import (
    Chain,
    chain_of,
    end_effector,
    forward,
    inverse,
)
from robospa.harness.world import ActionError
from robospa.rotations import turning_vector
from robospa.tasks.snapshot import ARMS

Array = NDArray[np.float64]

POSE_WIDTH = 8  # x y z, qw qx qy qz, gripper
QUATERNION_TOLERANCE = 0.1
"""A quaternion's length may be off by this much: networks do not normalise."""
POLISH = 2
POLISH_DAMPING = 1e-6


@dataclass(frozen=True)
class Goals:
    """`joints` (2, J) [rad], `gripper` (2,) in 0..1, and what could not be done as asked."""

    joints: Array
    gripper: Array
    problems: tuple[str, ...] = ()


def action_width(embodiment: Embodiment, space: str) -> int:
    """Length of an action of `space`; ActionError for a space that does not exist."""
    if space == "joint":
        return embodiment.action_dim
    if space in ("ee", "delta_ee"):
        return POSE_WIDTH * len(embodiment.arms)
    raise ActionError(f"no action space {space!r}; there are joint, ee and delta_ee")


def labels(embodiment: Embodiment, space: str) -> list[str]:
    """What every number of an action means: "left joint 3", "right qw", "left gripper"."""
    names: list[str] = []
    for arm, spec in zip(ARMS, embodiment.arms, strict=True):
        if space == "joint":
            names += [f"{arm} joint {i + 1}" for i in range(len(spec.joints))]
        else:
            names += [f"{arm} {part}" for part in ("x", "y", "z", "qw", "qx", "qy", "qz")]
        names.append(f"{arm} gripper")
    return names


class ActionReader:
    """Reads the actions of one embodiment. Holds its kinematics, no state of a trial."""

    def __init__(self, embodiment: Embodiment) -> None:
        self.embodiment = embodiment
        self.chains: tuple[Chain, ...] = tuple(chain_of(arm) for arm in embodiment.arms)
        self._lower = np.stack([chain.lower for chain in self.chains])
        self._upper = np.stack([chain.upper for chain in self.chains])
        self._width = len(embodiment.arms[0].joints)

    def check(self, action: ArrayLike, space: str) -> Array:
        """`action` as float64 (D,); ActionError names the first number that cannot be executed."""
        width = action_width(self.embodiment, space)
        try:
            values = np.asarray(action, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ActionError(f"the action is not an array of numbers: {error}") from None
        if values.shape != (width,):
            raise ActionError(
                f"a {space} action of {self.embodiment.name} has shape ({width},), "
                f"got {values.shape}"
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            name = labels(self.embodiment, space)[int(bad[0])]
            raise ActionError(
                f"{name} (index {int(bad[0])} of the {space} action) is {values[bad[0]]}"
            )
        return values

    def goals(self, action: ArrayLike, space: str, commanded: Array) -> Goals:
        """Joint goals of `action`, given the commanded joints (2, J) at which it starts.

        `ee` and `delta_ee` start from the *commanded* posture, so that an identity `delta_ee` is no
        motion at all and an arm pressed against something does not creep.
        """
        values = self.check(action, space)
        if space == "joint":
            table = values.reshape(2, self._width + 1)
            joints = np.clip(table[:, : self._width], self._lower, self._upper)
            return Goals(joints, np.clip(table[:, self._width], 0.0, 1.0))
        table = values.reshape(2, POSE_WIDTH)
        joints, problems = commanded.copy(), []
        for a, row in enumerate(table):
            target = self._target(row, space, a, commanded[a])
            found, reached = inverse(self.chains[a], [target], near=commanded[a])
            if not reached[0]:
                found, reached = inverse(self.chains[a], [target])
            if reached[0]:
                joints[a] = polished(self.chains[a], found[0], target)
            else:
                problems.append(f"the {ARMS[a]} arm cannot reach {_describe(target)} and holds")
        return Goals(joints, np.clip(table[:, 7], 0.0, 1.0), tuple(problems))

    def _target(self, row: Array, space: str, arm: int, commanded: Sequence[float] | Array) -> Pose:
        """World pose that one arm's eight numbers ask for; ActionError for a null quaternion."""
        length = float(np.linalg.norm(row[3:7]))
        if abs(length - 1.0) > QUATERNION_TOLERANCE:
            raise ActionError(
                f"the {ARMS[arm]} quaternion (w, x, y, z) of the {space} action has length "
                f"{length:.3g}; it must be 1"
            )
        x, y, z = (float(v) for v in row[:3])
        w, i, j, k = (float(v) / length for v in row[3:7])
        pose = Pose((x, y, z), (w, i, j, k))
        if space == "ee":
            return pose
        return end_effector(self.chains[arm], [float(v) for v in commanded]) * pose


def polished(chain: Chain, joints: Array, target: Pose) -> Array:
    """`joints` (J,) that almost reach `target`, brought onto it by POLISH Gauss-Newton steps.

    Inverse kinematics stops within half a millimetre, which would swallow small `delta_ee` actions.
    """
    wanted = to_transform(target)
    for _ in range(POLISH):
        frames, jacobians = forward(chain, joints[None])
        frame, jacobian = frames[0], jacobians[0]
        turn = wanted[:3, :3] @ frame[:3, :3].T
        error = np.concatenate([wanted[:3, 3] - frame[:3, 3], turning_vector(turn) / 2])
        square = jacobian.T @ jacobian + POLISH_DAMPING * np.eye(len(joints))
        step = np.linalg.solve(square, jacobian.T @ error)
        joints = np.clip(joints + step, chain.lower, chain.upper)
    return joints


def _describe(pose: Pose) -> str:
    """A pose for a message."""
    place = ", ".join(f"{v:.3f}" for v in pose.position)
    turn = ", ".join(f"{v:.2f}" for v in pose.rotation)
    return f"position ({place}) with rotation ({turn})"
