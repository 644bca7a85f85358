"""Press: touch a frame from above with the closed gripper, then come back up."""

from __future__ import annotations

import math
from collections import Counter
from itertools import product

import numpy as np

from robospa.geometry import Pose, Vec3, axis_rotation, look_rotation, rotate
from robospa.harness.robots.kinematics import inverse
from robospa.harness.skills.arm_clearance import TOUCH, arm_depth, edge_depth
from robospa.harness.skills.both_arms import go
from robospa.harness.skills.pick import arms_for
from robospa.harness.skills.workspace import (
    Array,
    SkillFailed,
    Steps,
    Workspace,
    max_gripper_y,
    moved_back,
    moved_up,
    wall_front,
)
from robospa.tasks.plan import Press

TILTS = (0.0, 0.2, 0.4, 0.6, 0.8)
STEEP = (1.0, 1.2)
"""Tilts [rad] that are tried when no arm gets there with less."""
BEST = 6
"""How many poses of a tilt are tried."""
TURNS = tuple(math.pi * i / 8 for i in range(8))
DEPTH = 0.006
"""How far the commanded fingertip goes below the surface, so that it is sure to touch [m]."""


def press(ws: Workspace, call: Press) -> Steps:
    """One press; the arm stays above the object."""
    arm, down, up = _plan(ws, call)
    if float(np.abs(ws.joints[arm] - up).max()) > 1e-6:
        go(ws, arm, up, 0.0)
    elif ws.gripper[arm] > 0.05:
        ws.add(arm, gripper=0.0)
    ws.add(arm, down)
    ws.add(arm, up)
    yield from ws.flush()


def _plan(ws: Workspace, call: Press) -> tuple[int, Array, Array]:
    """Arm, joints that touch and joints that hover.

    The arm asked for is only preferred: where it cannot press, the other one may.
    """
    frame = ws.pose(call.object) * ws.models[call.object].frames[call.frame]
    x, y, z = frame.position
    wanted = arms_for(call.arm)
    arms = (0, 1) if x < 0 else (1, 0)
    if len(wanted) == 1:
        arms = (wanted[0], 1 - wanted[0])
    for tilts, arm in product((TILTS, STEEP), arms):
        hand = ws.hand(arm)
        choices = [_touching((x, y, z - DEPTH), tilt, hand.tip) for tilt in tilts]
        found = _hovering(ws, arm, choices, call.hover)
        if found is not None:
            return arm, *found
    raise SkillFailed(f"no arm can press {call.object} at {frame.position}")


def _touching(point: Vec3, tilt: float, tip: float) -> list[Pose]:
    """End-effector poses with the fingertips at `point`, tilted by `tilt` [rad] to every side."""
    poses = []
    for turn in TURNS:
        closing = (math.cos(turn), math.sin(turn), 0.0)
        for sign in (1, -1) if tilt else (1,):
            approach = rotate(axis_rotation(closing, sign * tilt), (0, 0, -1))
            for side in (1, -1):
                facing = (side * closing[0], side * closing[1], 0.0)
                at = Pose(point, look_rotation(approach, facing))
                poses.append(moved_back(at, approach, tip))
    return poses


def _hovering(
    ws: Workspace, arm: int, choices: list[list[Pose]], hover: float
) -> tuple[Array, Array] | None:
    """Joints at a pose and `hover` [m] above it; None if there is no such pair in reach.

    `choices` are lists of poses, the best list first; of each the nearest few are looked at, those
    that stay clear of a wall before all others, then those at which the edges of a wide hand stay
    clear of what stands beside.
    """
    hand, near, front = ws.hand(arm), ws.joints[arm], wall_front(ws)
    poses = [(k, pose) for k, some in enumerate(choices) for pose in some]
    joints, ok = inverse(ws.chains[arm], [pose for _, pose in poses])
    reached = np.flatnonzero(ok)
    blocked = arm_depth(ws, arm, joints[reached]) > TOUCH
    beside = edge_depth(ws, arm, joints[reached]) > 0.0
    ranked: list[tuple[bool, bool, int, float, int]] = []
    for i, stuck, grazes in zip(reached.tolist(), blocked.tolist(), beside.tolist(), strict=True):
        k, pose = poses[i]
        far = float(np.abs(joints[i] - near).max())
        hits = stuck or max_gripper_y(pose, hand) > front
        ranked.append((hits, grazes, k, far, i))
    looked: Counter[tuple[bool, int]] = Counter()
    for hits, _, k, _, i in sorted(ranked):
        looked[hits, k] += 1
        if looked[hits, k] <= BEST:
            above = ws.solve(arm, moved_up(poses[i][1], hover), joints[i])
            if above is not None:
                return joints[i], above
    return None
