"""Letting a scene come to rest before its trial starts.

Rest is judged by where objects are, not by their velocities, which chatter in contacts: over a
tenth of a second no object may have moved or turned by more than can be seen, twice in a row.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robospa.harness.sim.lazy_snapshot import FLOATS
from robospa.harness.sim.motion import RATE
from robospa.harness.sim.physics import Physics
from robospa.harness.world import SceneUnstable
from robospa.rotations import angle_between

Array = NDArray[np.float64]

WINDOW = 25
WINDOWS = 10
"""At most this many windows of WINDOW physics steps: 1 s of simulated time."""
QUIET_WINDOWS = 2
REST_DISTANCE = 2e-4  # [m] in one window
REST_ANGLE = math.radians(0.2)  # in one window
FALLEN = 0.5  # [m] an object whose origin is below this is not on the table


def settle(physics: Physics, where: str) -> None:
    """Step until nothing moves. SceneUnstable, naming `where` and the object, if one still moves
    after WINDOWS windows or has left the table."""
    names = list(physics.moving())
    if not names:
        return
    before = _state(physics, names)
    quiet, restless = 0, ""
    for _ in range(WINDOWS):
        for _ in range(WINDOW):
            physics.step()
        after = _state(physics, names)
        moved = mover(names, before, after)
        restless = moved or restless
        quiet = 0 if moved else quiet + 1
        before = after
        if quiet == QUIET_WINDOWS:
            break
    else:
        raise SceneUnstable(
            f"object {restless!r} of {where} still moves after {WINDOWS * WINDOW / RATE:g} s; "
            f"this seed is not valid"
        )
    fallen = [name for name, row in zip(names, before, strict=True) if row[6] < FALLEN]
    if fallen:
        raise SceneUnstable(
            f"object {fallen[0]!r} of {where} fell off the table while the scene settled; "
            f"this seed is not valid"
        )


def _state(physics: Physics, names: list[str]) -> Array:
    """Packed poses (N, 7: rotation, position) of the named objects."""
    poses = np.frombuffer(physics.packed(), dtype=np.float32).reshape(-1, FLOATS)
    return poses[[physics.rows[name] for name in names]].astype(np.float64)


def mover(names: list[str], before: Array, after: Array) -> str:
    """The object that moved most between two packed states, or "" if all are at rest."""
    shift = np.linalg.norm(after[:, 4:] - before[:, 4:], axis=1)
    turn = angle_between(before[:, :4], after[:, :4])
    unrest = np.maximum(shift / REST_DISTANCE, turn / REST_ANGLE)
    worst = int(np.argmax(unrest))
    return names[worst] if unrest[worst] > 1.0 else ""
