"""Pour: take an open object and turn it over above a container, until what is in it falls out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, Quat, axis_rotation, multiply, rotate, yaw_rotation
from robospa.harness.robots.kinematics import inverse
from robospa.harness.skills.grasping import GraspCandidate
from robospa.harness.skills.motion import travel
from robospa.harness.skills.pick import pick
from robospa.harness.skills.place import grip_offset
from robospa.harness.skills.workspace import SkillFailed, Steps, Workspace
from robospa.tasks.plan import Pick, Pour

Array = NDArray[np.float64]

LIFT = 0.12
TIPS = (2.5, 2.1)
"""How far the object is turned over [rad], best first."""
AZIMUTHS = 8
"""About so many axes."""
LAST_TIPS, LAST_AZIMUTHS = (2.3, 2.1, 1.9), 32
"""Tried if the object lies in the hand so that none of the others can be reached."""
SPINS = tuple(2 * math.pi * i / 12 for i in range(12))
MOUTHS = ((0.05, -0.08), (0.0, -0.12), (0.0, 0.0), (0.05, 0.05))
"""Where the object's mouth goes, from the container's middle [m]."""
HEIGHTS = (0.30, 0.40)
"""How high above the container's rim the mouth goes [m]."""
PAUSES = 3
ROUNDS = 3


def pour(ws: Workspace, call: Pour) -> Steps:
    """Pick, carry, turn over, wait; then the same at other places, should anything be left."""
    targets = _targets(ws, call)

    def feasible(grasp: GraspCandidate) -> bool:
        offset = grasp.pose.inverse() * ws.pose(call.object)
        return bool(_reachable(ws, grasp.arm, offset, targets, grasp.joints, 1))

    yield from pick(ws, Pick(call.object, LIFT, call.arm), feasible)
    arm = ws.held.index(call.object)
    offset = grip_offset(ws, arm, call.object)
    found = _reachable(ws, arm, offset, targets, ws.joints[arm], ROUNDS)
    if not found:
        more = _targets(ws, call, LAST_TIPS, LAST_AZIMUTHS)
        found = _reachable(ws, arm, offset, more, ws.joints[arm], ROUNDS, len(LAST_TIPS))
    if not found:
        raise SkillFailed(f"{call.object} cannot be turned over above {call.into}")
    for joints in found:
        travel(ws, arm, joints)
        for _ in range(PAUSES):
            ws.add(arm)
        yield from ws.flush()


def _reachable(
    ws: Workspace,
    arm: int,
    offset: Pose,
    targets: Sequence[Pose],
    near: Array,
    count: int,
    tips: int = len(TIPS),
) -> list[Array]:
    """Joints of up to `count` of the targets, those that are turned furthest and nearest first."""
    back = offset.inverse()
    joints, ok = inverse(ws.chains[arm], [t * back for t in targets])
    per_tip = len(targets) // tips
    ranked = sorted(
        np.flatnonzero(ok), key=lambda i: (i // per_tip, float(np.abs(joints[i] - near).max()))
    )
    return [joints[i] for i in ranked[:count]]


def _targets(
    ws: Workspace, call: Pour, tips: Sequence[float] = TIPS, azimuths: int = AZIMUTHS
) -> list[Pose]:
    """Poses of the object with its mouth down over the container, by how far it is turned."""
    bin_pose, bin_model = ws.pose(call.into), ws.models[call.into]
    model = ws.models[call.object]
    x, y, z = bin_pose.position
    rim = z + bin_model.bottom + bin_model.size[2]
    mouth = (0.0, 0.0, model.bottom + model.size[2])
    found = []
    for tip in tips:
        for azimuth in (2 * math.pi * i / azimuths for i in range(azimuths)):
            over = axis_rotation((math.cos(azimuth), math.sin(azimuth), 0.0), tip)
            for spin in SPINS:
                rotation: Quat = multiply(over, yaw_rotation(spin))
                dx, dy, dz = rotate(rotation, mouth)
                found += [
                    Pose((x + mx - dx, y + my - dy, rim + height - dz), rotation)
                    for mx, my in MOUTHS
                    for height in HEIGHTS
                ]
    return found
