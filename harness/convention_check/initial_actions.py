"""Do a policy's first actions begin where the robot is? A look that needs no demonstration.

The policy is shown a few made-up postures of the robot in front of noise. Nobody knows what it
should do there, but whatever it does begins near the posture it is shown: an action is a small
step. A jump that becomes a small step once arms are exchanged, degrees read as radians, or
differences added up, is most likely that mistake. Hints, not verdicts: a model may well be lost
in front of noise.
"""

from collections.abc import Sequence

import numpy as np

from robospa.action_space import ActionSpace
from robospa.geometry import Array
from robospa.harness.convention_check.action_faults import AnswerSample
from robospa.harness.convention_check.check import FITS, judge
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.observation import Observation
from robospa.protocol.conformance import synthetic_observation, trial_for
from robospa.protocol.policy import CALLED, Policy, PolicySpec, robot_of

POSTURES = 4
KEYFRAMES = "actions=keyframes"
"""What a policy's contract says whose actions are whole moves rather than small steps."""
JUMP = {"joint": 1.0, "ee": 0.3}
"""A first action that asks one joint for a way [rad], or a hand for one [m], as long as this."""
TURNED = 0.25
"""Mean distance of gripper numbers from those shown that is worth an explanation."""
SLACK = 0.1
"""Gripper numbers may lie this far outside 0..1: networks overshoot."""
SHRINKS = {"degrees", "delta from the start", "delta from the last"}
"""Two of these make a small step of whatever is answered, so that they explain nothing here."""
GAIN = 0.8
"""Share of the jump that undoing a mistake must take away for it to be named."""


def postures(spec: PolicySpec) -> list[Observation]:
    """Observations of the form of `spec`: noise, and postures that no mistake leaves the same."""
    rng = np.random.default_rng(5)
    robot = embodiment(robot_of(spec))
    space = robot.action_space("joint")
    seen = []
    for i in range(POSTURES):
        observation = synthetic_observation(spec, seed=i)
        shape = (2, max(space.joints))
        joints = rng.uniform(0.25, 0.9, shape) * rng.choice([-1, 1], shape)
        grips = rng.uniform(0.55, 0.95, 2)
        rows = [row[:count].tolist() for row, count in zip(joints, space.joints, strict=True)]
        poses = [end_effector(chain_of(a), q) for a, q in zip(robot.arms, rows, strict=True)]
        ee = [[*p.position, *p.rotation, g] for p, g in zip(poses, grips, strict=True)]
        observation["ee"] = np.array(ee, np.float32)
        if "state" in observation:
            state = [v for q, g in zip(rows, grips, strict=True) for v in (*q, g)]
            observation["state"] = np.array(state, np.float32)
        for view in observation.get("history", {}).values():
            view["ee"] = observation["ee"]
            if "state" in observation:
                view["state"] = observation["state"]
        seen.append(observation)
    return seen


def hints(policy: Policy) -> tuple[list[str], str]:
    """Suspicious properties of the first actions, a sentence each, and the figures behind them.

    Raises what the policy raises. Nothing is said of policies that need the exact state, or drive
    robots that are not installed here.
    """
    spec = policy.spec
    if spec.sees_state or not _is_installed(robot_of(spec)):
        return [], "not for this policy"
    if spec.action in CALLED:
        return [], "not for calls of skills"
    if KEYFRAMES in spec.contract:
        return [], "not for keyframes, each of which is a whole move"
    if spec.action == "joint" and spec.state == "none":
        return [], "the policy is not shown its joints"
    cases = [c for seen in postures(spec) if (c := _case(policy, seen)) is not None]
    if not cases:
        return [], "not for actions of this size"
    return odd(cases, spec.action)


def _is_installed(robot: str) -> bool:
    try:
        return bool(embodiment(robot))
    except ValueError:
        return False


def _case(policy: Policy, seen: Observation) -> AnswerSample | None:
    kind = policy.spec.action
    robot = embodiment(robot_of(policy.spec))
    space = robot.action_space("joint" if kind == "joint" else "ee")
    policy.reset(trial_for(policy.spec))
    chunk = np.asarray(policy.infer(seen), dtype=float)
    now = np.asarray(seen["state"] if kind == "joint" else seen["ee"], dtype=float).reshape(-1)
    if not chunk.shape[1] == space.width == len(now):
        return None
    if kind == "delta_ee":
        now = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 2)
    return AnswerSample(space, chunk[:1].copy(), now[None], now)


def odd(cases: Sequence[AnswerSample], action: str = "joint") -> tuple[list[str], str]:
    """The same for first actions `given` (1, D) at the postures `recorded` (1, D)."""
    space = cases[0].space
    given = np.concatenate([case.given for case in cases])
    recorded = np.concatenate([case.recorded for case in cases])
    grips = given[:, space.grippers]
    found = []
    if grips.min() < -SLACK or grips.max() > 1 + SLACK:
        found.append(
            f"gripper numbers run from {grips.min():.3g} to {grips.max():.3g}; here 0 is closed "
            "and 1 open, and what lies outside is cut off"
        )
    elif grips.min() >= 0 and grips.max() <= 0.12 and recorded[:, space.grippers].min() > 0.4:
        found.append(
            f"gripper numbers stay below {grips.max():.3g} though the grippers are shown open: are "
            "they openings in metres? Here 1 is open"
        )
    jump = _jump(given - recorded, space)
    unit = "rad" if space.kind == "joint" else "m"
    far = jump > JUMP[space.kind]
    if space.kind == "ee":
        lengths = np.concatenate(
            [np.linalg.norm(given[:, arm.quaternion], axis=1) for arm in space.arms]
        )
        if np.abs(lengths - 1).max() > 0.1:
            found.append(
                f"quaternions have lengths from {lengths.min():.2f} to {lengths.max():.2f}"
            )
    if action != "delta_ee":
        findings = judge(cases, {}, gain=GAIN)
        best, grip = findings.best, np.abs(given - recorded)[:, space.grippers].mean()
        shrunk = best is not None and len(SHRINKS & {*best.names}) > 1
        if best is not None and not shrunk and (far or grip > TURNED or findings.base.score > FITS):
            found.append(f"the first action is far from the state; it looks as if {best.phrase}")
            far = False
    if far:
        found.append(
            f"the first action asks for {jump:.2f} {unit} at once: a policy of absolute targets "
            "begins near the state that it is shown"
        )
    seen = f"{jump:.3f} {unit} from the state, grippers {grips.min():.2f} to {grips.max():.2f}"
    return found, f"at most {seen}"


def _jump(gap: Array, space: ActionSpace) -> float:
    """The longest way that a first action asks for: of a joint [rad] or a hand [m]."""
    if space.kind == "joint":
        return float(np.abs(gap[:, space.bodies]).max())
    return max(float(np.linalg.norm(gap[:, arm.position], axis=1).max()) for arm in space.arms)
