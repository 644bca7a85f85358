"""Press: touch a frame from above with the closed gripper, then come back up."""

from __future__ import annotations

import math

import numpy as np

from robospa.geometry import Pose, axis_rotation, look_rotation, rotate
from robospa.harness.robots.kinematics import inverse
from robospa.harness.skills.motion import clear_other, line_poses, travel
from robospa.harness.skills.pick import arms_for
from robospa.harness.skills.workspace import (
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
TURNS = tuple(math.pi * i / 8 for i in range(8))
DEPTH = 0.006
"""How far the commanded fingertip goes below the surface, so that it is sure to touch [m]."""


def press(ws: Workspace, call: Press) -> Steps:
    """One press; the arm stays above the object."""
    arm, down, up = _plan(ws, call)
    clear_other(ws, arm)
    if ws.gripper[arm] > 0.05:
        ws.add(arm, gripper=0.0)
    if float(np.abs(ws.joints[arm] - up).max()) > 1e-6:
        travel(ws, arm, up)
    ws.add(arm, down)
    ws.add(arm, up)
    yield from ws.flush()


def _plan(ws: Workspace, call: Press) -> tuple[int, np.ndarray, np.ndarray]:
    """Arm, joints that touch and joints that hover."""
    frame = ws.pose(call.object) * ws.models[call.object].frames[call.frame]
    x, y, z = frame.position
    arms = arms_for(call.arm)
    if len(arms) == 2:
        arms = (0, 1) if x < 0 else (1, 0)
    for arm in arms:
        hand = ws.hand(arm)
        poses = []
        for tilt in TILTS:
            for turn in TURNS:
                closing = (math.cos(turn), math.sin(turn), 0.0)
                for sign in (1, -1):
                    approach = rotate(axis_rotation(closing, sign * tilt), (0, 0, -1))
                    tip = Pose((x, y, z - DEPTH), look_rotation(approach, closing))
                    position = moved_back(tip, approach, hand.tip).position
                    for side in (1, -1):
                        facing = tuple(side * c for c in closing)
                        poses.append(Pose(position, look_rotation(approach, facing)))
        joints, ok = inverse(ws.chains[arm], poses)
        per_tilt = len(TURNS) * 4
        near = ws.joints[arm]
        front = wall_front(ws)
        ranked = sorted(
            np.flatnonzero(ok),
            key=lambda i: (
                max_gripper_y(poses[i], hand) > front,
                i // per_tilt,
                float(np.abs(joints[i] - near).max()),
            ),
        )
        for i in ranked[:20]:
            above = ws.solve_path(
                arm, joints[i], line_poses(poses[i], moved_up(poses[i], call.hover), 1)
            )
            if above is not None:
                return arm, joints[i], above[0]
    raise SkillFailed(f"no arm can press {call.object} at {frame.position}")
