"""Subtask flags and the small predicates that the trackers share."""

from __future__ import annotations

from robospa.geometry import Vec3
from robospa.tasks.events import Event
from robospa.tasks.snapshot import GRIPPER_OPEN, Snapshot


class SubtaskFlags:
    """The state of `total` subtasks; every change becomes an event."""

    def __init__(self, total: int) -> None:
        self.held = [False] * total
        self.order: list[int] = []
        """Indices in the order in which they were first done."""

    def set(self, index: int, value: bool, time: float, name: str = "") -> tuple[Event, ...]:
        """Give subtask `index` a value; an event if it changes."""
        if self.held[index] == value:
            return ()
        self.held[index] = value
        if value and index not in self.order:
            self.order.append(index)
        return (Event(time, "subtask_done" if value else "subtask_undone", name, index),)

    @property
    def all(self) -> bool:
        """True if every subtask holds."""
        return all(self.held)


def grippers_open(snapshot: Snapshot) -> bool:
    """True if both grippers are commanded open."""
    left, right = snapshot.gripper
    return left > GRIPPER_OPEN and right > GRIPPER_OPEN


def closed_near(snapshot: Snapshot, point: Vec3, radius: float) -> bool:
    """True if a gripper that is not open has its grasp centre within `radius` [m] of `point`."""
    return holding_arm(snapshot, point, radius) is not None


def holding_arm(snapshot: Snapshot, point: Vec3, radius: float) -> int | None:
    """The arm (0 left, 1 right) whose gripper is not open and within `radius` [m] of `point`."""
    for arm, opening in enumerate(snapshot.gripper):
        if opening <= GRIPPER_OPEN:
            x, y, z = snapshot.grasp_points[arm]
            dx, dy, dz = x - point[0], y - point[1], z - point[2]
            if dx * dx + dy * dy + dz * dz < radius * radius:
                return arm
    return None


def inside_box(point: Vec3, centre: Vec3, half: Vec3) -> bool:
    """True if `point` lies strictly inside the axis-aligned box around `centre`."""
    return (
        abs(point[0] - centre[0]) < half[0]
        and abs(point[1] - centre[1]) < half[1]
        and abs(point[2] - centre[2]) < half[2]
    )
