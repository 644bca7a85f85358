"""Touching from above: Press with the closed gripper, Stamp with an object, Hit with a tool."""

import math
from collections import Counter
from collections.abc import Generator
from functools import partial
from itertools import product

import numpy as np

from robospa.geometry import Array, Pose, Vec3, axis_rotation, look_rotation, rotate, yaw_rotation
from robospa.harness.robots.kinematics import inverse
from robospa.harness.skills import pick as grasping
from robospa.harness.skills import place as placing
from robospa.harness.skills.clearance import TOUCH, arm_depth, edge_depth
from robospa.harness.skills.motion import go, travel
from robospa.harness.skills.workspace import (
    SkillFailed,
    Steps,
    Workspace,
    max_gripper_y,
    moved_back,
    moved_up,
    wall_front,
)
from robospa.tasks.plan import Hit, Pick, Place, Press, Stamp
from robospa.tasks.snapshot import Snapshot

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
    wanted = grasping.arms_for(call.arm)
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


LIFT = 0.08
"""How high the object is lifted from where it stood [m]."""
PRESSED = 0.002
"""How far above the target's surface the object is brought [m]: nearer than it may be, to count."""
ATTEMPTS = 3


def stamp(ws: Workspace, call: Stamp) -> Steps:
    """All stamps with one grasp; the last one leaves the object on its target."""
    down = Place(call.object, on=call.on, drop=PRESSED, arm=call.arm)
    yield from grasping.pick(
        ws, Pick(call.object, LIFT, call.arm), partial(placing.can_follow, ws, down)
    )
    arm = ws.held.index(call.object)
    for _ in range(call.times - 1):
        offset = placing.grip_offset(ws, arm, call.object)
        found = placing.reachable_placements(
            ws, arm, offset, placing.place_targets(ws, down), call.lift, ws.joints[arm]
        )
        if not found:
            raise SkillFailed(f"{call.object} cannot be brought to {call.on}")
        travel(ws, arm, found[0].above)
        ws.add(arm, found[0].joints)
        ws.add(arm, found[0].above)
        yield from ws.flush()
    yield from placing.place(ws, down)


ABOVE = 0.07
"""Height [m] above an object from which the tool comes straight down."""
HIT_DEPTH = 0.003
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


def hit(ws: Workspace, call: Hit) -> Steps:
    """All hits with one grasp; where that does not do, the tool is put back and taken anew."""
    left = list(call.targets)
    home = ws.pose(call.tool)
    for _ in range(ATTEMPTS):
        yield from grasping.pick(ws, Pick(call.tool, LIFT, call.arm), _fitting(ws, call, left))
        arm = ws.held.index(call.tool)
        while left:
            done = yield from _strike(ws, arm, call.tool, left[0])
            if not done:
                break
            left.pop(0)
        if not left:
            return
        yield from placing.place(ws, _back(ws, arm, call.tool, home))
    raise SkillFailed(f"{call.tool} did not hit {left[0]} in {ATTEMPTS} grasps")


def _back(ws: Workspace, arm: int, tool: str, home: Pose) -> Place:
    w, _, _, z = home.rotation
    call = Place(tool, home.position, yaw=2 * math.atan2(z, w))
    offset = placing.grip_offset(ws, arm, tool)
    if placing.reachable_placements(
        ws, arm, offset, placing.place_targets(ws, call), ABOVE, ws.joints[arm]
    ):
        return call
    return Place(tool, home.position)


def _strike(ws: Workspace, arm: int, tool: str, name: str) -> Generator[Array, Snapshot, bool]:
    """Down on the object and up again; whether the head met its middle."""
    for k in range(TRIES):
        offset = placing.grip_offset(ws, arm, tool)
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


def _fitting(ws: Workspace, call: Hit, names: list[str]) -> grasping.GraspFilter:
    """Accepts grasps with SPARE placements on every object, or as many as the best grasp has."""

    def ways(grasp: grasping.GraspCandidate, tips: tuple[float, ...]) -> int:
        offset = grasp.pose.inverse() * ws.pose(call.tool)
        found = SPARE
        for name in names:
            if found:
                found = min(found, len(_spots(ws, grasp.arm, offset, call.tool, name, tips)))
        return found

    options = grasping.reachable_grasps(ws, call.tool, grasping.arms_for(call.arm))
    for tips in (LEVEL, LEVEL + TIPPED):
        best = 0
        for option in options:
            best = max(best, ways(option, tips))
            if best == SPARE:
                break
        if best:
            break
    return lambda grasp: ways(grasp, tips) >= best


def _spots(
    ws: Workspace, arm: int, offset: Pose, tool: str, name: str, tips: tuple[float, ...]
) -> list[placing.Placement]:
    """Ways to bring the tool's head onto the object, from all sides, tipped by `tips`."""
    x, y, z = (ws.pose(name) * ws.models[name].frames["press"]).position
    head = ws.models[tool].frames["head"].inverse()
    targets = [
        Pose((x, y, z - HIT_DEPTH + FACE * abs(math.sin(tip))), yaw_rotation(yaw))
        * Pose((0.0, 0.0, 0.0), axis_rotation((1.0, 0.0, 0.0), tip))
        * head
        for tip in tips
        for yaw in placing.YAWS
    ]
    return placing.reachable_placements(ws, arm, offset, targets, ABOVE, ws.joints[arm])
