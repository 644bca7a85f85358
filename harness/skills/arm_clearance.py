"""How deep an arm itself would be in the table or in other objects: forearm, wrist and hand.

A hand that comes level has the wrist beside, above or below it, by the arm and by which way round
it is turned; below, it may be in the table long before the fingers are, and the forearm follows it
low over everything between the object and the robot.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import to_matrix
from robospa.harness.robots.embodiment import Arm
from robospa.harness.robots.kinematics import forward, link_frames
from robospa.harness.skills.clearance import standing
from robospa.harness.skills.workspace import Workspace
from robospa.tasks.shapes import Box
from robospa.workcell import WORKCELL

Array = NDArray[np.float64]

SPARE = 0.01
"""What is left [m] between an arm and the table."""
TOUCH = 0.005
"""An arm deeper [m] than this in something is in its way."""
EDGE = 0.06
"""What of a hand is farther [m] than this from the fingers' axis is beside what they touch."""
SPACING = 0.05
"""Points on a link's box are at most so far apart [m]."""


@cache
def _points(arm: Arm) -> tuple[tuple[int, Array], ...]:
    """Of every link that collides: its index among the moved ones, and points (K, 3) [m] on it."""
    found = []
    for index, joint in enumerate(arm.joints):
        grids = []
        for shape in arm.shapes[joint.child]:
            if shape.collision and isinstance(shape.geometry, Box):
                half = shape.geometry.half
                sides = [np.linspace(-h, h, 1 + math.ceil(2 * h / SPACING)) for h in half]
                grid = np.array(list(product(*sides)))
                grids.append(grid @ to_matrix(shape.pose.rotation).T + shape.pose.position)
        if grids:
            found.append((index, np.concatenate(grids)))
    return tuple(found)


def arm_points(ws: Workspace, arm: int, joints: Array) -> Array:
    """Points (N, K, 3) [m, world] on forearm, wrist and hand at joints (N, J)."""
    parts = _link_points(ws, arm, joints)
    return np.concatenate(parts, axis=1) if parts else np.empty((len(joints), 0, 3))


def edge_depth(ws: Workspace, arm: int, joints: Array) -> Array:
    """How deep (N,) [m] the edges of a wide hand are in things: what of the last link, the hand
    without its fingers, is farther than EDGE from their axis."""
    parts = _link_points(ws, arm, joints)
    if not parts or not len(joints):
        return np.zeros(len(joints))
    frames, _ = forward(ws.chains[arm], joints[:1])
    beside = (parts[-1][0] - frames[0, :3, 3]) @ frames[0, :3, 1:3]
    return standing(ws).depths(parts[-1][:, np.hypot(*beside.T) > EDGE])


def _link_points(ws: Workspace, arm: int, joints: Array) -> list[Array]:
    """Points (N, K, 3) [m, world] on every link that collides, from the base outwards."""
    frames = link_frames(ws.chains[arm], joints)
    return [
        points @ frames[i][:, :3, :3].transpose(0, 2, 1) + frames[i][:, None, :3, 3]
        for i, points in _points(ws.robot.arms[arm])
    ]


def arm_depth(ws: Workspace, arm: int, joints: Array, *without: str) -> Array:
    """How deep (N,) [m] the arm at joints (N, J) is in the table or in things but for `without`."""
    if not len(joints):
        return np.zeros(0)
    points = arm_points(ws, arm, joints)
    if not points.shape[1]:
        return np.zeros(len(joints))
    half_x, half_y = WORKCELL.table.size[0] / 2, WORKCELL.table.size[1] / 2
    over = (np.abs(points[..., 0]) < half_x) & (np.abs(points[..., 1]) < half_y)
    below = np.where(over, ws.scene.table_top + SPARE - points[..., 2], 0.0)
    depth: Array = np.maximum(below.max(axis=1, initial=0.0), standing(ws, *without).depths(points))
    return depth
