"""Dock: set an object into a frame of another one, turned as that frame is (a phone on its stand).

`ways_in` is what any such skill needs: the joints along a path of the held object, for the first of
many wanted poses that the arm can reach all the way.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, Vec3, from_transform, rotate
from robospa.harness.robots.kinematics import forward, inverse
from robospa.harness.skills.grasping import Reach
from robospa.harness.skills.moving import line, retreat_home, rise, travel
from robospa.harness.skills.pick import pick
from robospa.harness.skills.place import grip_offset
from robospa.harness.skills.workspace import SkillFailed, Steps, Workspace, backed
from robospa.tasks.plan import Dock, Pick

Array = NDArray[np.float64]

ATTEMPTS = 3
LIFT = 0.10
RELEASED_ABOVE = 0.002
"""Room under the object when it is let go [m]."""
RETREAT = 0.07
CLOSE = 0.015
"""An object whose origin is this near to its goal [m] has arrived."""
BEST = 12
"""How many of the reachable end poses are tried along the whole path."""


def shifted(pose: Pose, by: Vec3) -> Pose:
    """`pose` moved by `by` [m, world]."""
    x, y, z = pose.position
    return Pose((x + by[0], y + by[1], z + by[2]), pose.rotation)


def ways_in(
    ws: Workspace,
    arm: int,
    offset: Pose,
    targets: Sequence[Pose],
    path: Sequence[Vec3],
    near: Array,
) -> list[Array] | None:
    """Joints that bring an object held with `offset` along `path` to one of `targets`.

    `path` has shifts [m, world] from the target, farthest first, the last one being none; nearest
    to joints `near` first. None if no target can be reached that way.
    """
    back = offset.inverse()
    ends = [target * back for target in targets]
    joints, ok = inverse(ws.chains[arm], ends)
    order = sorted(np.flatnonzero(ok), key=lambda i: float(np.abs(joints[i] - near).max()))
    for i in order[:BEST]:
        poses = [shifted(ends[i], step) for step in reversed(path[:-1])]
        before = ws.straight(arm, joints[i], poses)
        if before is not None:
            return [*reversed(before), joints[i]]
    return None


def let_go(ws: Workspace, arm: int, retreat: float = RETREAT) -> None:
    """Open the gripper and back out along its approach, then up."""
    frames, _ = forward(ws.chains[arm], ws.joints[arm][None])
    pose = from_transform(frames[0])
    ws.add(arm)
    ws.add(arm, gripper=1.0)
    away = backed(pose, rotate(pose.rotation, (1, 0, 0)), retreat)
    for joints in ws.straight(arm, ws.joints[arm], line(pose, away, 2)) or []:
        ws.add(arm, joints)
    ws.held[arm] = None
    rise(ws, arm)


def dock(ws: Workspace, call: Dock) -> Steps:
    """Pick, bring in along the frame's z axis, let go; again if it did not stay there."""
    frame = ws.pose(call.on) * ws.models[call.on].frames[call.frame]
    x, y, z = rotate(frame.rotation, (0.0, 0.0, 1.0))
    goal = shifted(frame, (x * RELEASED_ABOVE, y * RELEASED_ABOVE, z * RELEASED_ABOVE))
    path = [(x * call.above, y * call.above, z * call.above), (0.0, 0.0, 0.0)]

    def fits(grasp: Reach) -> bool:
        offset = grasp.pose.inverse() * ws.pose(call.object)
        return ways_in(ws, grasp.arm, offset, [goal], path, grasp.joints) is not None

    for _ in range(ATTEMPTS):
        yield from pick(ws, Pick(call.object, LIFT, call.arm), fits)
        arm = ws.held.index(call.object)
        offset = grip_offset(ws, arm, call.object)
        way = ways_in(ws, arm, offset, [goal], path, ws.joints[arm])
        if way is None:
            ws.held[arm] = None
            ws.add(arm, gripper=1.0)
            retreat_home(ws, arm)
            yield from ws.flush()
            raise SkillFailed(f"{call.object} cannot be brought to {call.frame} of {call.on}")
        travel(ws, arm, way[0])
        yield from ws.flush()
        for joints in way[1:]:
            ws.add(arm, joints)
        let_go(ws, arm)
        yield from ws.flush()
        here = np.array(ws.pose(call.object).position)
        if float(np.abs(here - np.array(frame.position)).max()) < CLOSE:
            return
