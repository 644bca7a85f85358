"""Pick: grasp an object and lift it; check that it came along, and try again if it did not."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.geometry import Pose
from robospa.harness.skills.arm_clearance import TOUCH, arm_depth
from robospa.harness.skills.both_arms import go
from robospa.harness.skills.grasping import LEANS, LEVEL, GraspCandidate, reachable_grasps
from robospa.harness.skills.motion import line_poses, retreat_home, rise, route
from robospa.harness.skills.workspace import SkillFailed, Workspace, moved_back
from robospa.tasks.plan import Pick
from robospa.tasks.snapshot import Snapshot

Array = NDArray[np.float64]
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
        for joints in way_in[1:]:
            ws.add(arm, joints)
        ws.add(arm, gripper=0.0)
        ws.add(arm)
        for joints in way_up:
            ws.add(arm, joints)
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
            touches = arm_depth(ws, option.arm, np.stack(back), call.object).max() > TOUCH
            touches |= feasible is not None and option.depth > TOUCH
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
