"""How deep a gripper's fingers and palm, or an arm, would be in what stands around them.

Bodies are boxes: a neighbour its bounding box, the object itself the boxes that it is made of
(around its handles there is room for fingers) and, for the palm, its bounding box.

The same for the arm itself: a hand that comes level has the wrist beside, above or below it, by the
arm and by which way round it is turned; below, it may be in the table long before the fingers are,
and the forearm follows it low over everything between the object and the robot.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np

from robospa.geometry import Array, Pose, to_matrix
from robospa.harness.robots.embodiment import Arm
from robospa.harness.robots.kinematics import forward, link_frames
from robospa.harness.skills.workspace import Workspace, is_wall
from robospa.tasks.objects.build import points_of
from robospa.tasks.shapes import Box, ObjectModel
from robospa.workcell import WORKCELL, Gripper

BEHIND = 0.2
"""Half of how deep [m] the space behind a wall is that no part of a gripper may enter."""
GROWN = 0.004
"""How much larger than they are [m] neighbours count to every side."""
NEAR = 0.16
"""Only neighbours so near [m] to the object matter."""


@dataclass(frozen=True)
class Boxes:
    """N boxes in the world: `centre` (N, 3) [m], `turn` (N, 3, 3), `half` sizes (N, 3) [m]."""

    centre: Array
    turn: Array
    half: Array

    def depth(self, points: Array) -> float:
        """How deep [m] the deepest of `points` (M, 3) lies in any of the boxes; 0 in none."""
        return float(self.depths(points[None])[0])

    def depths(self, points: Array) -> Array:
        """The same (N,) of each row of points (N, M, 3)."""
        worst = np.zeros(len(points))
        for centre, turn, half in zip(self.centre, self.turn, self.half, strict=True):
            inside = half - np.abs((points - centre) @ turn)
            worst = np.maximum(worst, inside.min(axis=2).max(axis=1, initial=0.0))
        return worst

    def points(self) -> Array:
        """Points (27 N, 3) [m, world]: corners and middles of edges, faces and boxes."""
        steps = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
        inside = steps[None] * self.half[:, None]
        points: Array = self.centre[:, None] + np.einsum("nij,nkj->nki", self.turn, inside)
        return points.reshape(-1, 3)


def _boxes(parts: Sequence[tuple[Pose, Array]]) -> Boxes:
    return Boxes(
        np.array([pose.position for pose, _ in parts]).reshape(-1, 3),
        np.array([to_matrix(pose.rotation) for pose, _ in parts]).reshape(-1, 3, 3),
        np.array([half for _, half in parts]).reshape(-1, 3),
    )


def bounding_box(model: ObjectModel, pose: Pose) -> Boxes:
    """The object's bounding box."""
    middle = Pose((0.0, 0.0, model.bottom + model.size[2] / 2))
    return _boxes([(pose * middle, np.array(model.size) / 2)])


def own_boxes(model: ObjectModel, pose: Pose) -> Boxes:
    """The colliding boxes of which the object is made."""
    parts = [s for s in model.shapes if s.collision and isinstance(s.geometry, Box)]
    return _boxes(
        [(pose * s.pose, np.array(s.geometry.half)) for s in parts if isinstance(s.geometry, Box)]
    )


def part_boxes(model: ObjectModel, pose: Pose, grown: float = 0.0) -> Boxes:
    """Boxes around each of the colliding shapes, along its axes, `grown` [m] to every side."""
    parts = []
    for shape in model.shapes:
        if shape.collision:
            points = points_of(replace(shape, pose=Pose()))
            low, high = points.min(axis=0), points.max(axis=0)
            x, y, z = ((low + high) / 2).tolist()
            parts.append((pose * shape.pose * Pose((x, y, z)), (high - low) / 2 + grown))
    return _boxes(parts)


def neighbours(ws: Workspace, target: str) -> Boxes:
    """What stands near `target`, a little grown; a wall with all that is behind it."""
    here = ws.pose(target).position
    near = [
        name
        for name, pose in ws.snapshot.poses.items()
        if name != target and math.dist(here[:2], pose.position[:2]) < NEAR + ws.models[name].radius
    ]
    return _boxes([_grown(ws, name) for name in near])


def standing(ws: Workspace, *without: str) -> Boxes:
    """All objects but those `without`, a little grown; a wall with all that is behind it."""
    return _boxes([_grown(ws, name) for name in ws.snapshot.poses if name not in without])


def _grown(ws: Workspace, name: str) -> tuple[Pose, Array]:
    model, pose = ws.models[name], ws.pose(name)
    middle = pose * Pose((0.0, 0.0, model.bottom + model.size[2] / 2))
    half = np.array(model.size) / 2 + GROWN
    if is_wall(model):
        x, y, z = middle.position
        middle = Pose((x, y + BEHIND, z), middle.rotation)
        half[1] += BEHIND
    return middle, half


def _grid(back: Sequence[float], side: Sequence[float], across: Sequence[float]) -> Array:
    """(3, N, 1): every combination of how far back, aside and across a point lies [m]."""
    return np.array(list(product(back, side, across))).T[:, :, None]


@cache
def _samples(hand: Gripper) -> tuple[Array, Array, Array]:
    """Sample points on both fingers and on the palm (`_grid`).

    Half the opening is added to the fingers' side; the second array is what their outer points are
    farther out, (N, 1).
    """
    wide, (half, thick) = hand.finger_half_width, hand.palm_half
    fingers = _grid((0.0, 0.03, 0.06), (1.0, 1.0, -1.0, -1.0), (-wide, wide))
    thickness = np.tile(np.repeat([0.0, hand.finger_thickness], 2), 6)[:, None]
    palm = _grid(hand.palm_back, (-half, -half / 2, 0.0, half / 2, half), (-thick, thick))
    return fingers, thickness, palm


def finger_points(hand: Gripper, pose: Pose, opening: float) -> Array:
    """Points (M, 3) [m] on fingers that are `opening` apart, the end-effector frame at `pose`."""
    ahead, side, across = to_matrix(pose.rotation).T[:, None]
    tip = np.array(pose.position) + ahead[0] * hand.tip
    finger, thickness, _ = _samples(hand)
    sideways = side * finger[1] * (opening / 2 + thickness)
    points: Array = tip - ahead * finger[0] + sideways + across * finger[2]
    return points


def palm_points(hand: Gripper, pose: Pose) -> Array:
    """Points (M, 3) [m] on the palm, the end-effector frame at `pose`."""
    ahead, side, across = to_matrix(pose.rotation).T[:, None]
    tip = np.array(pose.position) + ahead[0] * hand.tip
    _, _, palm = _samples(hand)
    points: Array = tip - ahead * palm[0] + side * palm[1] + across * palm[2]
    return points


SPARE = 0.01
"""What is left [m] between an arm and the table."""
TOUCH = 0.005
"""An arm deeper [m] than this in something is in its way."""
EDGE = 0.06
"""What of a hand is farther [m] than this from the fingers' axis is beside what they touch."""
SPACING = 0.05
"""Points on a link's box are at most so far apart [m]."""


@cache
def _points(arm: Arm) -> tuple[tuple[int, Array], ...]:
    """Of every link that collides: its index among the moved ones, and points (K, 3) [m] on it."""
    found = []
    for index, joint in enumerate(arm.joints):
        grids = []
        for shape in arm.shapes[joint.child]:
            if shape.collision and isinstance(shape.geometry, Box):
                half = shape.geometry.half
                sides = [np.linspace(-h, h, 1 + math.ceil(2 * h / SPACING)) for h in half]
                grid = np.array(list(product(*sides)))
                grids.append(grid @ to_matrix(shape.pose.rotation).T + shape.pose.position)
        if grids:
            found.append((index, np.concatenate(grids)))
    return tuple(found)


def arm_points(ws: Workspace, arm: int, joints: Array) -> Array:
    """Points (N, K, 3) [m, world] on forearm, wrist and hand at joints (N, J)."""
    parts = _link_points(ws, arm, joints)
    return np.concatenate(parts, axis=1) if parts else np.empty((len(joints), 0, 3))


def edge_depth(ws: Workspace, arm: int, joints: Array) -> Array:
    """How deep (N,) [m] the edges of a wide hand are in things: what of the last link, the hand
    without its fingers, is farther than EDGE from their axis."""
    parts = _link_points(ws, arm, joints)
    if not parts or not len(joints):
        return np.zeros(len(joints))
    frames, _ = forward(ws.chains[arm], joints[:1])
    beside = (parts[-1][0] - frames[0, :3, 3]) @ frames[0, :3, 1:3]
    return standing(ws).depths(parts[-1][:, np.hypot(*beside.T) > EDGE])


def _link_points(ws: Workspace, arm: int, joints: Array) -> list[Array]:
    """Points (N, K, 3) [m, world] on every link that collides, from the base outwards."""
    frames = link_frames(ws.chains[arm], joints)
    return [
        points @ frames[i][:, :3, :3].transpose(0, 2, 1) + frames[i][:, None, :3, 3]
        for i, points in _points(ws.robot.arms[arm])
    ]


def arm_depth(ws: Workspace, arm: int, joints: Array, *without: str) -> Array:
    """How deep (N,) [m] the arm at joints (N, J) is in the table or in things but for `without`."""
    if not len(joints):
        return np.zeros(0)
    points = arm_points(ws, arm, joints)
    if not points.shape[1]:
        return np.zeros(len(joints))
    half_x, half_y = WORKCELL.table.size[0] / 2, WORKCELL.table.size[1] / 2
    over = (np.abs(points[..., 0]) < half_x) & (np.abs(points[..., 1]) < half_y)
    below = np.where(over, ws.scene.table_top + SPARE - points[..., 2], 0.0)
    depth: Array = np.maximum(below.max(axis=1, initial=0.0), standing(ws, *without).depths(points))
    return depth
