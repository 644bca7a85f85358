"""Lifting one object and putting it back, a given number of times.

A cycle counts when the object is back home after it was up. Whether it was let go of in between is
not asked (official); `diagnostics` counts the cycles after which nothing held it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from robospa.geometry import Pose, Vec3, rotate
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.lift_tracker import closed_near
from robospa.tasks.snapshot import Snapshot

UPRIGHT = math.cos(math.radians(36.87))
"""Least height of an upright object's own unit z axis (official: 0.8)."""

AT_HANDLE = 0.03
"""A grasp centre this near [m] to a handle is at it."""

PoseTest = Callable[[Snapshot, Pose], bool]
"""True if the condition holds, given the pose that the object had at the start."""


def held_up(name: str, above: float, handles: Sequence[Vec3]) -> PoseTest:
    """Upright, origin above `above` [m, world], left and right grasp centre at the two handles.

    `handles` are given in the object's frame.
    """

    def test(snapshot: Snapshot, home: Pose) -> bool:
        pose = snapshot.poses[name]
        if pose.position[2] <= above or not upright(pose):
            return False
        return all(
            math.dist(point, pose.apply(handle)) < AT_HANDLE
            for point, handle in zip(snapshot.grasp_points, handles, strict=True)
        )

    return test


def put_down(name: str, height: tuple[float, float], aside: float) -> PoseTest:
    """Upright, origin between so many metres over its first height, and nearly where it was.

    `aside` [m] bounds the way on the plan.
    """

    def test(snapshot: Snapshot, home: Pose) -> bool:
        pose = snapshot.poses[name]
        rise = pose.position[2] - home.position[2]
        away = math.dist(pose.position[:2], home.position[:2])
        return height[0] < rise < height[1] and away < aside and upright(pose)

    return test


def raised(name: str, rise: float) -> PoseTest:
    """The origin is more than `rise` [m] over its first height."""

    def test(snapshot: Snapshot, home: Pose) -> bool:
        return snapshot.height(name) > home.position[2] + rise

    return test


def back_home(name: str, way: float, turn: float) -> PoseTest:
    """Each coordinate within `way` [m], each quaternion component within `turn` of the start."""

    def test(snapshot: Snapshot, home: Pose) -> bool:
        pose = snapshot.poses[name]
        if any(abs(a - b) >= way for a, b in zip(pose.position, home.position, strict=True)):
            return False
        pairs = list(zip(pose.rotation, home.rotation, strict=True))
        sign = 1.0 if sum(a * b for a, b in pairs) >= 0 else -1.0
        return all(abs(a * sign - b) < turn for a, b in pairs)

    return test


def upright(pose: Pose) -> bool:
    """True if the object stands within about 37 degrees of upright."""
    return rotate(pose.rotation, (0.0, 0.0, 1.0))[2] > UPRIGHT


class CycleCounter:
    """Counts cycles of `up`, then `down` while not `up`, of object `name`.

    A gripper that is not open holds the object while its grasp centre is within `radius` [m] of the
    origin.
    """

    carried = True

    def __init__(self, name: str, up: PoseTest, down: PoseTest, radius: float = 0.12) -> None:
        self.name = name
        self.count = 0
        self.pressing = False
        """Whether the object is up or on its way down."""
        self.radius = radius
        self._up = up
        self._down = down
        self._home = Pose()
        self._lifts = 0
        self._pending = False
        self._released = 0

    def start(self, snapshot: Snapshot) -> None:
        """Remember where the object stands."""
        self._home = snapshot.poses[self.name]

    def update(self, snapshot: Snapshot) -> bool:
        """True if a cycle ends at this instant."""
        if self._pending and not closed_near(snapshot, snapshot.position(self.name), self.radius):
            self._pending, self._released = False, self._released + 1
        if self._up(snapshot, self._home):
            self._lifts += not self.pressing
            self.pressing, self._pending = True, False
        elif self.pressing and self._down(snapshot, self._home):
            self.pressing, self._pending = False, True
            self.count += 1
            return True
        return False

    def figures(self) -> dict[str, int]:
        """Lifts, and cycles before the last that ended in a release.

        The last cycle ends the trial, so that its release is not seen.
        """
        return {"lifts": self._lifts, "released": self._released}


def cycles(counter: CycleCounter, times: int) -> Checklist:
    """The goal of `times` cycles; subtask i is cycle i + 1."""
    figures = ("lifts", "released", "drops")
    return Checklist([counter] * times, radius=counter.radius, figures=figures)
