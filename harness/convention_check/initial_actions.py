"""Do a policy's first actions begin where the robot is? A look that needs no demonstration.

The policy is shown a few made-up postures of the robot in front of noise. Nobody knows what it
should do there, but whatever it does begins near the posture it is shown: an action is a small
step. A jump that becomes a small step once arms are exchanged, degrees read as radians, or
differences added up, is most likely that mistake. Hints, not verdicts: a model may well be lost
in front of noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robospa.harness.convention_check.check import judge
from robospa.harness.convention_check.samples import Sample
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.protocol.conformance import TRIAL, synthetic_observation
from robospa.protocol.policy import Policy, PolicySpec
from robospa.trial import REFERENCE

POSTURES = 4
JUMP = {"joint": 1.0, "ee": 0.3}
"""A first action that asks one joint for a way [rad], or a hand for one [m], as long as this."""
TURNED = 0.25
"""Mean distance of gripper numbers from those shown that is worth an explanation."""
SLACK = 0.1
"""Gripper numbers may lie this far outside 0..1: networks overshoot."""
GAIN = 0.8
"""Share of the jump that undoing a mistake must take away for it to be named."""


def postures(spec: PolicySpec, count: int = POSTURES) -> list[dict[str, Any]]:
    """Observations of the form of `spec`: noise, and postures that no mistake leaves the same."""
    rng = np.random.default_rng(5)
    arms = embodiment(REFERENCE).arms
    seen = []
    for i in range(count):
        observation = synthetic_observation(spec, seed=i)
        joints = rng.uniform(0.25, 0.9, (2, 6)) * rng.choice([-1, 1], (2, 6))
        grips = rng.uniform(0.55, 0.95, 2)
        poses = [
            end_effector(chain_of(a), [float(v) for v in q])
            for a, q in zip(arms, joints, strict=True)
        ]
        ee = [[*p.position, *p.rotation, g] for p, g in zip(poses, grips, strict=True)]
        observation["ee"] = np.array(ee, np.float32)
        if "state" in observation:
            observation["state"] = (
                np.hstack([joints, grips[:, None]]).reshape(-1).astype(np.float32)
            )
        for view in observation.get("history", {}).values():
            view.update({k: observation[k] for k in ("ee", "state") if k in observation})
        seen.append(observation)
    return seen


def hints(policy: Policy) -> tuple[list[str], str]:
    """What looks odd about the first actions, a sentence each; and what was seen.

    Raises what the policy raises. Nothing is said of policies that need the exact state, or drive
    another robot than REFERENCE.
    """
    spec = policy.spec
    if spec.privileged or (spec.embodiments and REFERENCE not in spec.embodiments):
        return [], "not for this policy"
    if spec.action == "joint" and spec.state == "none":
        return [], "the policy is not shown its joints"
    cases = [c for seen in postures(spec) if (c := _case(policy, seen)) is not None]
    if not cases:
        return [], "not for actions of this size"
    return odd(cases, spec.action)


def _case(policy: Policy, seen: dict[str, Any]) -> Sample | None:
    space = policy.spec.action
    policy.reset(TRIAL)
    chunk = np.asarray(policy.infer(seen), dtype=float)
    now = np.asarray(seen["state"] if space == "joint" else seen["ee"], dtype=float).reshape(-1)
    if chunk.shape[1] != len(now):
        return None
    if space == "delta_ee":
        now = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 2)
    first = chunk[:1].copy()
    wanted = now[None].copy()
    return Sample("joint" if space == "joint" else "ee", first, wanted, now)


def odd(cases: Sequence[Sample], action: str = "joint") -> tuple[list[str], str]:
    """The same for first actions `given` (1, D) at the postures `wanted` (1, D)."""
    given = np.concatenate([case.given for case in cases])
    wanted = np.concatenate([case.wanted for case in cases])
    grips = given[:, cases[0].grippers]
    found = []
    if grips.min() < -SLACK or grips.max() > 1 + SLACK:
        found.append(
            f"gripper numbers run from {grips.min():.3g} to {grips.max():.3g}; here 0 is closed "
            "and 1 open, and what lies outside is cut off"
        )
    elif grips.min() >= 0 and grips.max() <= 0.12 and wanted[:, cases[0].grippers].min() > 0.4:
        found.append(
            f"gripper numbers stay below {grips.max():.3g} though the grippers are shown open: are "
            "they openings in metres? Here 1 is open"
        )
    jump = _jump(given, wanted, cases[0])
    unit = "rad" if cases[0].space == "joint" else "m"
    far = jump > JUMP[cases[0].space]
    if cases[0].space == "ee":
        lengths = np.linalg.norm(given.reshape(-1, 8)[:, 3:7], axis=1)
        if np.abs(lengths - 1).max() > 0.1:
            found.append(
                f"quaternions have lengths from {lengths.min():.2f} to {lengths.max():.2f}"
            )
    if action != "delta_ee":
        findings = judge(cases, {}, gain=GAIN)
        grip = np.abs(given - wanted)[:, cases[0].grippers].mean()
        if findings.best is not None and (far or grip > TURNED or findings.base.score > 3):
            found.append(
                f"the first action is far from the state; it looks as if {findings.best.phrase}"
            )
            far = False
    if far:
        found.append(
            f"the first action asks for {jump:.2f} {unit} at once: a policy of absolute targets "
            "begins near the state that it is shown"
        )
    seen = f"{jump:.3f} {unit} from the state, grippers {grips.min():.2f} to {grips.max():.2f}"
    return found, f"at most {seen}"


def _jump(given: Any, wanted: Any, case: Sample) -> float:
    """The longest way that a first action asks for: of a joint [rad] or a hand [m]."""
    gap = given - wanted
    if case.space == "joint":
        return float(np.abs(gap[:, case.joints]).max())
    return float(np.linalg.norm(gap.reshape(-1, 8)[:, :3], axis=1).max())
