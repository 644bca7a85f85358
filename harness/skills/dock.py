"""Dock: set an object into a frame of another one, turned as it is (a phone on its stand)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import rotate
from robospa.harness.skills.approach import approach_joints, bring_in, translated
from robospa.harness.skills.around import stop_beside
from robospa.harness.skills.grasping import GraspCandidate
from robospa.harness.skills.motion import retreat_home, route
from robospa.harness.skills.narrow import Narrow
from robospa.harness.skills.pick import pick
from robospa.harness.skills.place import grip_offset
from robospa.harness.skills.workspace import SkillFailed, Steps, Workspace
from robospa.tasks.plan import Dock, Pick

Array = NDArray[np.float64]

ATTEMPTS = 3
LIFT = 0.10
RELEASED_ABOVE = 0.002
"""Height above its goal at which the object is released [m]."""
CLOSE = 0.015
"""An object whose origin is this near to its goal [m] has arrived."""


def dock(ws: Workspace, call: Dock) -> Steps:
    """Pick, bring in along the frame's z axis, release; again if it did not stay there."""
    frame = ws.pose(call.on) * ws.models[call.on].frames[call.frame]
    x, y, z = rotate(frame.rotation, (0.0, 0.0, 1.0))
    goal = translated(frame, (x * RELEASED_ABOVE, y * RELEASED_ABOVE, z * RELEASED_ABOVE))
    path = [(x * call.above, y * call.above, z * call.above), (0.0, 0.0, 0.0)]

    def feasible(grasp: GraspCandidate) -> bool:
        offset = grasp.pose.inverse() * ws.pose(call.object)
        return approach_joints(ws, grasp.arm, offset, [goal], path, grasp.joints) is not None

    for _ in range(ATTEMPTS):
        yield from pick(ws, Pick(call.object, LIFT, call.arm), feasible)
        arm = ws.held.index(call.object)
        offset = grip_offset(ws, arm, call.object)
        way = approach_joints(ws, arm, offset, [goal], path, ws.joints[arm])
        if way is None:
            ws.held[arm] = None
            ws.add(arm, gripper=1.0)
            retreat_home(ws, arm)
            yield from ws.flush()
            raise SkillFailed(f"{call.object} cannot be brought to {call.frame} of {call.on}")
        free = route(ws, arm, way[0]).free
        stop = None if free else stop_beside(Narrow(ws, arm, call.on, offset), way[0])
        yield from bring_in(ws, arm, way, stop)
        here = np.array(ws.pose(call.object).position)
        if float(np.abs(here - np.array(frame.position)).max()) < CLOSE:
            return
