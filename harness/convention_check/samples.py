"""A policy's answer beside what came next in a demonstration, and how far apart they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robospa.action_space import ARMS, ActionSpace
from robospa.geometry import Array
from robospa.rotations import angle_between

SCALES = {"joints": 0.1, "gripper": 0.2, "position": 0.03, "rotation": 0.2}
"""The mean error [rad, 1, m, rad] of an answer that is about as good as it should be."""
UNITS = {"joints": "rad", "gripper": "", "position": "m", "rotation": "rad"}
WORST = 20.0
"""Errors count up to this many times their scale, so that none hides the others."""


@dataclass(frozen=True)
class AnswerSample:
    """One answer: `given` (K, D) beside what came next in the record, `recorded` (K, D).

    `now` (D,) is the command at that frame, `track` (T, D) the whole record of which `now` is row
    `t`; `measured` the same as the robot measured it, if known. All in `space`, of the kind joint
    or ee.
    """

    space: ActionSpace
    given: Array
    recorded: Array
    now: Array
    track: Array | None = None
    t: int = 0
    measured: Array | None = None


def groups(space: ActionSpace) -> list[str]:
    """The groups of columns that errors are reported for, in order."""
    parts = ("joints", "gripper") if space.kind == "joint" else ("position", "rotation", "gripper")
    return [f"{arm} {part}" for arm in ARMS for part in parts]


def errors(case: AnswerSample) -> Array:
    """Mean error of each of `groups`: [rad] over joints, [m], [rad] of turning, gripper 0..1."""
    found = []
    a, b = case.given, case.recorded
    for arm in case.space.arms:
        if case.space.kind == "joint":
            found.append(np.abs(a[:, arm.body] - b[:, arm.body]).mean())
        else:
            place, turn = arm.position, arm.quaternion
            found.append(np.linalg.norm(a[:, place] - b[:, place], axis=1).mean())
            found.append(_angle(a[:, turn], b[:, turn]).mean())
        found.append(np.abs(a[:, arm.gripper] - b[:, arm.gripper]).mean())
    return np.array(found)


def score(case: AnswerSample) -> float:
    """All errors in one number: about 1 for an answer as good as it should be."""
    scales = np.array([SCALES[name.split()[1]] for name in groups(case.space)])
    return float(np.minimum(errors(case) / scales, WORST).mean())


def _angle(a: Array, b: Array) -> Array:
    """Angles [rad] between rotations of any length; pi for what is none."""
    lengths = np.linalg.norm(a, axis=1, keepdims=True) * np.linalg.norm(b, axis=1, keepdims=True)
    real = lengths > 1e-9
    # both lengths at once: the vector part of a product scales with them
    angle = angle_between(a / np.where(real, lengths, 1.0), b)
    return np.where(real[:, 0], angle, np.pi)
