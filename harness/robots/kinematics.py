"""Forward and inverse kinematics of one arm in plain numpy, many poses at a time.

Inverse kinematics of ARX arms (yaw, three parallel pitches, yaw, roll) starts in closed form and
ends with Newton steps; that of others is damped least squares on the end-effector pose from a few
postures aimed at the target. No simulator, no global state: the same arguments give the same bits
on one machine.

In an ideal ARX arm joint 5's axis lies in the arm's vertical plane and meets the approach axis, so
the plane follows from the target alone, and what is left is two links in that plane. There is one
solution with the arm facing its target and the elbow up. A real arm's joints are a few millimetres
and hundredths of a radian off. Rotations in the plane are complex numbers: x - i z turns by
exp(i angle).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Array, Pose, from_transform, to_transform, turning_vector
from robospa.harness.robots.embodiment import Arm

POSITION_TOLERANCE = 2e-5  # [m]
ROTATION_TOLERANCE = 5e-5  # [rad]
ITERATIONS = 60
DAMPING = 1e-3
PATIENCE = 6
PROGRESS = 0.6
"""A row whose error has not shrunk to this share within PATIENCE iterations is given up."""
STEP_LIMIT = 0.35  # [rad] per iteration and joint, keeps far starts from jumping
NEWTON_STEPS = 8
"""At most; each squares the error, from a few millimetres to rounding in four."""
ROUNDING = 1e-11  # [m] and [rad]
EXACT = 1e-6  # [m] and [rad], of what Newton steps have to leave
START_SLACK = 0.4
"""A start so far [rad] beyond the working limits leads to no solution within them."""
LIMIT_SLACK = 1e-9  # [rad]
EYE = np.eye(3)


BACKWARDS = -0.55
"""Joint 2 [rad] below this is counted a turn higher."""


@dataclass(frozen=True)
class Links:
    """Distances [m] between the axes, from the joint origins of the chain."""

    rise: float  # base to joint 1
    shoulder: complex  # joint 1 to joint 2
    upper: float  # joint 2 to joint 3
    fore: complex  # joint 3 to joint 4
    wrist: float  # joint 4 to joint 5, along the hand
    offset: float  # sideways, of joint 5 from the plane
    hand: float  # joint 5 to the end-effector frame, along the approach


def links_of(origins: Array, tool: Array) -> Links:
    """Link lengths of a chain's joint origins (6, 4, 4) and tool transform (4, 4)."""
    at = origins[:, :3, 3]
    wrist = np.eye(4)
    for origin in origins[:5]:
        wrist = wrist @ origin
    return Links(
        rise=float(at[0, 2]),
        shoulder=complex(at[1, 0], -at[1, 2]),
        upper=-float(at[2, 0]),
        # frame 3 is turned by half a turn about x: its z counts the other way
        fore=complex(at[3, 0], at[3, 2]),
        wrist=float(at[4, 0]),
        offset=float(wrist[1, 3]),
        hand=float(at[5, 0] + tool[0, 3]),
    )


def closed_start(links: Links, local: Array) -> Array:
    """Joints (N, 6) [rad] for end-effector transforms (N, 4, 4) in the base frame.

    A target out of reach gets the stretched-out arm.
    """
    approach = local[:, :3, 0]
    wrist = local[:, :3, 3] - links.hand * approach
    x, y, z = wrist[:, 0], wrist[:, 1], wrist[:, 2] - links.rise
    far = np.maximum(np.hypot(x, y), 1e-9)
    q1 = np.arctan2(y, x) - np.arcsin(np.clip(links.offset / far, -1, 1))
    c1, s1 = np.cos(q1), np.sin(q1)
    # into the arm's plane: turn everything back by q1
    turn = np.zeros((len(local), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1] = c1, s1, -s1, c1
    turn[:, 2, 2] = 1
    plane = turn @ local[:, :3, :3]
    ax, ay, az = plane[:, 0, 0], plane[:, 1, 0], plane[:, 2, 0]
    q5 = -np.arcsin(np.clip(ay, -1, 1))
    pitch = np.arctan2(-az, ax)
    hand = np.exp(1j * pitch)
    reach = (c1 * x + s1 * y) - 1j * z - links.shoulder - links.wrist * hand
    long, short = links.upper, abs(links.fore)
    cosine = (long**2 + short**2 - np.abs(reach) ** 2) / (2 * long * short)
    bend = np.arccos(np.clip(cosine, -1, 1))
    q3 = np.angle(links.fore) + bend
    q2 = np.angle(reach / (short * np.exp(-1j * bend) - long))
    q2 = np.where(q2 < BACKWARDS, q2 + 2 * np.pi, q2)
    q4 = np.angle(np.exp(1j * (q2 - q3 - pitch)))
    cp, sp, c5, s5 = np.cos(pitch), np.sin(pitch), np.cos(q5), np.sin(q5)
    # columns y and z of Ry(pitch) Rz(-q5), to read the roll from
    side = np.stack([cp * s5, c5, -sp * s5], axis=1)
    up = np.stack([sp, np.zeros_like(sp), cp], axis=1)
    q6 = np.arctan2((up * plane[:, :, 1]).sum(axis=1), (side * plane[:, :, 1]).sum(axis=1))
    return np.stack([q1, q2, q3, q4, q5, q6], axis=1)


@dataclass(frozen=True)
class Chain:
    """An arm's joints as arrays, in the world frame, shared: nobody writes to them."""

    base: Array  # (4, 4)
    origins: Array  # (J, 4, 4)
    axes: Array  # (J, 3)
    cross: Array  # (J, 3, 3) cross product with each axis, as a matrix
    cross_twice: Array  # (J, 3, 3) its square
    tool: Array  # (4, 4)
    lower: Array  # (J,) joint limits
    upper: Array  # (J,)
    working_lower: Array  # (J,) limits within which inverse kinematics looks
    working_upper: Array  # (J,)
    seeds: Array  # (S, J)
    links: Links | None = None


@cache
def chain_of(arm: Arm) -> Chain:
    """The arm's joints as arrays, ending in its end-effector frame. Made once for equal arms."""
    origins = np.stack([to_transform(j.origin) for j in arm.joints])
    tool = to_transform(arm.tool)
    cross = np.array(
        [[[0, -z, y], [z, 0, -x], [-y, x, 0]] for x, y, z in (j.axis for j in arm.joints)]
    )
    working = arm.working or [(joint.lower, joint.upper) for joint in arm.joints]
    return Chain(
        base=to_transform(arm.base),
        origins=origins,
        axes=np.array([j.axis for j in arm.joints], dtype=float),
        cross=cross,
        cross_twice=cross @ cross,
        tool=tool,
        links=links_of(origins, tool) if arm.geometry == "arx" else None,
        working_lower=np.array([low for low, _ in working]),
        working_upper=np.array([high for _, high in working]),
        lower=np.array([j.lower for j in arm.joints]),
        upper=np.array([j.upper for j in arm.joints]),
        seeds=np.array(arm.seeds, dtype=float),
    )


def _joint_turns(chain: Chain, joints: Array) -> Array:
    """(J, N, 4, 4) rotations of each joint by joints (N, J) [rad] about its axis (Rodrigues)."""
    angles = joints.T[:, :, None, None]
    turns = np.zeros((*joints.T.shape, 4, 4))
    turns[..., :3, :3] = (
        EYE
        + np.sin(angles) * chain.cross[:, None]
        + (1 - np.cos(angles)) * chain.cross_twice[:, None]
    )
    turns[..., 3, 3] = 1
    return turns


def link_frames(chain: Chain, joints: Array) -> list[Array]:
    """Transforms (N, 4, 4) of the links that joints (N, J) move, in the world, base first."""
    frame = np.broadcast_to(chain.base, (len(joints), 4, 4))
    frames = []
    for origin, turn in zip(chain.origins, _joint_turns(chain, joints), strict=True):
        frame = frame @ origin @ turn
        frames.append(frame)
    return frames


def forward(chain: Chain, joints: Array) -> tuple[Array, Array]:
    """End-effector transforms (N, 4, 4) and geometric Jacobians (N, 6, J) of joints (N, J)."""
    count, width = joints.shape
    before = np.empty((width, count, 4, 4))  # frames of the joints, not turned yet
    before[0] = chain.base @ chain.origins[0]
    turns = _joint_turns(chain, joints)
    for i, origin in enumerate(chain.origins[1:]):
        np.matmul(before[i] @ turns[i], origin, out=before[i + 1])
    frame = before[-1] @ turns[-1] @ chain.tool
    axes = before[..., :3, :3] @ chain.axes[:, None, :, None]
    x, y, z = axes[..., 0].transpose(2, 1, 0)  # (N, J) each
    p, q, r = (frame[:, :3, 3] - before[..., :3, 3]).transpose(2, 1, 0)
    rows = [y * r - z * q, z * p - x * r, x * q - y * p, x, y, z]
    # `out`, since the last bits of products depend on how their factors lie in memory.
    return frame, np.stack(rows, axis=1, out=np.empty((count, 6, width)))


def end_effector(chain: Chain, joints: Sequence[float] | Array) -> Pose:
    """Pose of the end-effector frame in the world at `joints` [rad]."""
    return from_transform(forward(chain, np.asarray(joints, dtype=float)[None])[0][0])


def _errors(frame: Array, target: Array) -> Array:
    """(N, 6) position and rotation-vector errors from frames to targets."""
    turn = target[:, :3, :3] @ frame[:, :3, :3].transpose(0, 2, 1)
    vector = turning_vector(turn)
    sine = np.sqrt((vector * vector).sum(axis=1)) / 2
    cosine = (turn[:, 0, 0] + turn[:, 1, 1] + turn[:, 2, 2] - 1) / 2
    angle = np.arctan2(sine, cosine)
    scale = np.where(sine > 1e-6, angle / np.maximum(2 * sine, 1e-12), 0.5)
    return np.concatenate([target[:, :3, 3] - frame[:, :3, 3], vector * scale[:, None]], axis=1)


def _descend(chain: Chain, targets: Array, joints: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Damped least squares from `joints` (N, J); returns joints and which of them arrived (N,).

    Rows that no longer come nearer are given up: most targets that a caller tries are out of reach.
    """
    lower, upper = chain.working_lower, chain.working_upper
    width = joints.shape[1]
    joints = joints.copy()
    arrived = np.zeros(len(joints), dtype=bool)
    active = np.arange(len(joints))
    marks = np.full(len(joints), np.inf)
    damping = DAMPING * np.eye(width)
    for turn in range(ITERATIONS):
        frame, jacobian = forward(chain, joints[active])
        error = _errors(frame, targets[active])
        size = np.abs(error)
        near = (size[:, :3].max(axis=1) < POSITION_TOLERANCE) & (
            size[:, 3:].max(axis=1) < ROTATION_TOLERANCE
        )
        arrived[active[near]] = True
        keep = ~near
        if turn and turn % PATIENCE == 0:
            total = size.sum(axis=1)
            keep &= total < PROGRESS * marks[active]
            marks[active] = total
        active, error, jacobian = active[keep], error[keep], jacobian[keep]
        if not len(active):
            break
        transposed = jacobian.transpose(0, 2, 1)
        step = np.linalg.solve(transposed @ jacobian + damping, transposed @ error[:, :, None])
        change = step[:, :, 0].clip(-STEP_LIMIT, STEP_LIMIT)
        joints[active] = (joints[active] + change).clip(lower, upper)
    return joints, arrived


def _polish(chain: Chain, targets: Array, joints: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Newton steps from joints (N, J) that nearly reach the targets; success within the limits."""
    low, high = chain.working_lower, chain.working_upper
    joints = joints.copy()
    error = np.full(len(joints), np.inf)
    far = (joints < low - START_SLACK) | (joints > high + START_SLACK)
    active = np.flatnonzero(~far.any(axis=1))
    for _ in range(NEWTON_STEPS):
        frame, jacobian = forward(chain, joints[active])
        missing = _errors(frame, targets[active])
        error[active] = np.abs(missing).max(axis=1)
        open_rows = error[active] > ROUNDING
        active, missing, jacobian = active[open_rows], missing[open_rows], jacobian[open_rows]
        if not len(active):
            break
        transposed = jacobian.transpose(0, 2, 1)
        tiny = 1e-12 * np.eye(joints.shape[1])  # keeps a singular posture solvable
        step = np.linalg.solve(transposed @ jacobian + tiny, transposed @ missing[:, :, None])
        joints[active] += np.clip(step[:, :, 0], -STEP_LIMIT, STEP_LIMIT)
    within = ((joints >= low - LIMIT_SLACK) & (joints <= high + LIMIT_SLACK)).all(axis=1)
    return np.clip(joints, low, high), within & (error < EXACT)


def inverse(
    chain: Chain, targets: Sequence[Pose], near: Sequence[float] | Array | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """Joints (N, J) [rad] that bring the end-effector frame to each target, and success (N,).

    An arm with a closed start has one solution. Otherwise, with `near` only the solution reached
    from those joints counts, so that it stays on the same branch; without, the postures of the
    arm's `seeds`, aimed at the target, are tried in their order until one arrives. A target that
    is out of reach or beyond the joint limits has success False and the best joints found.
    """
    goal_frames = np.stack([to_transform(t) for t in targets])
    count = len(targets)
    if chain.links is not None:
        local = np.linalg.inv(chain.base) @ goal_frames
        return _polish(chain, goal_frames, closed_start(chain.links, local))
    if near is not None:
        start = np.broadcast_to(np.asarray(near, dtype=float), (count, len(chain.axes)))
        return _descend(chain, goal_frames, start)
    local = np.linalg.inv(chain.base) @ goal_frames
    aim = np.arctan2(local[:, 1, 3], local[:, 0, 3])
    postures = chain.seeds[:, None] + np.pad(aim[:, None], ((0, 0), (0, len(chain.axes) - 1)))
    joints, arrived = _descend(chain, goal_frames, postures[0])
    open_rows = np.flatnonzero(~arrived)
    if len(open_rows) and len(postures) > 1:  # all other postures at once: a row costs little
        others = postures[1:, open_rows]
        goals = np.tile(goal_frames[open_rows], (len(others), 1, 1))
        found, ok = _descend(chain, goals, others.reshape(-1, len(chain.axes)))
        found, ok = found.reshape(others.shape), ok.reshape(others.shape[:2])
        best = np.where(ok.any(axis=0), ok.argmax(axis=0), len(others) - 1)
        joints[open_rows] = found[best, np.arange(len(open_rows))]
        arrived[open_rows] = ok.any(axis=0)
    return joints, arrived
