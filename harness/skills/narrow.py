"""Ways so close past an object that its bounding box is no measure: between post and peg of a rack.

The object counts as the boxes that it is made of.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, from_transform
from robospa.harness.robots.kinematics import forward
from robospa.harness.skills.arm_clearance import TOUCH, arm_depth, arm_points
from robospa.harness.skills.clearance import (
    Boxes,
    finger_points,
    palm_points,
    part_boxes,
    standing,
)
from robospa.harness.skills.workspace import Workspace

Array = NDArray[np.float64]

STRIDE = 0.1
"""How far [rad] a joint turns at most between two places at which a way is looked at."""
MARGIN = 0.01
"""Room [m] between an arm and the object, at the least; half of it for fingers and palm."""


@dataclass(frozen=True)
class Narrow:
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
