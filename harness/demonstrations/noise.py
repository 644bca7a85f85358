"""Noise with recovery: pushes off the expert's way, from which it comes back by itself.

As in DART (Laskey et al. 2017) what is executed is disturbed, and what is recorded as the action is
what the expert would do in the state that the robot is in. Only motions with clearance around them
are disturbed. The pushes come from a generator of the trial's own.

A motion goes along a straight joint line, and `progress` is how much of it is done. A push moves
the beginning of that line by a `shift` that grows smoothly while the push lasts and stays from then
on, so the arm is off its plan by `(1 - progress) * shift`: once the push is over it moves straight
from where it is to the motion's goal, in the time that is left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS, ActionSpace
from robospa.geometry import Pose, from_transform
from robospa.harness.robots.kinematics import Chain, forward
from robospa.harness.sim.motion import RATE, Trajectory
from robospa.harness.skills.clearance import Boxes, arm_points, finger_points, palm_points, standing
from robospa.harness.skills.workspace import Workspace
from robospa.harness.world import World
from robospa.workcell import WORKCELL

Array = NDArray[np.float64]

ACCELERATION = 4.0
"""The most [rad/s^2] that a push adds to any joint: as much as a demonstration itself has."""
TURN = 0.5
"""The most [rad] that a push shifts any joint."""


@dataclass(frozen=True)
class Push:
    """`shift` (n, J) [rad] after each of n physics steps of a motion, and the `progress` (n,)."""

    progress: Array
    shift: Array

    @property
    def offset(self) -> Array:
        """(n, J) [rad] off the plan."""
        found: Array = (1.0 - self.progress)[:, None] * self.shift
        return found

    def scaled(self, by: float) -> Push:
        return Push(self.progress, by * self.shift)


def smooth_step(at: Array) -> Array:
    """From 0 at 0 to 1 at 1, with speed and acceleration 0 at both ends; constant beyond."""
    t = np.clip(at, 0.0, 1.0)
    found: Array = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    return found


def push(progress: Array, direction: Array, begin: float, end: float) -> Push:
    """A push in joint `direction` (J,) [rad] that lasts from the share `begin` of a motion's time
    to `end`, along a motion of this `progress` (n,), made weaker as the limits ask for."""
    time = (np.arange(len(progress)) + 1.0) / len(progress)
    grown = smooth_step((time - begin) / (end - begin))
    made = Push(progress, grown[:, None] * direction)
    added = np.abs(np.diff(made.offset, n=2, axis=0)).max(initial=0.0) * RATE**2
    turned = np.abs(direction).max()
    return made.scaled(min(1.0, ACCELERATION / max(added, 1e-9), TURN / max(turned, 1e-9)))


LABELS = ("expert", "noise", "recovery", "mistake")
"""The expert's own; one with noise added; the expert's way back from that; a scripted mistake. A
frame's label counts in this order, which never changes."""
EXPERT, NOISE, RECOVERY, MISTAKE = range(len(LABELS))

OFF = 1e-3
"""An arm is off its plan if a joint is by more than this [rad]."""
PUSHED = 1e-4
"""A command is pushed if it differs by more than this [rad] from the expert's."""


class PushLog:
    """What was pushed in the motions of one demonstration, physics step by physics step.

    `width` is the number of joints of the arm that has more.
    """

    def __init__(self, width: int) -> None:
        self._left: list[Array] = [np.ones((len(ARMS), 1))]
        self._shift: list[Array] = [np.zeros((len(ARMS), 1, width))]

    def append(self, steps: int, pushes: Mapping[int, Push]) -> None:
        """A motion of so many physics steps, with the push of every arm that had one."""
        left = np.ones((len(ARMS), steps))
        shift = np.zeros((len(ARMS), steps, self._shift[0].shape[2]))
        for arm, made in pushes.items():
            left[arm] = 1.0 - made.progress
            shift[arm, :-1, : made.shift.shape[1]] = made.shift[:-1]
        self._left.append(left)
        self._shift.append(shift)

    def annotate(
        self, space: ActionSpace, commanded: NDArray[np.float32], steps: Sequence[int]
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Labels (T,) and actions (T, D) of frames with `commanded` (T, D) after `steps` (T,).

        A frame's action is what the expert would command next from the state that the frame shows:
        the next frame's command without what the push has grown meanwhile. Every end of a motion
        has to be a frame. The last action repeats the last command.
        """
        left, shift = np.concatenate(self._left, axis=1), np.concatenate(self._shift, axis=1)
        now, then = np.asarray(steps), np.asarray([*steps[1:], steps[-1]])
        action = np.concatenate([commanded[1:], commanded[-1:]])
        pushed, off = np.zeros(len(now)), np.zeros(len(now))
        for a, columns in enumerate(space.arms):
            grown = left[a, then, None] * (shift[a, then] - shift[a, now])
            grown[~shift[a, then].any(axis=1)] = 0.0  # that motion has ended
            action[:, columns.body] -= grown[:, : space.joints[a]].astype(np.float32)
            pushed = np.maximum(pushed, np.abs(grown).max(axis=1))
            off = np.maximum(off, np.abs(left[a, now, None] * shift[a, now]).max(axis=1))
        label = np.where(pushed > PUSHED, NOISE, np.where(off > OFF, RECOVERY, EXPERT))
        return label.astype(np.uint8), action


STRENGTH = 0.04
"""How far [m] the strongest push brings the fingertips off their way."""
LEVER = 0.2
"""A turn by 1 rad counts as so far [m]."""
WEAKEST = 0.3
"""The weakest push, as a share of the strongest."""
LEAST = 0.003
"""A push that brings the fingertips less far [m] off their way is left out."""
SHORTEST = 0.5
"""Motions that take less time [s] are not disturbed."""
BEGIN, LASTS = (0.05, 0.3), (0.25, 0.4)
"""When a push begins, and how long it lasts, as shares of a motion's time: a third is left in which
the arm comes back."""
TRIES = 4
"""So many directions are tried."""
PLACES = 10
"""In so many places of a disturbed way clearance is looked at."""
DEEPER = 0.001
"""A disturbed way may be so much deeper [m] in a margin than the planned one."""
ARMS_APART = 0.1
"""Clearance [m] between the arms, where the planned way has it."""


class Noise:
    """The pushes of one demonstration. Call `disturb` for every motion, in order.

    `workspace` is the expert's own: it is read, never changed.
    """

    def __init__(self, world: World, workspace: Workspace, rng: np.random.Generator) -> None:
        self._world, self._expert, self._rng = world, workspace, rng
        snapshot = world.snapshot()
        self._seen = Workspace(workspace.scene, workspace.robot, snapshot)
        self.log = PushLog(max(len(joints) for joints in snapshot.joints))
        """What was pushed, and when."""

    def disturb(self, path: Trajectory) -> Trajectory:
        """What is driven in place of `path`."""
        pushes = self._pushes(path) if len(path) >= SHORTEST * RATE else {}
        self.log.append(len(path), pushes)
        joints, velocities = path.joints.copy(), path.velocities.copy()
        for arm, made in pushes.items():
            width = made.shift.shape[1]
            joints[arm, :, :width] += made.offset
            velocities[arm, :-1, :width] += np.gradient(made.offset, axis=0)[:-1] * RATE
        return replace(path, joints=joints, velocities=velocities) if pushes else path

    def _pushes(self, path: Trajectory) -> dict[int, Push]:
        self._look()
        found: dict[int, Push] = {}
        for arm in range(len(ARMS)):
            width = len(self._seen.joints[arm])
            turn = path.joints[arm, -1, :width] - path.joints[arm, 0, :width]
            if np.abs(turn).max() < OFF or self._touches(arm):
                continue
            for _ in range(TRIES):
                made = self._draw(path, arm, turn)
                if made is not None and self._is_clear(path, {**found, arm: made}, arm):
                    found[arm] = made
                    break
        return found

    def _look(self) -> None:
        seen, snapshot = self._seen, self._world.snapshot()
        seen.update_state(snapshot)
        seen.held = list(self._expert.held)
        self._contacts = [c for c in self._world.contacts() if c.touching]

    def _touches(self, arm: int) -> bool:
        """True if the gripper touches anything but what the expert knows that it holds."""
        gripper, held = f"{ARMS[arm]}_gripper", self._seen.held[arm]
        pairs = [{c.first, c.second} for c in self._contacts]
        return any(pair - {gripper, held} for pair in pairs if gripper in pair)

    def _draw(self, path: Trajectory, arm: int, turn: Array) -> Push | None:
        """A push in a random direction of the joints that move; None if it would be too weak."""
        rng, width = self._rng, len(turn)
        size = STRENGTH * rng.uniform(WEAKEST, 1.0)
        begin, lasts = rng.uniform(*BEGIN), rng.uniform(*LASTS)
        direction = np.where(np.abs(turn) > OFF, rng.normal(size=width), 0.0)
        fastest = int(np.abs(turn).argmax())
        line = path.joints[arm, :, :width]
        progress = (line[:, fastest] - line[0, fastest]) / turn[fastest]
        full = push(progress, 10.0 * direction, begin, begin + lasts)  # as strong as may be
        rows = _places(line)
        chain = self._seen.chains[arm]
        off, turned = deviation(
            chain, self._seen.hand(arm).tip, line[rows], line[rows] + full.offset[rows]
        )
        peak = max(off, turned * LEVER)
        if min(size, peak) < LEAST:
            return None
        made = full.scaled(min(1.0, size / peak))
        inside = (line + made.offset >= chain.lower) & (line + made.offset <= chain.upper)
        return made if bool(inside.all()) else None

    def _is_clear(self, path: Trajectory, pushes: dict[int, Push], arm: int) -> bool:
        """True if the arm is nowhere nearer to anything than as planned, but for margins."""
        seen = self._seen
        rows = _places(path.joints[arm])
        plain = [path.joints[a][rows, : len(seen.joints[a])] for a in range(len(ARMS))]
        moved = [
            line + pushes[a].offset[rows] if a in pushes else line for a, line in enumerate(plain)
        ]
        allowed = np.maximum(depths(seen, arm, plain[arm]), 0.0) + DEEPER
        if (depths(seen, arm, moved[arm]) > allowed).any():
            return False
        apart = np.minimum(gaps(seen, plain[0], plain[1]) - DEEPER, ARMS_APART)
        return not (gaps(seen, moved[0], moved[1]) < apart).any()


def deviation(chain: Chain, tip: float, line: Array, moved: Array) -> tuple[float, float]:
    """The most [m] and [rad] by which the fingertips, `tip` [m] ahead of the end-effector frame,
    differ between joints `line` and `moved` (N, J)."""
    plain, off = (forward(chain, joints)[0] for joints in (line, moved))
    ends = [frames[:, :3, 3] + frames[:, :3, 0] * tip for frames in (plain, off)]
    cosine = (np.einsum("nij,nij->n", plain[:, :3, :3], off[:, :3, :3]) - 1.0) / 2.0
    turned = np.arccos(np.clip(cosine, -1.0, 1.0))
    return float(np.linalg.norm(ends[1] - ends[0], axis=1).max()), float(turned.max())


def _places(line: Array) -> NDArray[np.intp]:
    """Indices of the rows (n, J) at which a way is looked at, both ends left out."""
    return np.linspace(0, len(line) - 1, PLACES + 2).round().astype(np.intp)[1:-1]


MARGIN = 0.01
"""How much larger than they are [m] objects count, besides what the expert's own clearance adds."""
ABOVE_TABLE = 0.015
"""Clearance [m] between the table and what moves."""


def _points(ws: Workspace, arm: int, joints: Array) -> Array:
    """Points (N, M, 3) [m, world] on arm, fingers and palm, and on the box around what the arm
    holds, at joints (N, J)."""
    frames, _ = forward(ws.chains[arm], joints)
    side, hand = ws.robot.arms[arm], ws.hand(arm)
    closed, opened = side.travel
    opening = 2 * (closed + ws.gripper[arm] * (opened - closed))
    load = _load_points(ws, arm)
    rows = []
    for frame in frames:
        pose = from_transform(frame)
        parts = [finger_points(hand, pose, opening), palm_points(hand, pose)]
        rows.append(np.concatenate([*parts, load @ frame[:3, :3].T + frame[:3, 3]]))
    return np.concatenate([arm_points(ws, arm, joints), np.stack(rows)], axis=1)


def _load_points(ws: Workspace, arm: int) -> Array:
    """Corners and middles (M, 3) [m] of that box in the arm's end-effector frame."""
    name = ws.held[arm]
    if name is None:
        return np.empty((0, 3))
    model = ws.models[name]
    middle = Pose((0.0, 0.0, model.bottom + model.size[2] / 2))
    at = ws.snapshot.end_effector[arm].inverse() * ws.pose(name) * middle
    shares = product((-0.5, 0.0, 0.5), repeat=3)
    return np.array([at.apply(np.array(share) * model.size) for share in shares])


def depths(ws: Workspace, arm: int, joints: Array) -> Array:
    """How deep (N,) [m] the arm at joints (N, J), with hand and load, is in the margin around the
    table and all objects but its load."""
    points = _points(ws, arm, joints)
    half_x, half_y = WORKCELL.table.size[0] / 2, WORKCELL.table.size[1] / 2
    over = (np.abs(points[..., 0]) < half_x) & (np.abs(points[..., 1]) < half_y)
    below = np.where(over, ws.scene.table_top + ABOVE_TABLE - points[..., 2], 0.0)
    held = ws.held[arm]
    boxes: Boxes = standing(ws, *([] if held is None else [held]))
    around = replace(boxes, half=boxes.half + MARGIN).depths(points)
    found: Array = np.maximum(below.max(axis=1, initial=0.0), around)
    return found


def gaps(ws: Workspace, left: Array, right: Array) -> Array:
    """Distance (N,) [m] of the nearest two points on the arms at joints (N, J) of left and right.

    Points lie up to 5 cm apart on an arm.
    """
    sides = [_points(ws, a, joints) for a, joints in enumerate((left, right))]
    between = [np.linalg.norm(a[:, None] - b, axis=2).min() for a, b in zip(*sides, strict=True)]
    return np.array(between)
