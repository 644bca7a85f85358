"""A policy's answer beside what came next in a demonstration, and how far apart they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robospa.geometry import Array
from robospa.rotations import angle_between

SCALES = {"joints": 0.1, "gripper": 0.2, "position": 0.03, "rotation": 0.2}
"""The mean error [rad, 1, m, rad] of an answer that is about as good as it should be."""
UNITS = {"joints": "rad", "gripper": "", "position": "m", "rotation": "rad"}
WORST = 20.0
"""Errors count up to this many times their scale, so that none hides the others."""


@dataclass(frozen=True)
class Sample:
    """One answer: `given` (K, D) beside what came next in the record, `wanted` (K, D).

    `now` (D,) is the command at that frame, `track` (T, D) the whole record of which `now` is row
    `t`; `measured` the same as the robot measured it, if known. All in `space`, joint or ee.
    """

    space: str
    given: Array
    wanted: Array
    now: Array
    track: Array | None = None
    t: int = 0
    measured: Array | None = None

    @property
    def half(self) -> int:
        """Columns of one arm, the last of which is its gripper."""
        return int(self.given.shape[1]) // 2

    @property
    def grippers(self) -> list[int]:
        """The columns of both grippers."""
        return [self.half - 1, 2 * self.half - 1]

    @property
    def joints(self) -> list[int]:
        """All other columns."""
        return [c for c in range(2 * self.half) if c not in self.grippers]


def groups(space: str) -> list[str]:
    """What errors are told of, in order."""
    kinds = ("joints", "gripper") if space == "joint" else ("position", "rotation", "gripper")
    return [f"{arm} {kind}" for arm in ("left", "right") for kind in kinds]


def errors(case: Sample) -> Array:
    """Mean error of each of `groups`: [rad] over joints, [m], [rad] of turning, gripper 0..1."""
    found = []
    for arm in (0, 1):
        part = slice(arm * case.half, (arm + 1) * case.half)
        a, b = case.given[:, part], case.wanted[:, part]
        if case.space == "joint":
            found.append(np.abs(a[:, :-1] - b[:, :-1]).mean())
        else:
            found.append(np.linalg.norm(a[:, :3] - b[:, :3], axis=1).mean())
            found.append(_angle(a[:, 3:7], b[:, 3:7]).mean())
        found.append(np.abs(a[:, -1] - b[:, -1]).mean())
    return np.array(found)


def score(case: Sample) -> float:
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
