"""The grid of executed actions: every number is a whole multiple of 2^-16 rad, metre or unit.

A policy's numbers are rounded to it once, before they are executed and recorded, so what is
executed, recorded, submitted and replayed is one and the same. 2^-16 is 0.0009 degrees or 15
micrometres, far below what any encoder of such arms resolves; the bits below it are noise that
would make up half of a submission. Rounding is exact in float32 (multiplying by a power of two,
nearest whole number, ties to even), so it is the same on every machine, and rounding again changes
nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

PER_UNIT = 2**16
"""Steps of the grid in a radian, a metre, a whole gripper or quaternion unit."""
FURTHEST = 32767
"""Larger numbers are cut to this; no joint, place or quaternion is near it."""


def on_grid(actions: NDArray[np.float32]) -> NDArray[np.float32]:
    """`actions`, finite float32 of any shape, each number moved to the nearest one on the grid."""
    steps = np.rint(np.clip(actions, -FURTHEST, FURTHEST) * np.float32(PER_UNIT))
    return np.asarray(steps / np.float32(PER_UNIT) + np.float32(0.0), dtype=np.float32)


def is_on_grid(actions: NDArray[np.float32]) -> bool:
    """Whether `on_grid` would leave every bit of `actions` as it is."""
    if not np.isfinite(actions).all():
        return False
    return on_grid(actions).tobytes() == np.ascontiguousarray(actions, dtype=np.float32).tobytes()
