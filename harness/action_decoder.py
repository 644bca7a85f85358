"""From a policy's numbers to joint targets: lengths, finiteness, limits, inverse kinematics.

What a policy sends is checked here, before anything moves. A wrong length or a number that is not
finite refuses the whole action (`ActionError`). Whatever is finite is executed as far as it goes: a
joint beyond its limit or a gripper outside 0..1 is clipped, as the drive would stop there; a pose
out of reach leaves that arm where it is. `JointTargets.problems` reports it.

Equal actions give equal targets, to the bit, on every processor. Joint actions are only clipped.
Those of poses come from inverse kinematics, whose last bits differ, so what it finds is rounded to
a whole number of steps (`action_space`), brought onto the pose in fixed-order arithmetic
(`harness.robots.fixed_order`), and rounded again.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robospa.action_space import KINDS, STEPS_PER_UNIT, ActionSpace, ArmColumns, nearest, quantize
from robospa.geometry import Pose, from_matrix
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.robots.fixed_order import (
    FixedChain,
    FixedPose,
    end_frame,
    fixed_chain,
    frame_of,
    refined,
)
from robospa.harness.robots.kinematics import Chain, chain_of, inverse
from robospa.harness.world import JOINTS_FROM_EE, ActionError, ActionProblem
from robospa.results.records.action_problems import CLIPPED_GRIPPERS, CLIPPED_JOINTS, UNREACHABLE

Array = NDArray[np.float64]

QUATERNION_TOLERANCE = 0.1
"""A quaternion's length may be off by this much: networks do not normalise."""
CLIP_MARGIN = 0.05
"""Radians beyond a joint's limit, or gripper units outside 0..1, that are clipped without a report:
networks overshoot a little where an arm or a gripper is at its end."""
REFINEMENTS = 2
"""Gauss-Newton steps after inverse kinematics, which stops within half a millimetre and would
swallow small `delta_ee` actions."""
HALF_STEP = 0.5 / STEPS_PER_UNIT


@dataclass(frozen=True)
class JointTargets:
    """`joints` (2, J) [rad], `gripper` (2,) in 0..1; `problems`: what was clipped or out of reach,
    at most one of each kind for each arm."""

    joints: Array
    gripper: Array
    problems: tuple[ActionProblem, ...] = ()


class ActionDecoder:
    """Decodes the actions of one embodiment. Holds its kinematics, no state of a trial."""

    def __init__(self, embodiment: Embodiment) -> None:
        self.embodiment = embodiment
        self.chains: tuple[Chain, ...] = tuple(chain_of(arm) for arm in embodiment.arms)
        self._fixed = tuple(fixed_chain(chain) for chain in self.chains)
        self._spaces = {kind: embodiment.action_space(kind) for kind in KINDS}
        # The arm with fewer joints has zeros in the columns that it lacks: limits 0 give 0.
        joints = self._spaces[JOINTS_FROM_EE] = self._spaces["joint"]
        self._columns = np.zeros((2, max(joints.joints)), dtype=int)
        self._lower, self._upper = np.zeros((2, *self._columns.shape))
        self._real = np.zeros(self._columns.shape, dtype=bool)
        for a, (arm, chain) in enumerate(zip(joints.arms, self.chains, strict=True)):
            count = joints.joints[a]
            self._columns[a, :count] = np.arange(arm.body.start, arm.body.stop)
            self._real[a, :count] = True
            self._lower[a, :count], self._upper[a, :count] = chain.lower, chain.upper

    def joint_action(self, targets: JointTargets) -> NDArray[np.float32]:
        """The joint action (D,) that has these targets of a pose action, which are whole numbers of
        steps; so it is executed alike to the bit by any version, whatever its kinematics."""
        space = self._spaces["joint"]
        action = np.zeros(space.width, np.float32)
        for a, arm in enumerate(space.arms):
            action[arm.body] = targets.joints[a, : space.joints[a]]
            action[arm.gripper] = targets.gripper[a]
        return quantize(action)

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

        Poses are solved near the *commanded* posture, and `delta_ee` is relative to it, so that an
        identity `delta_ee` is no motion at all and an arm pressed against something does not creep.
        """
        values, space = self.check(action, kind)
        gripper = np.clip(values[space.grippers], 0.0, 1.0)
        problems = self._clipped_grippers(values, space)
        if kind in ("joint", JOINTS_FROM_EE):
            asked = np.where(self._real, values[self._columns], 0.0)
            joints = np.clip(asked, self._lower, self._upper)
            problems = self._clipped_joints(asked, joints, space) + problems
            return JointTargets(joints, gripper, tuple(problems))
        joints = commanded.copy()
        for a, arm in enumerate(space.arms):
            now = commanded[a, : space.joints[a]].tolist()
            goal = self._goal(values, arm, kind, self._fixed[a], now)
            found = reaching(self.chains[a], self._fixed[a], goal, now)
            if found is None:
                text = f"the {arm.name} arm cannot reach {_describe(goal)} and holds"
                problems.append(ActionProblem(UNREACHABLE, text))
            else:
                joints[a, : space.joints[a]] = found
        return JointTargets(joints, gripper, tuple(problems))

    def _clipped_joints(
        self, asked: Array, given: Array, space: ActionSpace
    ) -> list[ActionProblem]:
        """One problem for each arm of which a joint was `asked` (2, J) to go beyond its limits."""
        far = np.abs(asked - given) > CLIP_MARGIN
        if not far.any():
            return []
        found = []
        for a, arm in enumerate(space.arms):
            for j in np.flatnonzero(far[a])[:1].tolist():
                text = (
                    f"{space.labels[arm.body.start + j]} is asked to go to {asked[a, j]:g} rad and "
                    f"goes to its limit {given[a, j]:.2f}"
                )
                found.append(ActionProblem(CLIPPED_JOINTS, text))
        return found

    def _clipped_grippers(self, values: Array, space: ActionSpace) -> list[ActionProblem]:
        """One problem for each gripper that is far from 0..1."""
        return [
            ActionProblem(
                CLIPPED_GRIPPERS,
                f"{space.labels[column]} is {values[column]:g}, not from 0 (closed) to 1 (open)",
            )
            for column in space.grippers
            if not -CLIP_MARGIN <= values[column] <= 1.0 + CLIP_MARGIN
        ]

    def _goal(
        self, values: Array, arm: ArmColumns, kind: str, chain: FixedChain, now: list[float]
    ) -> FixedPose:
        """The world frame that one arm's numbers ask for; ActionError for a null quaternion."""
        w, i, j, k = values[arm.quaternion].tolist()
        length = math.sqrt(w * w + i * i + j * j + k * k)
        if abs(length - 1.0) > QUATERNION_TOLERANCE:
            raise ActionError(
                f"the {arm.name} quaternion (w, x, y, z) of the {kind} action has length "
                f"{length:.3g}; it must be 1"
            )
        x, y, z = values[arm.position].tolist()
        asked = frame_of(Pose((x, y, z), (w / length, i / length, j / length, k / length)))
        return asked if kind == "ee" else end_frame(chain, now) * asked


def reaching(
    chain: Chain, fixed: FixedChain, goal: FixedPose, now: list[float]
) -> tuple[float, ...] | None:
    """Joints [rad] that bring the end-effector frame to `goal`, whole numbers of steps within the
    limits; None if they cannot. A joint that moves less than half a step stays at `now`."""
    pose = Pose(goal.at, from_matrix(np.array(goal.turn)))
    found, reached = inverse(chain, [pose], near=now)
    if not reached[0]:
        found, reached = inverse(chain, [pose])
    if not reached[0]:
        return None
    start = [nearest(angle) for angle in found[0].tolist()]
    return tuple(
        before if abs(angle - before) <= HALF_STEP else min(max(nearest(angle), low), high)
        for angle, before, low, high in zip(
            refined(fixed, start, goal, REFINEMENTS), now, fixed.lower, fixed.upper, strict=True
        )
    )


def _describe(goal: FixedPose) -> str:
    """A pose for a message."""
    place = ", ".join(f"{v:.3f}" for v in goal.at)
    turn = ", ".join(f"{v:.2f}" for v in from_matrix(np.array(goal.turn)))
    return f"position ({place}) with rotation ({turn})"
