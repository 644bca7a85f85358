"""Trajectories of drive targets: a closed form, computed once per action.

The official harness time-parameterises the straight joint line with a planner; for a line with one
velocity and one acceleration limit the answer is a triangle or a trapezium of speed, so it is
written down here instead. Everything is plain numpy and knows nothing of the simulator. It refuses
nothing: actions are checked before they come here (`robospa.harness.action_decoder`).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE = 250
"""Physics steps per simulated second."""
MAX_VELOCITY = 1.0
"""[rad/s] of any joint of an action."""
MAX_ACCELERATION = 1.0
"""[rad/s^2] of any joint of an action."""
HOLD_STEPS = 50
"""Physics steps of an arm that moves no joint in an action (0.2 s)."""
OPENING_LEAD = 0.1
"""The most by which a gripper's drive target may open in one physics step."""


@dataclass(frozen=True)
class SpeedLimits:
    """What no joint exceeds: `velocity` [rad/s] and `acceleration` [rad/s^2]."""

    velocity: float
    acceleration: float


ACTION_LIMITS = SpeedLimits(MAX_VELOCITY, MAX_ACCELERATION)
"""Of a policy's actions: the official rule."""
DEMONSTRATION_LIMITS = SpeedLimits(3.0, 2.0)
"""Of demonstrations. The official expert's planner (CuRobo) keeps to 3 rad/s^2 and has no limit of
velocity; along a smooth (minimum-jerk) line with that peak a motion takes as long as along a
triangle of speed of 2.1 rad/s^2."""


@dataclass(frozen=True)
class Trajectory:
    """Drive targets of both arms, one row per physics step.

    `joints` [rad] and `velocities` [rad/s] are (2, n, J), `gripper` (0 closed .. 1 open) is (2, n):
    the drive targets. `commanded` (2, n) is the gripper as commanded, which an opening gripper's
    drive target may lag. Before the first row the targets are those of the previous action.
    """

    joints: Array
    velocities: Array
    gripper: Array
    commanded: Array

    def __len__(self) -> int:
        """Number of physics steps."""
        return int(self.gripper.shape[1])


def duration(change: float, limits: SpeedLimits = ACTION_LIMITS) -> float:
    """Time [s] of a rest-to-rest motion whose fastest joint turns by `change` >= 0 [rad]."""
    reach = limits.velocity**2 / limits.acceleration
    if change <= reach:
        return 2.0 * math.sqrt(change / limits.acceleration)
    return change / limits.velocity + limits.velocity / limits.acceleration


def step_count(change: float, limits: SpeedLimits = ACTION_LIMITS) -> int:
    """Physics steps of that motion; 0 if it is too small to take one."""
    return math.floor(RATE * duration(change, limits) + 1e-9)


def profile(change: float, limits: SpeedLimits = ACTION_LIMITS) -> tuple[Array, Array]:
    """Travelled fraction (n,) from 0 to 1 and its rate (n,) [1/s] of a rest-to-rest motion.

    The n = `step_count(change)` samples are spread evenly over the motion, both ends included; a
    motion of a single step has only its end.
    """
    count = step_count(change, limits)
    if count == 0:
        return np.empty(0), np.empty(0)
    total = duration(change, limits)
    time = np.arange(float(count))
    if count > 1:
        time *= total / (count - 1)  # as numpy.linspace does, without its checks
    time[-1] = total
    peak = min(limits.velocity, math.sqrt(change * limits.acceleration))
    ramp = peak / limits.acceleration
    left = total - time
    cruise = change - peak * ramp  # travelled at peak speed
    travelled = np.where(
        time < ramp,
        0.5 * limits.acceleration * time**2,
        np.where(
            left < ramp,
            change - 0.5 * limits.acceleration * left**2,
            0.5 * peak * ramp + np.clip(peak * (time - ramp), 0.0, cruise),
        ),
    )
    speed = np.minimum(peak, limits.acceleration * np.minimum(time, left))
    return travelled / change, speed / change


def limit_opening(commanded: Array, drive: float) -> Array:
    """Gripper drive targets (n,) that follow `commanded` (n,) from `drive`, opening no faster
    than OPENING_LEAD per step. Closing is not limited."""
    if len(commanded) == 0 or (
        commanded[0] - drive <= OPENING_LEAD + 1e-12
        and (commanded[1:] - commanded[:-1]).max(initial=0.0) <= OPENING_LEAD + 1e-12
    ):
        return commanded
    out = np.empty_like(commanded)
    for i, value in enumerate(commanded):
        drive = min(float(value), drive + OPENING_LEAD)
        out[i] = drive
    return out


def merged(left: int, right: int) -> NDArray[np.intp]:
    """Which sample of its motion each arm is at, (2, n), when motions of so many samples (at least
    1) end together.

    Officially the arm that has done the smaller share of its motion goes on in every physics step,
    both where the shares are equal, and the left one is looked at first: so the longer motion never
    waits, and the other is at the first sample that brings its share beyond the longer one's.
    """
    step = np.arange(max(left, right))
    if left > right:
        return np.stack([step, np.minimum((step + 1) * right // left, right - 1)])
    return np.stack([step * left // right, step])


def action_steps(change: Array) -> NDArray[np.int64]:
    """Physics steps (T,) of T actions one after the other, as `rest_to_rest` takes them.

    `change` (T, 2) [rad] is how far each arm's fastest joint turns, as commanded.
    """
    reach = MAX_VELOCITY**2 / MAX_ACCELERATION
    seconds = np.where(
        change <= reach,
        2.0 * np.sqrt(change / MAX_ACCELERATION),
        change / MAX_VELOCITY + MAX_VELOCITY / MAX_ACCELERATION,
    )
    steps = np.floor(RATE * seconds + 1e-9).astype(np.int64)
    longest: NDArray[np.int64] = np.where(steps == 0, HOLD_STEPS, steps).max(axis=1)
    return longest


def rest_to_rest(
    start: Array,
    goal: Array,
    gripper: Array,
    gripper_goal: Array,
    drive: Array,
    limits: SpeedLimits = ACTION_LIMITS,
) -> Trajectory:
    """The official rule, if at the limits of an action: each arm goes straight from `start` to
    `goal` (2, J), rest to rest.

    The gripper goes linearly from `gripper` to `gripper_goal` (2,) over its arm's steps; `drive`
    (2,) is where its drive target stands. An arm that does not move takes HOLD_STEPS. The shorter
    motion is stretched so that both arms end together (`merged`); while an arm waits for the other
    its drive keeps the velocity of its last sample, as officially.
    """
    turn = goal - start
    change = np.abs(turn).max(axis=1).tolist()
    pull = (gripper_goal - gripper).tolist()
    counts = [step_count(c, limits) or HOLD_STEPS for c in change]
    at = merged(*counts)
    count, width = at.shape[1], turn.shape[1]
    joints, velocities = np.empty((2, count, width)), np.zeros((2, count, width))
    commanded, drives = np.empty((2, count)), np.empty((2, count))
    for a in range(2):
        fraction, rate = profile(change[a], limits)
        if len(fraction):
            joints[a] = (start[a] + fraction[:, None] * turn[a])[at[a]]
            velocities[a] = (rate[:, None] * turn[a])[at[a]]
            joints[a, at[a] == len(fraction) - 1] = goal[a]
        else:  # at rest, or closer than one step: the target is taken at once
            joints[a] = goal[a]
        own = gripper[a] + np.arange(1, counts[a] + 1) / counts[a] * pull[a]
        own[-1] = gripper_goal[a]
        commanded[a] = own[at[a]]
        drives[a] = limit_opening(own, float(drive[a]))[at[a]]
    return Trajectory(joints, velocities, drives, commanded)


def fixed_rate(
    start: Array, goal: Array, gripper: Array, gripper_goal: Array, drive: Array, count: int
) -> Trajectory:
    """Every action lasts `count` steps; joints and grippers move linearly, whatever their speed.

    The last velocity target is zero, so that a policy that stops sending leaves the arms at rest.
    """
    fraction = np.arange(1, count + 1) / count
    joints = start[:, None] + fraction[None, :, None] * (goal - start)[:, None]
    joints[:, -1] = goal
    velocities = np.repeat((goal - start)[:, None] * (RATE / count), count, axis=1)
    velocities[:, -1] = 0.0
    grip = gripper[:, None] + fraction[None, :] * (gripper_goal - gripper)[:, None]
    grip[:, -1] = gripper_goal
    drives = np.stack([limit_opening(grip[a], float(drive[a])) for a in range(2)])
    return Trajectory(joints, velocities, drives, grip)
