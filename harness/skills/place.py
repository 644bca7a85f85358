"""Place, Drop and Pour: bring the held object somewhere and let go of it, or of what is in it."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Array, Pose, Quat, axis_rotation, multiply, rotate, yaw_rotation
from robospa.harness.robots.kinematics import inverse
from robospa.harness.skills import clearance
from robospa.harness.skills.motion import detour, line_poses, retreat_home, route, travel
from robospa.harness.skills.pick import GraspCandidate, pick
from robospa.harness.skills.workspace import SkillFailed, Steps, Workspace, moved_back, moved_up
from robospa.tasks.plan import Drop, Pick, Place, Pour
from robospa.tasks.shapes import Box

ABOVE = 0.07
"""Height above the final pose from which the object comes straight down [m]."""
FAR = 2.5
"""Where a joint would turn by more [rad], a placement in a posture nearer by is looked for."""
TURNS = (0.0, math.pi / 2, -math.pi / 2, math.pi, -math.pi)
"""Turns [rad] of the last joint from which it is looked for."""
OPENINGS = (1.0, 0.8, 0.6, 0.4)
"""Shares of the full opening, widest first, with which a placed object may be let go of."""
YAWS = tuple(2 * math.pi * i / 16 for i in range(16))
MOUTH = ((0.0, 0.0), (0.06, -0.08), (0.06, 0.0), (0.1, -0.12), (0.0, -0.12), (0.12, 0.0))
"""Where over a container the object may be let go, relative to its centre [m]."""


@dataclass(frozen=True)
class Placement:
    """An end-effector pose that puts the object where it should be, and its joints."""

    pose: Pose
    joints: Array
    above: Array


def arm_holding(ws: Workspace, name: str) -> int:
    """The arm that holds `name`; SkillFailed if none does."""
    if name not in ws.held:
        raise SkillFailed(f"{name} is not held by any arm")
    return ws.held.index(name)


def grip_offset(ws: Workspace, arm: int, name: str) -> Pose:
    """Pose of the object in the end-effector frame of the arm that holds it."""
    return ws.snapshot.end_effector[arm].inverse() * ws.pose(name)


def place_position(ws: Workspace, call: Place) -> tuple[float, float, float]:
    """World position [m] at which the call puts the object's origin."""
    if call.on is None:
        return call.position
    support = ws.pose(call.on) * ws.models[call.on].frames["support"]
    x, y, z = support.apply(call.position)
    return (x, y, z - ws.models[call.object].bottom)


def reachable_placements(
    ws: Workspace, arm: int, offset: Pose, targets: Iterable[Pose], above: float, near: Array
) -> list[Placement]:
    """All reachable ways to bring an object held with `offset` to one of `targets`, best first."""
    poses = [target * offset.inverse() for target in targets]
    joints, ok = inverse(ws.chains[arm], poses)
    found = _best(ws, arm, poses, joints, ok, above, near)
    if not found or float(np.abs(found[0].joints - near).max()) < FAR:
        return found
    for turn in TURNS:
        start = np.append(near[:-1], near[-1] + turn)
        joints, ok = inverse(ws.chains[arm], poses, start)
        ok &= np.abs(joints - near).max(axis=1) < FAR
        nearer = _best(ws, arm, poses, joints, ok, above, near)
        if nearer:
            return nearer
    return found


def _best(
    ws: Workspace,
    arm: int,
    poses: list[Pose],
    joints: Array,
    ok: NDArray[np.bool_],
    above: float,
    near: Array,
) -> list[Placement]:
    """Placements at those of `joints` (N, J) [rad] that are `ok`, nearest to `near` first."""
    reached = np.flatnonzero(ok)
    held = ws.held[arm]
    blocked = (
        clearance.arm_depth(ws, arm, joints[reached], *([held] if held else [])) > clearance.TOUCH
    )
    far = np.abs(joints[reached] - near).max(axis=1)
    order = reached[np.lexsort((far, blocked))]
    found = []
    for i in order:
        up = ws.solve(arm, moved_up(poses[i], above), joints[i])
        if up is not None:
            found.append(Placement(poses[i], joints[i], up))
            if len(found) == 3:
                break
    return found


def place_targets(ws: Workspace, call: Place) -> list[Pose]:
    """Object poses that satisfy the call: upright, at the position, any allowed yaw."""
    x, y, z = place_position(ws, call)
    yaws = YAWS if call.yaw is None else (call.yaw,)
    return [Pose((x, y, z + call.drop), yaw_rotation(yaw)) for yaw in yaws]


def tipped_targets(ws: Workspace, call: Place) -> list[Pose]:
    """The same with the object tipped and higher up, for what is hard to reach: it falls flat."""
    radius = ws.models[call.object].radius
    return [
        Pose(
            (pose.position[0], pose.position[1], pose.position[2] + radius * math.sin(tip)),
            multiply(pose.rotation, axis_rotation((math.cos(turn), math.sin(turn), 0), tip)),
        )
        for tip in (0.3, 0.6)
        for turn in YAWS[::2]
        for pose in place_targets(ws, call)
    ]


def drop_targets(ws: Workspace, call: Drop) -> list[Pose]:
    """Object poses over the container's mouth."""
    bin_pose, model = ws.pose(call.into), ws.models[call.into]
    x, y, z = bin_pose.position
    z += model.bottom + model.size[2] + call.height
    return [Pose((x + dx, y + dy, z), yaw_rotation(yaw)) for dx, dy in MOUTH for yaw in YAWS[::2]]


def can_follow(ws: Workspace, call: Place | Drop, grasp: GraspCandidate) -> bool:
    """True if the same arm could do `call` after `grasp`."""
    offset = grasp.pose.inverse() * ws.pose(call.object)
    targets = place_targets(ws, call) if isinstance(call, Place) else drop_targets(ws, call)
    above = ABOVE if isinstance(call, Place) else 0.0
    return bool(reachable_placements(ws, grasp.arm, offset, targets, above, grasp.joints))


def release_opening(ws: Workspace, arm: int, pose: Pose, offset: Pose, call: Place) -> float:
    """Gripper value 0..1 with which the object, held with `offset`, is let go of at end-effector
    `pose`: all the way, or less where a finger would push a neighbour aside and then does not."""
    hand, model = ws.hand(arm), ws.models[call.object]
    boxes = all(isinstance(s.geometry, Box) for s in model.shapes if s.collision)
    own = (clearance.own_boxes if boxes else clearance.bounding_box)(model, pose * offset)
    without = [name for name in (call.object, call.on) if name is not None]
    for share in OPENINGS:
        fingers = clearance.finger_points(hand, pose, hand.opening * share)
        if own.depth(fingers) > 0.0:
            break
        if clearance.standing(ws, *without).depth(fingers) <= clearance.TOUCH:
            return 1.0 if share == 1.0 else ws.robot.arms[arm].gripper_value(hand.opening * share)
    return 1.0


def place(ws: Workspace, call: Place) -> Steps:
    """Carry, set down, let go, back off."""
    arm = arm_holding(ws, call.object)
    offset = grip_offset(ws, arm, call.object)
    near = ws.joints[arm]
    found = reachable_placements(ws, arm, offset, place_targets(ws, call), ABOVE, near)
    found = found or reachable_placements(ws, arm, offset, tipped_targets(ws, call), ABOVE, near)
    if not found:
        raise SkillFailed(f"{call.object} cannot be brought to {place_position(ws, call)}")
    spot = found[0]
    if not route(ws, arm, spot.above).free:
        via = detour(ws, arm, spot.above)
        if via is not None:
            ws.add(arm, via)
    travel(ws, arm, spot.above)
    yield from ws.flush()
    ws.add(arm, spot.joints)
    ws.add(arm)
    opening = release_opening(ws, arm, spot.pose, offset, call)
    ws.add(arm, gripper=opening)
    approach = rotate(spot.pose.rotation, (1, 0, 0))
    away = moved_back(spot.pose, approach, call.retreat)
    out = ws.solve_path(arm, spot.joints, line_poses(spot.pose, away, 2)) or [spot.above]
    ws.follow(arm, out)
    if opening < 1.0:
        ws.add(arm, gripper=1.0)
    ws.held[arm] = None
    yield from ws.flush()


def drop(ws: Workspace, call: Drop) -> Steps:
    """Carry over the container and open the gripper."""
    arm = arm_holding(ws, call.object)
    offset = grip_offset(ws, arm, call.object)
    found = reachable_placements(ws, arm, offset, drop_targets(ws, call), 0.0, ws.joints[arm])
    if not found:
        raise SkillFailed(f"{call.object} cannot be brought over {call.into}")
    travel(ws, arm, found[0].joints)
    ws.add(arm)
    ws.add(arm, gripper=1.0)
    ws.add(arm)
    ws.held[arm] = None
    retreat_home(ws, arm)  # what hangs between gripper and rim falls then
    yield from ws.flush()


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
