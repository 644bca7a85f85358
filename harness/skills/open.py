"""Open: take a door by its handle and pull it along its arc; look how far it came, and go on.

The gripper closes across the handle, tipped down from level so that wrist and forearm stay clear
of the table, and turns with the door by a share of its angle: a round handle lets it.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from robospa.geometry import Array, Pose, axis_rotation, multiply, rotate
from robospa.harness.robots.kinematics import inverse
from robospa.harness.skills.clearance import TOUCH, arm_depth
from robospa.harness.skills.motion import go, line_poses, rise
from robospa.harness.skills.pick import arms_for
from robospa.harness.skills.workspace import SkillFailed, Steps, Workspace, moved_back
from robospa.tasks.plan import Open
from robospa.tasks.shapes import Hinge

TIPS = (0.5, 0.35, 0.65, 0.2, 0.8)
"""How far the gripper points down from level [rad], best first."""
SHARES = (0.5, 0.7, 0.3, 1.0)
"""Shares of the door's turn that the gripper makes."""
AHEAD = (0.0, 0.25, -0.25)
"""Turn about the hinge's axis [rad] that the gripper has when it takes the handle."""
PIECE = 0.28
"""Turn of the door between two actions [rad]: on the chord the handle is 1.5 mm off its arc."""
OPENING = 0.05
"""How wide the fingers open around a handle [m]."""
HOLD = 0.007
"""Most that the fingertips reach beyond the middle of a handle [m]: behind it is the door."""
STANDOFF = 0.07
ATTEMPTS = 3


@dataclass(frozen=True)
class Pull:
    """One way to do it: the arm, joints before the handle, at it, and along the arc."""

    arm: int
    before: Array
    at: Array
    arc: list[Array]
    approach_last: tuple[float, float, float]
    last: Pose


def pull_open(ws: Workspace, call: Open) -> Steps:
    """Grasp, pull, let go, back off; SkillFailed if the door stays too far closed."""
    hinge = ws.models[call.object].hinge
    if hinge is None or "handle" not in ws.models[call.object].frames:
        raise SkillFailed(f"{call.object} has no door with a handle")
    goal = call.to * hinge.upper
    for left in reversed(range(ATTEMPTS)):
        ways = _ways(ws, call, hinge)
        way = next(ways, None) if left else _clear(ws, ways)
        if way is None:
            break
        yield from _pull(ws, way)
        if ws.snapshot.hinges[call.object] > goal - 0.1 * hinge.upper:
            return
    raise SkillFailed(f"no arm could open {call.object} to {goal:.2f} rad")


def _pull(ws: Workspace, way: Pull) -> Steps:
    arm = way.arm
    go(ws, arm, way.before, ws.robot.arms[arm].gripper_value(OPENING))
    ws.add(arm, way.at)
    ws.add(arm, gripper=0.0)
    ws.follow(arm, way.arc)
    ws.add(arm, gripper=1.0)
    away = moved_back(way.last, way.approach_last, STANDOFF)
    ws.follow(arm, ws.solve_path(arm, way.arc[-1], line_poses(way.last, away, 2)) or ())
    rise(ws, arm)
    yield from ws.flush(exactly=True)


def _ways(ws: Workspace, call: Open, hinge: Hinge) -> Iterator[Pull]:
    body = ws.pose(call.object)
    handle = ws.models[call.object].frames["handle"]
    angle = ws.snapshot.hinges[call.object]
    goal = call.to * hinge.upper
    count = max(1, math.ceil((goal - angle) / PIECE))
    angles = [angle + (goal - angle) * i / count for i in range(count + 1)]
    at = [body * hinge.turned(a) * handle for a in angles]
    axis = rotate(body.rotation, hinge.axis)
    first = at[0]
    across = rotate(first.rotation, (0.0, 1.0, 0.0))
    down = (
        1.0
        if rotate(axis_rotation(across, 0.5), rotate(first.rotation, (1, 0, 0)))[2] < 0
        else -1.0
    )
    arms = arms_for(call.arm)
    for arm, share, ahead, tip, flip in product(arms, SHARES, AHEAD, TIPS, (0.0, math.pi)):
        reach = ws.hand(arm).tip - min(ws.hand(arm).hold, HOLD)
        poses, approach = [], (0.0, 0.0, 0.0)
        for a, spot in zip(angles, at, strict=True):
            turn = axis_rotation(axis, ahead + share * (a - angle))
            rotation = multiply(turn, multiply(axis_rotation(across, down * tip), first.rotation))
            rotation = multiply(rotation, axis_rotation((1.0, 0.0, 0.0), flip))
            approach = rotate(rotation, (1.0, 0.0, 0.0))
            poses.append(moved_back(Pose(spot.position, rotation), approach, reach))
        start = moved_back(poses[0], rotate(poses[0].rotation, (1.0, 0.0, 0.0)), STANDOFF)
        joints = _in_one_go(ws, arm, [start, *poses])
        if joints is not None:
            yield Pull(arm, joints[0], joints[1], joints[2:], approach, poses[-1])


def _clear(ws: Workspace, ways: Iterable[Pull]) -> Pull | None:
    """The first way on which the arm itself is in nothing; without one, the first; None of none."""
    first: Pull | None = None
    for way in ways:
        first = first or way
        if arm_depth(ws, way.arm, np.stack([way.before, way.at, *way.arc])).max() <= TOUCH:
            return way
    return first


def _in_one_go(ws: Workspace, arm: int, poses: list[Pose]) -> list[Array] | None:
    """Joints along `poses` without a change of posture in between; None if there are none.

    Where an arm has several postures for a pose, each pose by itself may get another one: between
    them the hand would leave the arc.
    """
    joints, ok = inverse(ws.chains[arm], poses)
    if not ok.all():
        return None
    onward = ws.solve_path(arm, joints[0], poses)
    if onward is not None:
        return onward
    back = ws.solve_path(arm, joints[-1], poses[::-1])
    return None if back is None else back[::-1]
