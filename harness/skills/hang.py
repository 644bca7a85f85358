"""Hang: put an object by its handle onto a peg, along the peg, lower it and release it."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from robospa.geometry import (
    Pose,
    Vec3,
    axis_rotation,
    from_transform,
    multiply,
    rotate,
    yaw_rotation,
)
from robospa.harness.robots.kinematics import forward
from robospa.harness.skills.approach import approach_joints, release, translated
from robospa.harness.skills.around import stop_beside
from robospa.harness.skills.grasping import GraspCandidate, reachable_grasps
from robospa.harness.skills.motion import travel
from robospa.harness.skills.narrow import Narrow
from robospa.harness.skills.pick import GraspFilter, arms_for, pick
from robospa.harness.skills.place import grip_offset, place
from robospa.harness.skills.workspace import Array, Steps, Workspace
from robospa.tasks.plan import Hang, Pick, Place

ATTEMPTS = 5
LIFT = 0.14
OUTS = (0.085, 0.06)
"""How far before the peg's place the object comes in, along the peg [m], the better way first."""
SAG = 0.008
"""How far the handle is lowered onto the peg before the release [m]."""
SWINGS = (0.0, 0.25, -0.25, 0.5, -0.5, 0.75, -0.75)
"""Turns of the object about the peg [rad]."""
WOBBLES = (0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
"""Turns about the vertical [rad] at which the handle still fits over the peg."""
FAR_SWINGS = tuple(sign * 0.15 * n for n in range(10) for sign in ((1, -1) if n else (1,)))
FAR_WOBBLES = tuple(sign * 0.1 * n for n in range(5) for sign in ((1, -1) if n else (1,)))
"""Turns at which an object may still be hung when nothing else is left to try [rad]; it swings down
as it is let go."""
BEFORE_PEG = 2.5
"""Before the peg no joint turns by more [rad]: a wrist that turned over there would hit it."""
DETOURS = (0.0, 0.06, 0.12)
"""How much farther out along the peg, and higher, the object passes by on that way [m]."""
SIDES = (0.0, math.pi)
"""The handle fits from both sides."""
ON_PEG, DROP = 0.0195, 0.03
"""A handle this near to the peg's place in x and in y, and this little below it, hangs there [m]; a
mug that has swung around the peg is nearly so far."""

ALIKE = (0.03, 0.3)
"""A grip that differs by less, in [m] and in [rad], from one that led to nothing is not tried."""


def hang(ws: Workspace, call: Hang) -> Steps:
    """Pick, bring in along the peg, lower, release; again if it does not hang.

    Where no way is left, as after it has slipped in the hand, it is put back and taken otherwise.
    """
    peg = ws.pose(call.on) * ws.models[call.on].frames[call.frame]
    handle = ws.models[call.object].frames[call.handle]
    paths = [_path(peg, out) for out in OUTS]
    planned, allowed = _targets(peg, handle, (0.0,)), _targets(peg, handle, WOBBLES)
    refused: list[Pose] = []
    taken: list[GraspCandidate] = []
    for attempt in range(ATTEMPTS):
        last = attempt == ATTEMPTS - 1
        choices: tuple[list[Pose], ...] = (planned, allowed)
        x, y, z = ws.pose(call.object).position
        grasps = reachable_grasps(ws, call.object, arms_for(call.arm))
        filters = (
            _grasp_filter(ws, call, targets, paths, narrow, refused)
            for narrow, targets in product((True, False), (planned, allowed))
        )
        feasible = next((f for f in filters if any(f(grasp) for grasp in grasps)), None)
        taken.append((yield from pick(ws, Pick(call.object, LIFT, call.arm), feasible, taken)))
        arm = ws.held.index(call.object)
        gripped = grip_offset(ws, arm, call.object)
        way = _held_way(ws, call, arm, choices, paths)
        if way is None and last:
            far = _far_target(ws, call, arm, peg, _far_targets(peg, handle))
            if far is not None:
                choices, way = (far[0],), far[1]
        if way is not None:
            _go_before_peg(ws, call, arm, way[0])
            yield from ws.flush(exactly=True)
            in_now = _held_way(ws, call, arm, choices, paths, BEFORE_PEG)
            way = in_now or (way if last else None)
        if way is None:
            refused.append(gripped)
            yield from place(ws, Place(call.object, (x, y, z)))
            continue
        for joints in way:
            ws.add(arm, joints)
        yield from ws.flush(exactly=True)  # it comes to rest in its place before it is let go
        release(ws, arm)
        yield from ws.flush()
        if _hangs(ws.pose(call.object) * handle, peg):
            return


def _go_before_peg(ws: Workspace, call: Hang, arm: int, goal: Array) -> None:
    """Go to joints `goal`: straight, else around the peg's object, else on the usual way."""
    narrow, straight = _narrow(ws, call, arm), [ws.joints[arm], goal]
    if narrow.open(straight):
        ws.add(arm, goal)
        return
    stop = stop_beside(narrow, goal)
    if stop is not None:
        ws.add(arm, stop)
        ws.add(arm, goal)
    elif narrow.free(straight) and narrow.above_table(straight):
        ws.add(arm, goal)
    else:
        travel(ws, arm, goal)


def _alike(a: Pose, b: Pose) -> bool:
    """Whether an object lies in the hand at `a` nearly as it does at `b`."""
    away = a.inverse() * b
    return math.hypot(*away.position) < ALIKE[0] and abs(away.rotation[0]) > math.cos(ALIKE[1] / 2)


def _narrow(ws: Workspace, call: Hang, arm: int) -> Narrow:
    """The way past the peg's object with what the arm holds, as it lies in the hand now."""
    return Narrow(ws, arm, call.on, grip_offset(ws, arm, call.object))


def _held_way(
    ws: Workspace,
    call: Hang,
    arm: int,
    choices: tuple[list[Pose], ...],
    paths: list[list[Vec3]],
    farthest: float = math.inf,
) -> list[Array] | None:
    """Joints [rad] from before the peg to a target, for the object as it lies in the hand now; a
    free way if there is one, of the first `choices` that have one to whose beginning no joint turns
    by more than `farthest` [rad]."""
    narrow, near = _narrow(ws, call, arm), ws.joints[arm]
    for only_free, targets in product((True, False), choices):
        way = _way(narrow, targets, paths, near, only_free)
        if way is not None and float(np.abs(way[0] - near).max()) < farthest:
            return way
    return None


def _far_target(
    ws: Workspace, call: Hang, arm: int, peg: Pose, targets: list[Pose]
) -> tuple[list[Pose], list[Array]] | None:
    """The first of `targets` that arm and object come to past the peg's object, and the way."""
    narrow, here, paths = _narrow(ws, call, arm), ws.joints[arm], [_path(peg, o) for o in OUTS]
    for target in targets:
        way = _way(narrow, [target], paths, here, True)
        if way is None:
            continue
        frames, _ = forward(ws.chains[arm], way[0][None])
        before = from_transform(frames[0])
        for out, up in product(DETOURS, DETOURS):
            x, y, z = rotate(peg.rotation, (0.0, -out, 0.0))
            stop = ws.solve(arm, translated(before, (x, y, z + up)), way[0])
            if stop is not None and narrow.open([here, stop, way[0]]):
                return [target], [stop, *way]
    return None


def _hangs(handle: Pose, peg: Pose) -> bool:
    """Whether the middle of the handle is where it comes to rest on the peg."""
    (x, y, z), (px, py, pz) = handle.position, peg.position
    return max(abs(x - px), abs(y - py)) < ON_PEG and abs(z - pz) < DROP


def _path(peg: Pose, out: float) -> list[Vec3]:
    """Shifts [m, world] from the object's place on the peg, from `out` [m] before it."""
    x, y, z = rotate(peg.rotation, (0.0, -out, 0.0))
    return [(x, y, z + SAG), (0.0, 0.0, SAG), (0.0, 0.0, 0.0)]


def _way(
    narrow: Narrow, targets: list[Pose], paths: list[list[Vec3]], near: Array, only_free: bool
) -> list[Array] | None:
    """Joints [rad] of the first of `paths` that the arm can follow to one of `targets`."""
    free = narrow.free if only_free else None
    for path in paths:
        way = approach_joints(narrow.ws, narrow.arm, narrow.offset, targets, path, near, free)
        if way is not None:
            return way
    return None


def _grasp_filter(
    ws: Workspace,
    call: Hang,
    targets: list[Pose],
    paths: list[list[Vec3]],
    only_free: bool,
    refused: list[Pose],
) -> GraspFilter:
    """Accepts grasps from which a target is reachable, but for those `refused` in the hand."""
    body = ws.pose(call.object)

    def feasible(grasp: GraspCandidate) -> bool:
        offset = grasp.pose.inverse() * body
        if any(_alike(offset, other) for other in refused):
            return False
        narrow = Narrow(ws, grasp.arm, call.on, offset)
        return _way(narrow, targets, paths, grasp.joints, only_free) is not None

    return feasible


def _targets(peg: Pose, handle: Pose, wobbles: tuple[float, ...]) -> list[Pose]:
    """Poses of the object with the middle of its handle under the peg's place."""
    return [p for w in wobbles for s in SWINGS for p in _hung(peg, handle, s, w)]


def _far_targets(peg: Pose, handle: Pose) -> list[Pose]:
    """The same for turns that go farther, the least about the peg first."""
    return [p for s in FAR_SWINGS for w in FAR_WOBBLES for p in _hung(peg, handle, s, w)]


def _hung(peg: Pose, handle: Pose, swing: float, wobble: float) -> list[Pose]:
    """Poses of the object from both sides, turned by `swing` and `wobble` [rad]."""
    turn = multiply(yaw_rotation(wobble), axis_rotation((0.0, 1.0, 0.0), swing))
    turned = translated(peg * Pose((0.0, 0.0, 0.0), turn), (0.0, 0.0, -SAG))
    back = handle.inverse()
    return [turned * Pose((0.0, 0.0, 0.0), yaw_rotation(side)) * back for side in SIDES]
