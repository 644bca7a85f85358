"""Getting from here to there without sweeping things off the table."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robospa.harness.robots.kinematics import forward, pose_of
from robospa.harness.skills.workspace import TRAVEL_HEIGHT, Workspace, raised
from robospa.tasks.geometry import Pose
from robospa.tasks.scene import TABLE_TOP

Array = NDArray[np.float64]

NEAR_HOME = 0.15
"""An arm whose joints are all this close to home [rad] is out of the way."""
SAMPLES = np.linspace(0.0, 1.0, 9)[1:-1, None]


def tip_heights(ws: Workspace, arm: int, joints: Array) -> Array:
    """Height [m] of the grasp centre for each row of joints (N, J)."""
    frames, _ = forward(ws.chains[arm], joints)
    return np.asarray(frames[:, 2, 3] + frames[:, 2, 0] * ws.robot.arms[arm].reach)


def rise(ws: Workspace, arm: int, to: float = TRAVEL_HEIGHT) -> None:
    """Lift the arm's grasp centre to height `to` if it is lower, as far as the arm can."""
    height = float(tip_heights(ws, arm, ws.joints[arm][None])[0])
    if height >= to - 0.01:
        return
    frames, _ = forward(ws.chains[arm], ws.joints[arm][None])
    here = pose_of(frames[0])
    for share in (1.0, 0.75, 0.5, 0.25):
        joints = ws.solve(arm, raised(here, (to - height) * share), ws.joints[arm])
        if joints is not None:
            ws.add(arm, joints)
            return


def travel(ws: Workspace, arm: int, goal: Array, floor: float = TABLE_TOP + 0.07) -> None:
    """Go to joints `goal`: up first, then along the joint line, over a detour if that dips.

    `floor` [m] is the height that the grasp centre must keep between the two ends.
    """
    rise(ws, arm)
    start = ws.joints[arm]
    line = start + (goal - start) * SAMPLES
    ends = min(*tip_heights(ws, arm, np.stack([start, goal])), floor)
    if float(tip_heights(ws, arm, line).min()) < ends - 0.01:
        middle = (start + goal) / 2
        frames, _ = forward(ws.chains[arm], middle[None])
        here = pose_of(frames[0])
        height = float(tip_heights(ws, arm, middle[None])[0])
        detour = ws.solve(arm, raised(here, max(0.0, TRAVEL_HEIGHT - height)), middle)
        if detour is not None:
            ws.add(arm, detour)
    ws.add(arm, goal)


def retreat_home(ws: Workspace, arm: int) -> None:
    """Bring an arm back to its home joints, up first."""
    home = np.asarray(ws.robot.arms[arm].home, dtype=float)
    if float(np.abs(ws.joints[arm] - home).max()) < NEAR_HOME:
        return
    rise(ws, arm)
    ws.add(arm, home, 1.0 if ws.held[arm] is None else None)


def clear_other(ws: Workspace, arm: int) -> None:
    """Send the other arm home if it is out, so that the two never meet."""
    other = 1 - arm
    if ws.held[other] is None:
        retreat_home(ws, other)


def line(start: Pose, end: Pose, pieces: int) -> list[Pose]:
    """`pieces` poses from just after `start` to `end`, with `end`'s rotation."""
    a, b = np.array(start.position), np.array(end.position)
    out = []
    for i in range(1, pieces + 1):
        x, y, z = (float(v) for v in a + (b - a) * i / pieces)
        out.append(Pose((x, y, z), end.rotation))
    return out
