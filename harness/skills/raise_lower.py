"""RaiseLower: lift an object and set it down where it was, again and again, with one arm or two.

Two arms take the object's "left" and "right" frames and move in the same small steps, so that it
stays level. Between the lifts the grippers open where they are: nothing has to be approached anew.
"""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from robospa.action_space import ARMS
from robospa.geometry import Array
from robospa.harness.skills.motion import at_once, go, line_poses, rise, travel
from robospa.harness.skills.pick import LEANS, LEVEL, GraspCandidate, reachable_grasps
from robospa.harness.skills.workspace import SkillFailed, Steps, Workspace, moved_back, moved_up
from robospa.tasks.plan import RaiseLower

STANDOFF = 0.08
ATTEMPTS = 4
PIECE = 0.034
"""Two arms lift in pieces no longer than this [m]: both arrive before either goes on."""
AT_HANDLE = 0.015
"""A grasp this near to a frame [m] is a grasp of it."""
LESS = 0.8, 0.6
"""Shares of the lift and of STANDOFF that do where an arm reaches no farther."""
SHARE = 0.6
"""Share of the lift that the object must follow, or the grasp has failed."""


class ArmLift:
    """One arm's way to its grasp and from there up: joints, and how wide to open."""

    def __init__(self, reach: GraspCandidate, way_in: list[Array], way_up: list[Array]) -> None:
        self.arm = reach.arm
        self.opening = reach.opening
        self.way_in = way_in
        self.at = reach.joints
        self.way_up = way_up


def raise_lower(ws: Workspace, call: RaiseLower) -> Steps:
    """All cycles; SkillFailed if the object does not come along in a few attempts."""
    arms = tuple(ARMS.index(name) for name in call.arms)
    done, tried = 0, 0
    while done < call.times:
        holds = [_plan_lift(ws, call, arm, len(arms) > 1, tried) for arm in arms]
        yield from _approach(ws, holds)
        while done < call.times:
            before = ws.pose(call.object).position[2]
            _grip(ws, holds, [0.0] * len(holds))
            ws.add(holds[0].arm)
            for step in zip(*(hold.way_up for hold in holds), strict=True):
                _together(ws, holds, step)
            yield from ws.flush()
            followed = ws.pose(call.object).position[2] - before > SHARE * call.rise
            for step in zip(*([*hold.way_up[-2::-1], hold.at] for hold in holds), strict=True):
                _together(ws, holds, step)
            _grip(ws, holds, [hold.opening for hold in holds])
            yield from ws.flush()
            if not followed:
                break
            done += 1
        if done < call.times:
            tried += 1
            if tried == ATTEMPTS:
                raise SkillFailed(f"{call.object} could not be lifted in {ATTEMPTS} attempts")
            for hold in holds:
                rise(ws, hold.arm)
            yield from ws.flush()
    for hold in holds:
        ws.gripper[hold.arm] = 1.0
    _together(ws, holds, [hold.way_in[0] for hold in holds])
    yield from ws.flush()


def _approach(ws: Workspace, holds: Sequence[ArmLift]) -> Steps:
    if len(holds) == 1:
        go(ws, holds[0].arm, holds[0].way_in[0], holds[0].opening)
    else:
        set_out = {hold.arm: partial(_set_out, ws, hold) for hold in holds}
        at_once(ws, [set_out[arm] for arm in range(len(ARMS))])
    for step in zip(*(hold.way_in[1:] for hold in holds), strict=True):
        _together(ws, holds, step)
    _together(ws, holds, [hold.at for hold in holds])
    yield from ws.flush()


def _set_out(ws: Workspace, hold: ArmLift) -> None:
    ws.gripper[hold.arm] = hold.opening
    travel(ws, hold.arm, hold.way_in[0])


def _together(ws: Workspace, holds: Sequence[ArmLift], joints: Sequence[Array]) -> None:
    for hold, goal in zip(holds, joints, strict=True):
        ws.joints[hold.arm] = np.asarray(goal, dtype=float)
    ws.add(holds[0].arm)


def _grip(ws: Workspace, holds: Sequence[ArmLift], openings: Sequence[float]) -> None:
    for hold, opening in zip(holds, openings, strict=True):
        ws.gripper[hold.arm] = opening
    ws.add(holds[0].arm)


def _plan_lift(ws: Workspace, call: RaiseLower, arm: int, framed: bool, skip: int) -> ArmLift:
    """The best way to take and lift the object, the `skip` best left out.

    What one arm lifts is rather taken by the other, or lifted less high, than taken by a leaning
    gripper: that turns it, so that it comes down beside its place.
    """
    pieces = max(2, math.ceil(call.rise / PIECE)) if framed else 2
    whole, less = (call.rise, STANDOFF), (LESS[0] * call.rise, LESS[1] * STANDOFF)
    ways = [(arm, LEVEL, whole), (arm, LEANS, whole)]
    if not framed:
        ways[1:1] = [(1 - arm, LEVEL, whole), (arm, LEVEL, less), (1 - arm, LEVEL, less)]
    for taker, leans, (height, standoff) in ways:
        for reach in reachable_grasps(ws, call.object, (taker,), leans):
            if framed and not _at_frame(ws, call.object, ARMS[arm], reach):
                continue
            out = moved_back(reach.pose, reach.approach, standoff)
            back = ws.solve_path(taker, reach.joints, line_poses(reach.pose, out, 2))
            top = moved_up(reach.pose, height)
            up = ws.solve_path(taker, reach.joints, line_poses(reach.pose, top, pieces))
            if back is not None and up is not None:
                if skip == 0:
                    return ArmLift(reach, back[::-1], up)
                skip -= 1
    raise SkillFailed(f"the {ARMS[arm]} arm finds no grasp of {call.object} to lift it with")


def _at_frame(ws: Workspace, name: str, frame: str, reach: GraspCandidate) -> bool:
    ahead = ws.hand(reach.arm).grip
    x, y, z = reach.pose.position
    dx, dy, dz = reach.approach
    centre = (x + ahead * dx, y + ahead * dy, z + ahead * dz)
    handle = ws.pose(name) * ws.models[name].frames[frame]
    return math.dist(centre, handle.position) < AT_HANDLE
