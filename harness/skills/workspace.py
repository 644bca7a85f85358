"""The state that skills plan on: scene, robot, poses at this instant, commanded joints.

Skills are generators: they yield rows of joint actions, float64 (T, D), and get back the snapshot
that these led to. Nothing here touches the simulator.

A straight line in space is several joint lines, each of which starts and ends at rest: a waypoint
is left out where the next one's joint line passes by it.
"""

import math
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from robospa.action_space import ARMS
from robospa.geometry import Array, Pose, Vec3, rotate
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.robots.kinematics import Chain, chain_of, forward, inverse
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import ObjectModel
from robospa.tasks.snapshot import Snapshot
from robospa.workcell import Gripper

Steps = Generator[Array, Snapshot, None]

WALL_HEIGHT, WALL_DEPTH = 0.3, 0.03
"""An object higher and less deep than this [m] is a wall."""

AXES: tuple[Vec3, Vec3, Vec3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class SkillFailed(Exception):
    """The skill cannot go on; the message says which object and why."""


@dataclass
class Workspace:
    """One trial as the expert sees it. `left`/`right` have index 0/1 everywhere."""

    scene: Scene
    robot: Embodiment
    snapshot: Snapshot
    models: dict[str, ObjectModel] = field(init=False)
    chains: tuple[Chain, Chain] = field(init=False)
    joints: list[Array] = field(init=False)
    gripper: list[float] = field(init=False)
    held: list[str | None] = field(default_factory=lambda: [None, None])
    rows: list[Array] = field(default_factory=list)
    sent: Array = field(init=False)
    """The action that was sent last, from which the appended ones go on."""

    def __post_init__(self) -> None:
        self.models = {o.name: object_model(o.asset, o.params) for o in self.scene.everything}
        left, right = self.robot.arms
        self.chains = (chain_of(left), chain_of(right))
        self.update_state(self.snapshot)

    def hand(self, arm: int) -> Gripper:
        """The gripper of an arm."""
        return self.robot.arms[arm].gripper

    def update_state(self, snapshot: Snapshot) -> None:
        """Take over poses, joints [rad] and grippers of `snapshot`."""
        self.snapshot = snapshot
        self.joints = [np.asarray(j, dtype=float) for j in snapshot.joints]
        self.gripper = list(snapshot.gripper)
        self.sent = self.row()

    def add(self, arm: int, joints: Array | None = None, gripper: float | None = None) -> None:
        """Append one action: `arm` goes to `joints` and `gripper`, all else holds."""
        if joints is not None:
            self.joints[arm] = np.asarray(joints, dtype=float)
        if gripper is not None:
            self.gripper[arm] = gripper
        self.rows.append(self.row())

    def follow(self, arm: int, way: Iterable[Array]) -> None:
        """Append one action for each of the joints of a way."""
        for joints in way:
            self.add(arm, joints)

    def row(self) -> Array:
        """The action (D,) that holds what was commanded last."""
        parts = [np.append(self.joints[i], self.gripper[i]) for i in range(len(ARMS))]
        return np.concatenate(parts)

    def flush(self, exactly: bool = False) -> Steps:
        """Send the appended actions and take over the snapshot that they lead to.

        Stops that a straight joint line passes by are left out, unless they are to be kept
        `exactly`.
        """
        if self.rows:
            rows, self.rows = np.stack(self.rows), []
            if not exactly:
                tips = [self.hand(arm).tip for arm in range(len(ARMS))]
                rows = fewer_waypoints(self.chains, tips, self.sent, rows)
            self.update_state((yield rows))

    def pose(self, name: str) -> Pose:
        """Pose of the object called `name` at this instant."""
        return self.snapshot.poses[name]

    def solve(self, arm: int, target: Pose, near: Array | None = None) -> Array | None:
        """Joints for an end-effector pose, staying near `near` if given; None out of reach."""
        joints, found = inverse(self.chains[arm], [target], near)
        return joints[0] if found[0] else None

    def solve_path(self, arm: int, start: Array, poses: list[Pose]) -> list[Array] | None:
        """Joints along a list of nearby poses, each from the one before; None if one fails."""
        out: list[Array] = []
        for pose in poses:
            step = self.solve(arm, pose, out[-1] if out else start)
            if step is None:
                return None
            out.append(step)
        return out


def is_wall(model: ObjectModel) -> bool:
    """True for an object across the table like a wall: too high to carry anything over it."""
    return model.size[2] > WALL_HEIGHT and model.size[1] < WALL_DEPTH


def wall_front(ws: Workspace) -> float:
    """y [m] of the face, towards the robot, of a wall across the table; infinite without one."""
    walls = [(p, ws.models[n]) for n, p in ws.snapshot.poses.items() if is_wall(ws.models[n])]
    return min((pose.position[1] - model.size[1] / 2 for pose, model in walls), default=math.inf)


def max_gripper_y(pose: Pose, hand: Gripper) -> float:
    """Largest y [m] of a gripper's hand and wrist at an end-effector pose."""
    forward, closing, across = (rotate(pose.rotation, axis)[1] for axis in AXES)
    tip = pose.position[1] + forward * hand.tip
    wide = hand.hand_half[0] * abs(closing) + hand.hand_half[1] * abs(across)
    wrist = tip - forward * hand.wrist_back + hand.wrist_half
    return max(tip - forward * hand.hand_back + wide, wrist)


def moved_up(pose: Pose, height: float) -> Pose:
    """`pose` moved up by `height` [m]."""
    x, y, z = pose.position
    return Pose((x, y, z + height), pose.rotation)


def moved_back(pose: Pose, approach: Vec3, distance: float) -> Pose:
    """`pose` moved back by `distance` [m] against its approach direction."""
    x, y, z = pose.position
    return Pose(
        (x - approach[0] * distance, y - approach[1] * distance, z - approach[2] * distance),
        pose.rotation,
    )


NEAR = 0.003
"""How far off the fingertips may pass [m]."""
TURNED = 0.03
"""How much the gripper may be turned there, as the largest change of an axis's component."""
SHARES = np.linspace(0.0, 1.0, 17)[1:-1, None]


def fewer_waypoints(
    chains: Sequence[Chain], tips: Sequence[float], start: Array, rows: Array
) -> Array:
    """Those of `rows` (n, D) that are needed to move along them from `start` (D,).

    `tips` [m] are how far the fingertips are ahead of the end-effector frames. Only stops of one
    arm that moves while grippers and the other arm rest are left out.
    """
    split = chains[0].axes.shape[0] + 1
    columns = (slice(0, split - 1), slice(split, rows.shape[1] - 1))
    kept: list[Array] = []
    last = start
    for here, after in pairwise(rows):
        arm = _sole_mover(last, here, after, columns)
        if arm is not None:
            own = columns[arm]
            if _passes(chains[arm], tips[arm], last[own], here[own], after[own]):
                continue
        kept.append(here)
        last = here
    return np.stack([*kept, rows[-1]])


def _sole_mover(last: Array, here: Array, after: Array, columns: tuple[slice, slice]) -> int | None:
    """The arm that moves in both steps, if nothing else does."""
    for arm, own in enumerate(columns):
        other = np.ones(len(here), dtype=bool)
        other[own] = False
        resting = (last[other] == here[other]).all() and (here[other] == after[other]).all()
        if resting and (last[own] != here[own]).any() and (here[own] != after[own]).any():
            return arm
    return None


def _passes(chain: Chain, tip: float, last: Array, here: Array, after: Array) -> bool:
    """True if the joint line from `last` to `after` passes by the pose at `here`."""
    line = last + (after - last) * SHARES
    frames, _ = forward(chain, np.concatenate([here[None], line]))
    points = frames[:, :3, 3] + frames[:, :3, 0] * tip
    off = np.linalg.norm(points[1:] - points[0], axis=1)
    nearest = int(off.argmin())
    turned = np.abs(frames[1 + nearest, :3, :3] - frames[0, :3, :3]).max()
    return bool(off[nearest] < NEAR and turned < TURNED)
