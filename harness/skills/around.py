"""A way around what stands close beside a held object and its goal.

`motion.route` takes things for upright cylinders, so that it finds no way out from beside a high
thing. Here arms are their links, and what is held and what it goes around the boxes of their parts.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, from_transform
from robospa.harness.robots.kinematics import forward
from robospa.harness.skills.narrow import Narrow

Array = NDArray[np.float64]

BACK, ASIDE, UP = (0.0, 0.06, 0.12, 0.18), (0.0, 0.06, -0.06, 0.12, -0.12), (0.0, 0.04, 0.08, 0.12)
"""How far [m] towards the robot, sideways and up from the start a stop may be."""


def stop_beside(narrow: Narrow, goal: Array) -> Array | None:
    """Joints [rad] of a stop between here and joints `goal` with which the arm and what it holds
    get around the object of `narrow`, and past all else; None if there is none."""
    ws, arm = narrow.ws, narrow.arm
    start = ws.joints[arm]
    frames, _ = forward(ws.chains[arm], np.stack([start, goal]))
    here, there = (from_transform(frame) for frame in frames)
    x, y, z = here.position
    for back, aside, up in product(BACK, ASIDE, UP):
        place = (x + aside, y - back, z + up)
        for rotation, near in ((here.rotation, start), (there.rotation, goal)):
            stop = ws.solve(arm, Pose(place, rotation), near)
            if stop is None:
                continue
            way = [start, stop, goal]
            if narrow.open(way) and narrow.past_others(way):
                return stop
    return None
