"""From a policy's numbers to joint targets: lengths, finiteness, limits, inverse kinematics.

What a policy sends is checked here, before anything moves. A wrong length or a number that is not
finite refuses the whole action (`ActionError`); a joint beyond its limit or a gripper outside 0..1
is clipped, as the drive would stop there; a pose out of reach leaves that arm where it is and is
reported in `JointTargets.problems`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robospa.action_space import KINDS, ActionSpace, ArmColumns
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

Array = NDArray[np.float64]

QUATERNION_TOLERANCE = 0.1
"""A quaternion's length may be off by this much: networks do not normalise."""
REFINEMENTS = 2
DAMPING = 1e-6


@dataclass(frozen=True)
class JointTargets:
    """`joints` (2, J) [rad], `gripper` (2,) in 0..1; `problems` names poses out of reach."""

    joints: Array
    gripper: Array
    problems: tuple[str, ...] = ()


class ActionDecoder:
    """Decodes the actions of one embodiment. Holds its kinematics, no state of a trial."""

    def __init__(self, embodiment: Embodiment) -> None:
        self.embodiment = embodiment
        self.chains: tuple[Chain, ...] = tuple(chain_of(arm) for arm in embodiment.arms)
        self._spaces = {kind: embodiment.action_space(kind) for kind in KINDS}
        # The arm with fewer joints has zeros in the columns that it lacks: limits 0 give 0.
        joints = self._spaces["joint"]
        self._columns = np.zeros((2, max(joints.joints)), dtype=int)
        self._lower, self._upper = np.zeros((2, *self._columns.shape))
        for a, (arm, chain) in enumerate(zip(joints.arms, self.chains, strict=True)):
            count = joints.joints[a]
            self._columns[a, :count] = np.arange(arm.body.start, arm.body.stop)
            self._lower[a, :count], self._upper[a, :count] = chain.lower, chain.upper

    def check(self, action: ArrayLike, kind: str) -> tuple[Array, ActionSpace]:
        """`action` as float64 (D,), and its columns.

        Raises ActionError, which names the first number that cannot be executed.
        """
        space = self._spaces.get(kind)
        if space is None:
            raise ActionError(f"no action space {kind!r}; there are joint, ee and delta_ee")
        try:
            values = np.asarray(action, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ActionError(f"the action is not an array of numbers: {error}") from None
        if values.shape != (space.width,):
            raise ActionError(
                f"a {kind} action of {self.embodiment.name} has shape ({space.width},), "
                f"got {values.shape}"
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            name = space.labels[int(bad[0])]
            raise ActionError(
                f"{name} (index {int(bad[0])} of the {kind} action) is {values[bad[0]]}"
            )
        return values, space

    def decode(self, action: ArrayLike, kind: str, commanded: Array) -> JointTargets:
        """Joint targets of `action`, given the commanded joints (2, J) at which it starts.

        J is the joint count of the arm that has more; the other's row ends in zeros.

        `ee` and `delta_ee` start from the *commanded* posture, so that an identity `delta_ee` is no
        motion at all and an arm pressed against something does not creep.
        """
        values, space = self.check(action, kind)
        gripper = np.clip(values[space.grippers], 0.0, 1.0)
        if kind == "joint":
            return JointTargets(np.clip(values[self._columns], self._lower, self._upper), gripper)
        joints, problems = commanded.copy(), []
        for a, (arm, chain) in enumerate(zip(space.arms, self.chains, strict=True)):
            now = commanded[a, : space.joints[a]]
            target = self._target(values, arm, kind, chain, now)
            found, reached = inverse(chain, [target], near=now)
            if not reached[0]:
                found, reached = inverse(chain, [target])
            if reached[0]:
                joints[a, : space.joints[a]] = refined(chain, found[0], target)
            else:
                problems.append(f"the {arm.name} arm cannot reach {_describe(target)} and holds")
        return JointTargets(joints, gripper, tuple(problems))

    def _target(
        self, values: Array, arm: ArmColumns, kind: str, chain: Chain, commanded: Array
    ) -> Pose:
        """World pose that one arm's numbers ask for; ActionError for a null quaternion."""
        quaternion = values[arm.quaternion]
        length = float(np.linalg.norm(quaternion))
        if abs(length - 1.0) > QUATERNION_TOLERANCE:
            raise ActionError(
                f"the {arm.name} quaternion (w, x, y, z) of the {kind} action has length "
                f"{length:.3g}; it must be 1"
            )
        x, y, z = (float(v) for v in values[arm.position])
        w, i, j, k = (float(v) / length for v in quaternion)
        pose = Pose((x, y, z), (w, i, j, k))
        if kind == "ee":
            return pose
        return end_effector(chain, [float(v) for v in commanded]) * pose


def refined(chain: Chain, joints: Array, target: Pose) -> Array:
    """`joints` (J,) that almost reach `target`, brought onto it by REFINEMENTS Gauss-Newton steps.

    Inverse kinematics stops within half a millimetre, which would swallow small `delta_ee` actions.
    """
    goal = to_transform(target)
    for _ in range(REFINEMENTS):
        frames, jacobians = forward(chain, joints[None])
        frame, jacobian = frames[0], jacobians[0]
        turn = goal[:3, :3] @ frame[:3, :3].T
        error = np.concatenate([goal[:3, 3] - frame[:3, 3], turning_vector(turn) / 2])
        square = jacobian.T @ jacobian + DAMPING * np.eye(len(joints))
        step = np.linalg.solve(square, jacobian.T @ error)
        joints = np.clip(joints + step, chain.lower, chain.upper)
    return joints


def _describe(pose: Pose) -> str:
    """A pose for a message."""
    place = ", ".join(f"{v:.3f}" for v in pose.position)
    turn = ", ".join(f"{v:.2f}" for v in pose.rotation)
    return f"position ({place}) with rotation ({turn})"
