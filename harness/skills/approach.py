"""The last centimetres of a held object: a path that the arm can follow to one of many poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from robospa.geometry import Pose, Vec3, from_transform, rotate
from robospa.harness.robots.kinematics import forward, inverse
from robospa.harness.skills.motion import line_poses, rise, travel
from robospa.harness.skills.workspace import Array, Steps, Workspace, moved_back

RETREAT = 0.07
"""How far the open gripper backs out [m]."""
DEEPER, ASIDE = 0.004, 0.045
"""How far the open gripper goes below where it let go of what jams in it, and out sideways [m]."""
BEST = 12
"""How many of the reachable end poses are tried along the whole path."""


def translated(pose: Pose, by: Vec3) -> Pose:
    """`pose` moved by `by` [m, world]."""
    x, y, z = pose.position
    return Pose((x + by[0], y + by[1], z + by[2]), pose.rotation)


def approach_joints(
    ws: Workspace,
    arm: int,
    offset: Pose,
    targets: Sequence[Pose],
    path: Sequence[Vec3],
    near: Array,
    free: Callable[[list[Array]], bool] | None = None,
) -> list[Array] | None:
    """Joints [rad] that bring an object held with `offset` along `path` to one of `targets`.

    `path` has shifts [m, world] from the target, farthest first, the last one being none; nearest
    to joints `near` first; only a way that is `free`. None if no target can be reached that way.
    """
    back = offset.inverse()
    ends = [target * back for target in targets]
    joints, ok = inverse(ws.chains[arm], ends)
    order = sorted(np.flatnonzero(ok), key=lambda i: float(np.abs(joints[i] - near).max()))
    for i in order[:BEST]:
        poses = [translated(ends[i], step) for step in reversed(path[:-1])]
        before = ws.solve_path(arm, joints[i], poses)
        way = None if before is None else [*reversed(before), joints[i]]
        if way is not None and (free is None or free(way)):
            return way
    return None


def release(ws: Workspace, arm: int) -> None:
    """Open the gripper, back out along its approach, then rise."""
    frames, _ = forward(ws.chains[arm], ws.joints[arm][None])
    pose = from_transform(frames[0])
    ws.add(arm)
    ws.add(arm, gripper=1.0)
    away = moved_back(pose, rotate(pose.rotation, (1, 0, 0)), RETREAT)
    for joints in ws.solve_path(arm, ws.joints[arm], line_poses(pose, away, 2)) or []:
        ws.add(arm, joints)
    ws.held[arm] = None
    rise(ws, arm)


def put_down(ws: Workspace, arm: int, height: float) -> Steps:
    """Lower the object that the arm holds until its origin is at `height` [m], and release it."""
    name = ws.held[arm]
    if name is not None:
        frames, _ = forward(ws.chains[arm], ws.joints[arm][None])
        here = from_transform(frames[0])
        down = translated(here, (0.0, 0.0, height - ws.pose(name).position[2]))
        for joints in ws.solve_path(arm, ws.joints[arm], line_poses(here, down, 2)) or []:
            ws.add(arm, joints)
    release(ws, arm)
    yield from ws.flush()


def slide_out(ws: Workspace, arm: int, name: str, height: float) -> Steps:
    """Lower `name`, which jams in the open gripper, to `height` [m] and move out beside it.

    What widens upwards to the gripper's opening comes up with it.
    """
    frames, _ = forward(ws.chains[arm], ws.joints[arm][None])
    here = from_transform(frames[0])
    down = translated(here, (0.0, 0.0, height - ws.pose(name).position[2] - DEEPER))
    x, y, _ = rotate(here.rotation, (0.0, 0.0, 1.0))
    share = math.copysign(ASIDE / max(math.hypot(x, y), 1e-9), -y)
    for step in (share, -share):  # towards the robot first
        beside = translated(down, (x * step, y * step, 0.0))
        up = translated(beside, (0.0, 0.0, RETREAT))
        way = [p for a, b in pairwise((here, down, beside, up)) for p in line_poses(a, b, 2)]
        joints = ws.solve_path(arm, ws.joints[arm], way)
        if joints is not None:
            for stop in joints:
                ws.add(arm, stop)
            break
    rise(ws, arm)
    yield from ws.flush(exactly=True)


def bring_in(ws: Workspace, arm: int, path: Sequence[Array], stop: Array | None = None) -> Steps:
    """Travel to the first joints of `path`, follow the others, release the object there.

    By way of joints `stop`, if given, without a look at what is in the way.
    """
    if stop is None:
        travel(ws, arm, path[0])
    else:
        ws.add(arm, stop)
        ws.add(arm, path[0])
    yield from ws.flush()
    for joints in path[1:]:
        ws.add(arm, joints)
    release(ws, arm)
    yield from ws.flush()
