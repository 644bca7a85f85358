"""Pick and RaiseLower, and the grasps of an object: its model's, tilted, tested for reach and room.

Every candidate is an end-effector pose for one arm. Inverse kinematics runs on all of them at once;
what is left is ranked by tilt, by room for the fingers and by how far the arm has to go.
"""

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from robospa.action_space import ARMS
from robospa.geometry import (
    Array,
    Pose,
    Vec3,
    axis_rotation,
    look_rotation,
    multiply,
    rotate,
    to_matrix,
)
from robospa.harness.robots.kinematics import inverse
from robospa.harness.skills import clearance
from robospa.harness.skills.motion import (
    at_once,
    go,
    line_poses,
    retreat_home,
    rise,
    route,
    travel,
)
from robospa.harness.skills.workspace import (
    SkillFailed,
    Steps,
    Workspace,
    max_gripper_y,
    moved_back,
    moved_up,
    wall_front,
)
from robospa.tasks.plan import Pick, RaiseLower
from robospa.tasks.shapes import Box, Cylinder, Grasp, ObjectModel, Shape
from robospa.tasks.snapshot import Snapshot
from robospa.workcell import Gripper

TILTS = (0.0, 0.2, -0.2, 0.4, -0.4, 0.6, -0.6, 0.8, -0.8, 1.0, -1.0, 1.2, -1.2)
LEVEL = (0.0,)
LEANS = (0.0, 0.2, -0.2, 0.4, -0.4)
"""Sideways leans of the gripper [rad], tried when nothing else reaches."""
OPENING_MARGINS = (0.022, 0.014, 0.008)
"""How much wider than the object the fingers open [m]; less where they would be in a part of it
(between a pot and its handle)."""
SPARE_OPENING = 0.01
"""What a tipped body is grasped across is narrower than the opening by this [m]."""
TABLE_CLEARANCE = 0.003
TOO_THIN = 1.0
"""Cost of a part that is thinner than the gap of closed fingers: they hold it only if it slopes."""
WRONG_SIDE = 0.6
"""Cost of using the arm on the other side of the table."""


@dataclass(frozen=True)
class GraspCandidate:
    """A grasp that the arm can take: end-effector pose, its joints, and the gripper value 0..1 to
    come with; `depth` is how deep [m] arm or hand would be in other things."""

    arm: int
    pose: Pose
    approach: Vec3
    joints: Array
    opening: float
    cost: float
    tilt: float
    depth: float


def upright(pose: Pose) -> bool:
    """True if the body's z axis points up within 25 degrees."""
    return rotate(pose.rotation, (0, 0, 1))[2] > 0.9


def world_grasps(model: ObjectModel, pose: Pose, hand: Gripper) -> tuple[Grasp, ...]:
    """The model's grasps in the world; for a body that has tipped over, one across its axis."""
    if upright(pose):
        return tuple(
            Grasp(
                pose.apply(g.point),
                rotate(pose.rotation, g.approach),
                rotate(pose.rotation, g.closing),
                g.width,
                g.tilt,
            )
            for g in model.grasps
        )
    middle = Pose((0.0, 0.0, model.bottom + model.size[2] / 2))
    whole = _level_grasps(pose * middle, model.size, hand.opening - SPARE_OPENING)
    widest = max((g.width for g in model.grasps), default=0.0)
    limit = max(hand.opening - SPARE_OPENING, widest + 1e-6)
    return whole or tuple(
        grasp
        for shape in model.shapes
        if shape.collision and (size := _part_size(shape)) is not None
        for grasp in _level_grasps(pose * shape.pose, size, limit)
    )


def _part_size(shape: Shape) -> Vec3 | None:
    """Size [m] of a box or a cylinder along its axes; None for another form."""
    form = shape.geometry
    if isinstance(form, Box):
        return (2 * form.half[0], 2 * form.half[1], 2 * form.half[2])
    if isinstance(form, Cylinder):
        return (2 * form.radius, 2 * form.radius, 2 * form.half_length)
    return None


def _level_grasps(pose: Pose, size: Vec3, limit: float) -> tuple[Grasp, ...]:
    """Grasps from above across the level axes of a body of `size`, centred at `pose`, that are
    shorter than `limit`; across a lying one's length if it has rolled to where no other is level.
    """
    axes = to_matrix(pose.rotation)
    flat = np.abs(axes[2]) < 0.5
    across = [(axes[:, i], size[i]) for i in range(3) if flat[i]]
    if flat[2] and not flat[:2].any():
        level = np.cross((0.0, 0.0, 1.0), axes[:, 2])
        across.append((level / np.linalg.norm(level), max(size[:2])))
    down = (0.0, 0.0, -1.0)
    return tuple(
        Grasp(pose.position, down, tuple(closing.tolist()), width, 0.6)
        for closing, width in across
        if width < limit
    )


def candidate_poses(
    grasp: Grasp, hand: Gripper, table_top: float, leans: tuple[float, ...] = LEVEL
) -> list[tuple[Pose, Vec3, float]]:
    """End-effector poses for one grasp: both finger orders, all tilts that it allows.

    The fingers stay clear of a table of height `table_top` [m]. `leans` turn the gripper about the
    approach's other side, so that one finger comes lower.
    """
    found = []
    reach = hand.grip
    across = np.cross(grasp.approach, grasp.closing)
    for lean in leans:
        leaning = axis_rotation(across, lean)
        for tilt in TILTS:
            if abs(tilt) > grasp.tilt + 1e-9:
                continue
            turn = multiply(leaning, axis_rotation(grasp.closing, tilt))
            approach = rotate(turn, grasp.approach)
            if approach[2] > -0.05:
                continue
            closing = rotate(leaning, grasp.closing)
            slope = math.sqrt(max(0.0, 1 - approach[2] ** 2))
            lowest = hand.hold * -approach[2] + hand.finger_half_width * slope
            lowest += abs(closing[2]) * (grasp.width / 2 + hand.finger_thickness)
            x, y, z = grasp.point
            z = max(z, table_top + TABLE_CLEARANCE + lowest)
            position = (x - approach[0] * reach, y - approach[1] * reach, z - approach[2] * reach)
            for sign in (1.0, -1.0):
                facing = (sign * closing[0], sign * closing[1], sign * closing[2])
                pose = Pose(position, look_rotation(approach, facing))
                found.append((pose, approach, abs(tilt) + 2 * abs(lean)))
    return found


def _fitting_opening(
    hand: Gripper, pose: Pose, width: float, own: clearance.Boxes
) -> tuple[float, float]:
    """How deep [m] the fingers are in the object's own boxes, and at what opening [m]."""
    best = (math.inf, 0.0)
    for margin in OPENING_MARGINS:
        opening = min(hand.opening, width + margin)
        depth = own.depth(clearance.finger_points(hand, pose, opening))
        if depth < best[0]:
            best = (depth, opening)
        if depth == 0.0:
            break
    return best


def reachable_grasps(
    ws: Workspace, name: str, arms: tuple[int, ...], leans: tuple[float, ...] = LEVEL
) -> list[GraspCandidate]:
    """All grasps of `name` that one of `arms` can take now, best first."""
    model = ws.models[name]
    body = ws.pose(name)
    near, own, whole = (
        clearance.neighbours(ws, name),
        clearance.own_boxes(model, body),
        clearance.bounding_box(model, body),
    )
    front = wall_front(ws)
    found: list[GraspCandidate] = []
    for arm in arms:
        hand, home = ws.hand(arm), ws.robot.arms[arm].home
        poses: list[tuple[Pose, Vec3, float, float]] = []
        for grasp in world_grasps(model, body, hand):
            found_poses = candidate_poses(grasp, hand, ws.scene.table_top, leans)
            poses += [(*c, grasp.width) for c in found_poses]
        if not poses:
            continue
        joints, ok = inverse(ws.chains[arm], [p[0] for p in poses])
        wrong = WRONG_SIDE if (body.position[0] > 0) != (arm == 1) else 0.0
        if abs(body.position[0]) < 0.04:
            wrong *= abs(body.position[0]) / 0.04
        reached = np.flatnonzero(ok)
        arm_in = clearance.arm_depth(ws, arm, joints[reached], name)
        for i, blocked in zip(reached, arm_in.tolist(), strict=True):
            pose, approach, tilt, width = poses[i]
            inside, opening = _fitting_opening(hand, pose, width, own)
            palm = clearance.palm_points(hand, pose)
            around = np.concatenate([clearance.finger_points(hand, pose, opening), palm])
            others = max(near.depth(around), blocked)
            depth = max(inside, whole.depth(palm), others)
            turned = joints[i] - home  # of the last two joints: how far hand and wrist turn
            roll = abs(float(turned[-1])) + 0.5 * abs(float(turned[-2]))
            depth = max(depth, max_gripper_y(pose, hand) - front)
            thin = TOO_THIN if width <= hand.gap else 0.0
            cost = wrong + thin + 0.5 * tilt + 0.25 * roll + 60.0 * depth
            value = ws.robot.arms[arm].gripper_value(opening)
            found.append(GraspCandidate(arm, pose, approach, joints[i], value, cost, tilt, others))
    return sorted(found, key=lambda r: r.cost)


GraspFilter = Callable[[GraspCandidate], bool]
"""True for a grasp from which the next motion is possible."""

STANDOFF = 0.08
ATTEMPTS = 5
PULLS = (0.0, 0.05, 0.1, 0.15)
"""How far a lift may come towards the arm's base where straight up is out of reach [m]."""
Choice = tuple[GraspCandidate, list[Array], list[Array]]
"""A grasp, and joints of the way in and of the lift."""
ROUTES = 12
"""To how many of the best grasps a free way is looked for."""
LOOKAHEAD = 80
"""How many of the best grasps are tested with the filter."""


def arms_for(call_arm: str | None) -> tuple[int, ...]:
    """Indices of the arms that a call allows: its own, or both."""
    return (0, 1) if call_arm is None else (ARMS.index(call_arm),)


def pick(
    ws: Workspace,
    call: Pick,
    feasible: GraspFilter | None = None,
    but: Sequence[GraspCandidate] = (),
) -> Generator[Array, Snapshot, GraspCandidate]:
    """Grasp and lift, preferring grasps that `feasible` accepts; SkillFailed after ATTEMPTS.

    One like those of `but` is taken only if there is no other. Returns the grasp that held.
    """
    tried = list(but)
    for _ in range(ATTEMPTS):
        choice, way_in, way_up = _choose(ws, call, tried, feasible)
        tried.append(choice)
        before = ws.pose(call.object).position[2]
        arm = choice.arm
        go(ws, arm, way_in[0], choice.opening)
        ws.follow(arm, way_in[1:])
        ws.add(arm, gripper=0.0)
        ws.add(arm)
        ws.follow(arm, way_up)
        yield from ws.flush()
        if ws.pose(call.object).position[2] - before > 0.4 * call.lift:
            ws.held[arm] = call.object
            return choice
        ws.add(arm, gripper=1.0)
        rise(ws, arm)
        retreat_home(ws, arm)
        yield from ws.flush()
    raise SkillFailed(f"{call.object} could not be lifted in {ATTEMPTS} attempts")


def _choose(
    ws: Workspace, call: Pick, tried: list[GraspCandidate], feasible: GraspFilter | None
) -> Choice:
    """The best grasp not yet tried, with the joints of the way in and of the lift.

    One to which the way is free, to its start and straight in from there, if there is any among
    the best ROUTES that are feasible; else one to whose start it is free. A hand that only picks
    may push a neighbour aside, and its level grasps hold best; one that goes on to place must leave
    towers and rows as they are, so it leans before it touches anything.
    """
    arms = tuple(a for a in arms_for(call.arm) if ws.held[a] is None)
    spare: Choice | None = None
    obstructed: list[tuple[bool, Choice]] = []
    for leans in (LEVEL, LEANS):
        options = reachable_grasps(ws, call.object, arms, leans)
        fresh = [o for o in options if not any(_same_grasp(o, t) for t in tried)]
        looked_at = 0
        for option in (fresh or options)[: LOOKAHEAD + 1]:
            out = moved_back(option.pose, option.approach, STANDOFF)
            back = ws.solve_path(option.arm, option.joints, line_poses(option.pose, out, 2))
            up = _lift(ws, call, option) if back is not None else None
            if back is None or up is None:
                continue
            found = (option, [*reversed(back), option.joints], up)
            if feasible is not None and not feasible(option):
                spare = spare or found
                continue
            free = route(ws, option.arm, back[-1]).free
            touches = (
                clearance.arm_depth(ws, option.arm, np.stack(back), call.object).max()
                > clearance.TOUCH
            )
            touches |= feasible is not None and option.depth > clearance.TOUCH
            if free and not touches:
                return found
            obstructed.append((not free, found))
            looked_at += 1
            if looked_at == ROUTES:
                break
        if obstructed and feasible is None:
            break
    if obstructed:
        return min(obstructed, key=lambda way: way[0])[1]
    if spare is not None:
        return spare
    raise SkillFailed(f"no arm can reach {call.object} at {ws.pose(call.object).position}")


def _lift(ws: Workspace, call: Pick, option: GraspCandidate) -> list[Array] | None:
    """Joints of the way up: straight, or towards the arm's base where that is out of reach."""
    x, y, z = option.pose.position
    base = ws.robot.arms[option.arm].base.position
    away = math.hypot(x - base[0], y - base[1])
    for pull in PULLS:
        end = Pose(
            (x + (base[0] - x) * pull / away, y + (base[1] - y) * pull / away, z + call.lift),
            option.pose.rotation,
        )
        up = ws.solve_path(option.arm, option.joints, line_poses(option.pose, end, 2))
        if up is not None:
            return up
    return None


def _same_grasp(a: GraspCandidate, b: GraspCandidate) -> bool:
    turned = min(
        math.dist(a.pose.rotation, b.pose.rotation),
        math.dist(a.pose.rotation, tuple(-c for c in b.pose.rotation)),
    )
    return a.arm == b.arm and turned < 0.1 and math.dist(a.pose.position, b.pose.position) < 0.01


LIFT_ATTEMPTS = 4
PIECE = 0.034
"""Two arms lift in pieces no longer than this [m]: both arrive before either goes on."""
AT_HANDLE = 0.015
"""A grasp this near to a frame [m] is a grasp of it."""
LESS = 0.8, 0.6
"""Shares of the lift and of STANDOFF that do where an arm reaches no farther."""
SHARE = 0.6
"""Share of the lift that the object must follow, or the grasp has failed."""


def raise_lower(ws: Workspace, call: RaiseLower) -> Steps:
    """Lift and set down where it was, again and again; SkillFailed if the object does not come
    along in a few attempts.

    Two arms take the object's "left" and "right" frames and move in the same small steps, so that
    it stays level. Between the lifts the grippers open where they are.
    """
    arms = tuple(ARMS.index(name) for name in call.arms)
    done, tried = 0, 0
    while done < call.times:
        holds = [_plan_lift(ws, call, arm, len(arms) > 1, tried) for arm in arms]
        yield from _approach(ws, holds)
        while done < call.times:
            before = ws.pose(call.object).position[2]
            _grip(ws, holds, [0.0] * len(holds))
            ws.add(holds[0][0].arm)
            for step in zip(*(way_up for _, _, way_up in holds), strict=True):
                _together(ws, holds, step)
            yield from ws.flush()
            followed = ws.pose(call.object).position[2] - before > SHARE * call.rise
            for step in zip(*([*up[-2::-1], grasp.joints] for grasp, _, up in holds), strict=True):
                _together(ws, holds, step)
            _grip(ws, holds, [grasp.opening for grasp, _, _ in holds])
            yield from ws.flush()
            if not followed:
                break
            done += 1
        if done < call.times:
            tried += 1
            if tried == LIFT_ATTEMPTS:
                raise SkillFailed(f"{call.object} could not be lifted in {tried} attempts")
            for grasp, _, _ in holds:
                rise(ws, grasp.arm)
            yield from ws.flush()
    for grasp, _, _ in holds:
        ws.gripper[grasp.arm] = 1.0
    _together(ws, holds, [way_in[0] for _, way_in, _ in holds])
    yield from ws.flush()


def _approach(ws: Workspace, holds: Sequence[Choice]) -> Steps:
    if len(holds) == 1:
        grasp, way_in, _ = holds[0]
        go(ws, grasp.arm, way_in[0], grasp.opening)
    else:
        set_out = {hold[0].arm: partial(_set_out, ws, hold) for hold in holds}
        at_once(ws, [set_out[arm] for arm in range(len(ARMS))])
    for step in zip(*(way_in[1:] for _, way_in, _ in holds), strict=True):
        _together(ws, holds, step)
    yield from ws.flush()


def _set_out(ws: Workspace, hold: Choice) -> None:
    grasp, way_in, _ = hold
    ws.gripper[grasp.arm] = grasp.opening
    travel(ws, grasp.arm, way_in[0])


def _together(ws: Workspace, holds: Sequence[Choice], joints: Sequence[Array]) -> None:
    for (grasp, _, _), goal in zip(holds, joints, strict=True):
        ws.joints[grasp.arm] = np.asarray(goal, dtype=float)
    ws.add(holds[0][0].arm)


def _grip(ws: Workspace, holds: Sequence[Choice], openings: Sequence[float]) -> None:
    for (grasp, _, _), opening in zip(holds, openings, strict=True):
        ws.gripper[grasp.arm] = opening
    ws.add(holds[0][0].arm)


def _plan_lift(ws: Workspace, call: RaiseLower, arm: int, framed: bool, skip: int) -> Choice:
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
                    return reach, [*back[::-1], reach.joints], up
                skip -= 1
    raise SkillFailed(f"the {ARMS[arm]} arm finds no grasp of {call.object} to lift it with")


def _at_frame(ws: Workspace, name: str, frame: str, reach: GraspCandidate) -> bool:
    ahead = ws.hand(reach.arm).grip
    x, y, z = reach.pose.position
    dx, dy, dz = reach.approach
    centre = (x + ahead * dx, y + ahead * dy, z + ahead * dz)
    handle = ws.pose(name) * ws.models[name].frames[frame]
    return math.dist(centre, handle.position) < AT_HANDLE
