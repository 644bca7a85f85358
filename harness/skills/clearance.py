"""How deep a gripper's fingers and palm would be in what stands around them, and in the object.

Bodies are boxes: a neighbour its bounding box, the object itself the boxes that it is made of
(around its handles there is room for fingers) and, for the palm, its bounding box.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, to_matrix
from robospa.gripper import Gripper
from robospa.harness.skills.workspace import Workspace, is_wall
from robospa.tasks.objects.build import points_of
from robospa.tasks.shapes import Box, ObjectModel

Array = NDArray[np.float64]

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
    """Boxes at these poses with these half sizes."""
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
