"""Hit: take a tool and bring its head down on one object after the other."""

from __future__ import annotations

import math
from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, axis_rotation, rotate, yaw_rotation
from robospa.harness.skills.grasping import GraspCandidate, reachable_grasps
from robospa.harness.skills.motion import travel
from robospa.harness.skills.pick import GraspFilter, arms_for, pick
from robospa.harness.skills.place import (
    YAWS,
    Placement,
    grip_offset,
    place,
    place_targets,
    reachable_placements,
)
from robospa.harness.skills.workspace import SkillFailed, Steps, Workspace
from robospa.tasks.plan import Hit, Pick, Place
from robospa.tasks.snapshot import Snapshot

Array = NDArray[np.float64]

LIFT = 0.08
"""How high the tool is lifted from where it lay [m]."""
ABOVE = 0.07
"""Height [m] above an object from which the tool comes straight down."""
DEPTH = 0.003
"""How far the head is told to go into the object [m], so that it is sure to touch."""
MISSED = (0.015, 0.0025)
"""A head that came down farther [m] from the middle, in x or y, or higher has to come again."""
TRIES = 2
"""How often one grasp is tried on one object."""
SPARE = 2
"""A grasp should leave at least so many ways to every object."""
LEVEL, TIPPED = (0.0,), (0.2, -0.2, 0.4, -0.4, 0.6, -0.6)
"""Turns of the tool about its x axis [rad] with which it hits; tipped where a level one is out of
reach, as after it has turned in the hand."""
FACE = 0.025
"""How far the edge of a striking face is from its middle, along y [m]: what is tipped hits with it.
"""
ATTEMPTS = 3


def hit(ws: Workspace, call: Hit) -> Steps:
    """All hits with one grasp; where that does not do, the tool is put back and taken anew."""
    left = list(call.targets)
    home = ws.pose(call.tool)
    for _ in range(ATTEMPTS):
        yield from pick(ws, Pick(call.tool, LIFT, call.arm), _fitting(ws, call, left))
        arm = ws.held.index(call.tool)
        while left:
            done = yield from _strike(ws, arm, call.tool, left[0])
            if not done:
                break
            left.pop(0)
        if not left:
            return
        yield from place(ws, _back(ws, arm, call.tool, home))
    raise SkillFailed(f"{call.tool} did not hit {left[0]} in {ATTEMPTS} grasps")


def _back(ws: Workspace, arm: int, tool: str, home: Pose) -> Place:
    """The call that puts the tool back: turned as it lay, if that can be done."""
    w, _, _, z = home.rotation
    call = Place(tool, home.position, yaw=2 * math.atan2(z, w))
    offset = grip_offset(ws, arm, tool)
    if reachable_placements(ws, arm, offset, place_targets(ws, call), ABOVE, ws.joints[arm]):
        return call
    return Place(tool, home.position)


def _strike(ws: Workspace, arm: int, tool: str, name: str) -> Generator[Array, Snapshot, bool]:
    """Down on the object and up again; whether the head met its middle."""
    for k in range(TRIES):
        offset = grip_offset(ws, arm, tool)
        level = _spots(ws, arm, offset, tool, name, LEVEL)
        found = level or _spots(ws, arm, offset, tool, name, TIPPED)
        if len(found) <= k:
            return False
        travel(ws, arm, found[k].above)
        yield from ws.flush()
        ws.add(arm, found[k].joints)
        yield from ws.flush()
        head = np.array(ws.pose(tool).apply(ws.models[tool].frames["head"].position))
        goal = np.array(ws.pose(name).apply(ws.models[name].frames["press"].position))
        ws.add(arm, found[k].above)
        yield from ws.flush()
        edge = 0.0 if level else FACE * abs(rotate(ws.pose(tool).rotation, (0, 1, 0))[2])
        if np.abs(head - goal)[:2].max() < MISSED[0] and head[2] - edge - goal[2] < MISSED[1]:
            return True
    return False


def _fitting(ws: Workspace, call: Hit, names: list[str]) -> GraspFilter:
    """Accepts grasps with SPARE placements on every object, or as many as the best grasp has."""

    def ways(grasp: GraspCandidate, tips: tuple[float, ...]) -> int:
        offset = grasp.pose.inverse() * ws.pose(call.tool)
        found = SPARE
        for name in names:
            if found:
                found = min(found, len(_spots(ws, grasp.arm, offset, call.tool, name, tips)))
        return found

    options = reachable_grasps(ws, call.tool, arms_for(call.arm))
    for tips in (LEVEL, LEVEL + TIPPED):
        best = 0
        for option in options:
            best = max(best, ways(option, tips))
            if best == SPARE:
                break
        if best:
            break
    return lambda grasp: ways(grasp, tips) >= best


def _targets(ws: Workspace, tool: str, name: str, tips: tuple[float, ...]) -> list[Pose]:
    """Poses of the tool, tipped by `tips`, whose head is on the object, from all sides."""
    x, y, z = (ws.pose(name) * ws.models[name].frames["press"]).position
    head = ws.models[tool].frames["head"].inverse()
    return [
        Pose((x, y, z - DEPTH + FACE * abs(math.sin(tip))), yaw_rotation(yaw))
        * Pose((0.0, 0.0, 0.0), axis_rotation((1.0, 0.0, 0.0), tip))
        * head
        for tip in tips
        for yaw in YAWS
    ]


def _spots(
    ws: Workspace, arm: int, offset: Pose, tool: str, name: str, tips: tuple[float, ...]
) -> list[Placement]:
    targets = _targets(ws, tool, name, tips)
    return reachable_placements(ws, arm, offset, targets, ABOVE, ws.joints[arm])
