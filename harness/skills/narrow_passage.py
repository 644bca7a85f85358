"""Ways so close past an object that its bounding box is no measure: between post and peg of a rack.

`motion.route` takes things for upright cylinders, so that it finds no way out from beside a high
thing. Here the object, and what is held, count as the boxes that they are made of, arms as links.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from robospa.geometry import Array, Pose, from_transform
from robospa.harness.robots.kinematics import forward
from robospa.harness.skills.clearance import (
    TOUCH,
    Boxes,
    arm_depth,
    arm_points,
    finger_points,
    palm_points,
    part_boxes,
    standing,
)
from robospa.harness.skills.workspace import Workspace

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
        wide = part_boxes(self.ws.models[self.beside], self.ws.pose(self.beside), MARGIN)
        if (wide.depths(arm_points(self.ws, self.arm, line)) > 0).any():
            return False
        frames, _ = forward(self.ws.chains[self.arm], line)
        hand = self.ws.hand(self.arm)
        ends = [from_transform(frame) for frame in frames]
        parts = [(finger_points(hand, end, 0.0), palm_points(hand, end)) for end in ends]
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
        around = part_boxes(self.ws.models[self.beside], self.ws.pose(self.beside), MARGIN / 2)
        corners = around.points()
        return not any(around.depth(b.points()) > 0 or b.depth(corners) > 0 for b in bodies)

    def past_others(self, way: list[Array]) -> bool:
        """Whether arm and held object touch nothing but the object on these lines."""
        held = self.ws.held[self.arm]
        but = (self.beside,) if held is None else (self.beside, held)
        if (arm_depth(self.ws, self.arm, _along(way), *but) > TOUCH).any():
            return False
        others = standing(self.ws, *but)
        return not any(others.depth(body.points()) > 0 for body in self._carried(way))

    def open(self, way: list[Array]) -> bool:
        """Whether arm and held object keep clear of object and table on these lines."""
        return self.free(way) and self.above_table(way) and self.carried_past(way)

    def _carried(self, way: list[Array]) -> list[Boxes]:
        """The boxes of what is held, along the lines between joints [rad] `way`."""
        held = self.ws.held[self.arm]
        if held is None:
            return []
        frames, _ = forward(self.ws.chains[self.arm], _along(way))
        model = self.ws.models[held]
        return [part_boxes(model, from_transform(frame) * self.offset) for frame in frames]


def _along(way: list[Array]) -> Array:
    """Joints (N, J) on the lines between those of `way`, with these."""
    lines = []
    for start, goal in pairwise(way):
        count = 2 + math.ceil(float(np.abs(goal - start).max()) / STRIDE)
        lines.append(start + (goal - start) * np.linspace(0.0, 1.0, count)[:, None])
    return np.concatenate(lines)


BACK, ASIDE, UP = (0.0, 0.06, 0.12, 0.18), (0.0, 0.06, -0.06, 0.12, -0.12), (0.0, 0.04, 0.08, 0.12)
"""How far [m] towards the robot, sideways and up from the start a stop may be."""


def detour_stop(narrow: NarrowPassage, goal: Array) -> Array | None:
    """Joints [rad] of a stop between here and joints `goal` with which the arm and what it holds
    get around the object of `narrow`, and past all else; None if there is none."""
    ws, arm = narrow.ws, narrow.arm
    start = ws.joints[arm]
    frames, _ = forward(ws.chains[arm], np.stack([start, goal]))
    here, there = (from_transform(frame) for frame in frames)
    x, y, z = here.position
    for back, aside, up in product(BACK, ASIDE, UP):
        place = (x + aside, y - back, z + up)
        for rotation, near in ((here.rotation, start), (there.rotation, goal)):
            stop = ws.solve(arm, Pose(place, rotation), near)
            if stop is None:
                continue
            way = [start, stop, goal]
            if narrow.open(way) and narrow.past_others(way):
                return stop
    return None
