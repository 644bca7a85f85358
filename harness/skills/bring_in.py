"""The last centimetres of a held object on a path: Dock into a frame, Hang on a peg.

`motion.route` takes things for upright cylinders, so that it finds no way out from between post and
peg of a rack. A `NarrowPassage` counts objects as the boxes that they are made of, arms as links.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from robospa.geometry import (
    Array,
    Pose,
    Vec3,
    axis_rotation,
    from_transform,
    multiply,
    rotate,
    yaw_rotation,
)
from robospa.harness.robots.kinematics import end_effector, forward, inverse
from robospa.harness.skills import clearance
from robospa.harness.skills import pick as grasping
from robospa.harness.skills.motion import line_poses, retreat_home, rise, route, travel
from robospa.harness.skills.place import grip_offset, place
from robospa.harness.skills.workspace import SkillFailed, Steps, Workspace, moved_back
from robospa.tasks.plan import Dock, Hang, Pick, Place

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
    pose = end_effector(ws.chains[arm], ws.joints[arm])
    ws.add(arm)
    ws.add(arm, gripper=1.0)
    away = moved_back(pose, rotate(pose.rotation, (1, 0, 0)), RETREAT)
    ws.follow(arm, ws.solve_path(arm, ws.joints[arm], line_poses(pose, away, 2)) or [])
    ws.held[arm] = None
    rise(ws, arm)


def put_down(ws: Workspace, arm: int, height: float) -> Steps:
    """Lower the object that the arm holds until its origin is at `height` [m], and release it."""
    name = ws.held[arm]
    if name is not None:
        here = end_effector(ws.chains[arm], ws.joints[arm])
        down = translated(here, (0.0, 0.0, height - ws.pose(name).position[2]))
        ws.follow(arm, ws.solve_path(arm, ws.joints[arm], line_poses(here, down, 2)) or [])
    release(ws, arm)
    yield from ws.flush()


def slide_out(ws: Workspace, arm: int, name: str, height: float) -> Steps:
    """Lower `name`, which jams in the open gripper, to `height` [m] and move out beside it.

    What widens upwards to the gripper's opening comes up with it.
    """
    here = end_effector(ws.chains[arm], ws.joints[arm])
    down = translated(here, (0.0, 0.0, height - ws.pose(name).position[2] - DEEPER))
    x, y, _ = rotate(here.rotation, (0.0, 0.0, 1.0))
    share = math.copysign(ASIDE / max(math.hypot(x, y), 1e-9), -y)
    for step in (share, -share):  # towards the robot first
        beside = translated(down, (x * step, y * step, 0.0))
        up = translated(beside, (0.0, 0.0, RETREAT))
        way = [p for a, b in pairwise((here, down, beside, up)) for p in line_poses(a, b, 2)]
        joints = ws.solve_path(arm, ws.joints[arm], way)
        if joints is not None:
            ws.follow(arm, joints)
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
    ws.follow(arm, path[1:])
    release(ws, arm)
    yield from ws.flush()


DOCK_ATTEMPTS = 3
DOCK_LIFT = 0.10
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

    def feasible(grasp: grasping.GraspCandidate) -> bool:
        offset = grasp.pose.inverse() * ws.pose(call.object)
        return approach_joints(ws, grasp.arm, offset, [goal], path, grasp.joints) is not None

    for _ in range(DOCK_ATTEMPTS):
        yield from grasping.pick(ws, Pick(call.object, DOCK_LIFT, call.arm), feasible)
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
        stop = None if free else detour_stop(NarrowPassage(ws, arm, call.on, offset), way[0])
        yield from bring_in(ws, arm, way, stop)
        here = np.array(ws.pose(call.object).position)
        if float(np.abs(here - np.array(frame.position)).max()) < CLOSE:
            return


HANG_ATTEMPTS = 5
HANG_LIFT = 0.14
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
    taken: list[grasping.GraspCandidate] = []
    for attempt in range(HANG_ATTEMPTS):
        last = attempt == HANG_ATTEMPTS - 1
        choices: tuple[list[Pose], ...] = (planned, allowed)
        x, y, z = ws.pose(call.object).position
        grasps = grasping.reachable_grasps(ws, call.object, grasping.arms_for(call.arm))
        filters = (
            _grasp_filter(ws, call, targets, paths, narrow, refused)
            for narrow, targets in product((True, False), (planned, allowed))
        )
        feasible = next((f for f in filters if any(f(grasp) for grasp in grasps)), None)
        taken.append(
            (yield from grasping.pick(ws, Pick(call.object, HANG_LIFT, call.arm), feasible, taken))
        )
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
        ws.follow(arm, way)
        yield from ws.flush(exactly=True)  # it comes to rest in its place before it is let go
        release(ws, arm)
        yield from ws.flush()
        off = np.subtract((ws.pose(call.object) * handle).position, peg.position)
        if (np.abs(off) < (ON_PEG, ON_PEG, DROP)).all():
            return


def _go_before_peg(ws: Workspace, call: Hang, arm: int, goal: Array) -> None:
    """Go to joints `goal`: straight, else around the peg's object, else on the usual way."""
    narrow, straight = _narrow(ws, call, arm), [ws.joints[arm], goal]
    if narrow.open(straight):
        ws.add(arm, goal)
        return
    stop = detour_stop(narrow, goal)
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


def _narrow(ws: Workspace, call: Hang, arm: int) -> NarrowPassage:
    """The way past the peg's object with what the arm holds, as it lies in the hand now."""
    return NarrowPassage(ws, arm, call.on, grip_offset(ws, arm, call.object))


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
        before = end_effector(ws.chains[arm], way[0])
        for out, up in product(DETOURS, DETOURS):
            x, y, z = rotate(peg.rotation, (0.0, -out, 0.0))
            stop = ws.solve(arm, translated(before, (x, y, z + up)), way[0])
            if stop is not None and narrow.open([here, stop, way[0]]):
                return [target], [stop, *way]
    return None


def _path(peg: Pose, out: float) -> list[Vec3]:
    """Shifts [m, world] from the object's place on the peg, from `out` [m] before it."""
    x, y, z = rotate(peg.rotation, (0.0, -out, 0.0))
    return [(x, y, z + SAG), (0.0, 0.0, SAG), (0.0, 0.0, 0.0)]


def _way(
    narrow: NarrowPassage,
    targets: list[Pose],
    paths: list[list[Vec3]],
    near: Array,
    only_free: bool,
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
) -> grasping.GraspFilter:
    """Accepts grasps from which a target is reachable, but for those `refused` in the hand."""
    body = ws.pose(call.object)

    def feasible(grasp: grasping.GraspCandidate) -> bool:
        offset = grasp.pose.inverse() * body
        if any(_alike(offset, other) for other in refused):
            return False
        narrow = NarrowPassage(ws, grasp.arm, call.on, offset)
        return _way(narrow, targets, paths, grasp.joints, only_free) is not None

    return feasible


def _targets(peg: Pose, handle: Pose, wobbles: tuple[float, ...]) -> list[Pose]:
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


STRIDE = 0.1
"""How far [rad] a joint turns at most between two places at which a way is looked at."""
MARGIN = 0.01
"""Room [m] between an arm and the object, at the least; half of it for fingers and palm."""


@dataclass(frozen=True)
class NarrowPassage:
    """Ways past `beside` for an arm that holds something at `offset` from its end effector."""

    ws: Workspace
    arm: int
    beside: str
    offset: Pose

    def free(self, way: list[Array]) -> bool:
        """Whether the arm keeps clear of the object on the lines between joints [rad] `way`."""
        line = _along(way)
        wide = clearance.part_boxes(self.ws.models[self.beside], self.ws.pose(self.beside), MARGIN)
        if (wide.depths(clearance.arm_points(self.ws, self.arm, line)) > 0).any():
            return False
        frames, _ = forward(self.ws.chains[self.arm], line)
        hand = self.ws.hand(self.arm)
        ends = [from_transform(frame) for frame in frames]
        parts = [
            (clearance.finger_points(hand, end, 0.0), clearance.palm_points(hand, end))
            for end in ends
        ]
        depths = wide.depths(np.stack([np.concatenate(both) for both in parts]))
        return not bool((depths > MARGIN / 2).any())

    def above_table(self, way: list[Array]) -> bool:
        """Whether what is held stays above the table on the lines between joints [rad] `way`."""
        frames, _ = forward(self.ws.chains[self.arm], _along(way))
        lowest = min((from_transform(f) * self.offset).position[2] for f in frames)
        return lowest > self.ws.scene.table_top + MARGIN

    def carried_past(self, way: list[Array]) -> bool:
        """Whether what is held keeps clear of the object on the lines between joints [rad] `way`.

        Both count as points in the boxes that they are made of.
        """
        bodies = self._carried(way)
        around = clearance.part_boxes(
            self.ws.models[self.beside], self.ws.pose(self.beside), MARGIN / 2
        )
        corners = around.points()
        return not any(around.depth(b.points()) > 0 or b.depth(corners) > 0 for b in bodies)

    def past_others(self, way: list[Array]) -> bool:
        """Whether arm and held object touch nothing but the object on these lines."""
        held = self.ws.held[self.arm]
        but = (self.beside,) if held is None else (self.beside, held)
        if (clearance.arm_depth(self.ws, self.arm, _along(way), *but) > clearance.TOUCH).any():
            return False
        others = clearance.standing(self.ws, *but)
        return not any(others.depth(body.points()) > 0 for body in self._carried(way))

    def open(self, way: list[Array]) -> bool:
        """Whether arm and held object keep clear of object and table on these lines."""
        return self.free(way) and self.above_table(way) and self.carried_past(way)

    def _carried(self, way: list[Array]) -> list[clearance.Boxes]:
        """The boxes of what is held, along the lines between joints [rad] `way`."""
        held = self.ws.held[self.arm]
        if held is None:
            return []
        frames, _ = forward(self.ws.chains[self.arm], _along(way))
        model = self.ws.models[held]
        return [
            clearance.part_boxes(model, from_transform(frame) * self.offset) for frame in frames
        ]


def _along(way: list[Array]) -> Array:
    """Joints (N, J) on the lines between those of `way`, with these."""
    lines = []
    for start, goal in pairwise(way):
        count = 2 + math.ceil(float(np.abs(goal - start).max()) / STRIDE)
        lines.append(start + (goal - start) * np.linspace(0.0, 1.0, count)[:, None])
    return np.concatenate(lines)


BACK, SIDEWAYS, UP = (
    (0.0, 0.06, 0.12, 0.18),
    (0.0, 0.06, -0.06, 0.12, -0.12),
    (0.0, 0.04, 0.08, 0.12),
)
"""How far [m] towards the robot, sideways and up from the start a stop may be."""


def detour_stop(narrow: NarrowPassage, goal: Array) -> Array | None:
    """Joints [rad] of a stop between here and joints `goal` with which the arm and what it holds
    get around the object of `narrow`, and past all else; None if there is none."""
    ws, arm = narrow.ws, narrow.arm
    start = ws.joints[arm]
    frames, _ = forward(ws.chains[arm], np.stack([start, goal]))
    here, there = (from_transform(frame) for frame in frames)
    x, y, z = here.position
    for back, aside, up in product(BACK, SIDEWAYS, UP):
        place = (x + aside, y - back, z + up)
        for rotation, near in ((here.rotation, start), (there.rotation, goal)):
            stop = ws.solve(arm, Pose(place, rotation), near)
            if stop is None:
                continue
            way = [start, stop, goal]
            if narrow.open(way) and narrow.past_others(way):
                return stop
    return None
