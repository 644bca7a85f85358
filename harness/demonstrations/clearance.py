"""How far an arm's way is from the table, from objects, and from the other arm."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, from_transform
from robospa.harness.robots.kinematics import forward
from robospa.harness.skills.clearance import Boxes, arm_points, finger_points, palm_points, standing
from robospa.harness.skills.workspace import Workspace
from robospa.workcell import WORKCELL

Array = NDArray[np.float64]

MARGIN = 0.01
"""How much larger than they are [m] objects count, besides what the expert's own clearance adds."""
ABOVE_TABLE = 0.015
"""Clearance [m] between the table and what moves."""


def hand_points(ws: Workspace, arm: int, joints: Array) -> Array:
    """Points (N, M, 3) [m, world] on fingers and palm, and on the box around what the arm holds, at
    joints (N, J)."""
    frames, _ = forward(ws.chains[arm], joints)
    side, hand = ws.robot.arms[arm], ws.hand(arm)
    closed, opened = side.travel
    opening = 2 * (closed + ws.gripper[arm] * (opened - closed))
    load = _load_points(ws, arm)
    rows = []
    for frame in frames:
        pose = from_transform(frame)
        parts = [finger_points(hand, pose, opening), palm_points(hand, pose)]
        rows.append(np.concatenate([*parts, load @ frame[:3, :3].T + frame[:3, 3]]))
    return np.stack(rows)


def _load_points(ws: Workspace, arm: int) -> Array:
    """Corners and middles (M, 3) [m] of the box around what the arm holds, in its end-effector
    frame."""
    name = ws.held[arm]
    if name is None:
        return np.empty((0, 3))
    model = ws.models[name]
    middle = Pose((0.0, 0.0, model.bottom + model.size[2] / 2))
    at = ws.snapshot.end_effector[arm].inverse() * ws.pose(name) * middle
    shares = product((-0.5, 0.0, 0.5), repeat=3)
    return np.array([at.apply(np.array(share) * model.size) for share in shares])


def depths(ws: Workspace, arm: int, joints: Array) -> Array:
    """How deep (N,) [m] the arm at joints (N, J), with hand and load, is in the margin around the
    table and all objects but its load."""
    points = np.concatenate([arm_points(ws, arm, joints), hand_points(ws, arm, joints)], axis=1)
    half_x, half_y = WORKCELL.table.size[0] / 2, WORKCELL.table.size[1] / 2
    over = (np.abs(points[..., 0]) < half_x) & (np.abs(points[..., 1]) < half_y)
    below = np.where(over, ws.scene.table_top + ABOVE_TABLE - points[..., 2], 0.0)
    held = ws.held[arm]
    boxes: Boxes = standing(ws, *([] if held is None else [held]))
    around = replace(boxes, half=boxes.half + MARGIN).depths(points)
    found: Array = np.maximum(below.max(axis=1, initial=0.0), around)
    return found


def gaps(ws: Workspace, left: Array, right: Array) -> Array:
    """Distance (N,) [m] of the nearest two points on the arms at joints (N, J) of left and right.

    Points lie up to 5 cm apart on an arm.
    """
    sides = [
        np.concatenate([arm_points(ws, a, joints), hand_points(ws, a, joints)], axis=1)
        for a, joints in enumerate((left, right))
    ]
    between = [np.linalg.norm(a[:, None] - b, axis=2).min() for a, b in zip(*sides, strict=True)]
    return np.array(between)
