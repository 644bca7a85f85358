"""Bringing objects into given directions at their own places.

An object counts while it lies near where it started, turned as asked, low, and not held. Flags do
not latch and there is no order (official).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robospa.geometry import Quat
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.goals.lift_tracker import LiftTracker
from robospa.tasks.goals.subtask_flags import SubtaskFlags, closed_near, grippers_open
from robospa.tasks.snapshot import Snapshot

NEAR = 0.03
"""Horizontal distance [m] from its start within which an object is in its place."""

TURN = math.radians(15)
"""Allowed error [rad] of the whole rotation."""

HELD_RADIUS = 0.06
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds the object."""


@dataclass(frozen=True)
class OrientationTarget:
    """Object `name` is to lie with this `rotation`, its origin lower than `below` [m]."""

    name: str
    rotation: Quat
    below: float


class Restore:
    """All of `targets` at once; subtask i is object i. Success needs both grippers open.

    `references` must not be moved: lifting one is an event, not a failure.
    """

    needs_contacts = False

    def __init__(self, targets: Sequence[OrientationTarget], references: Sequence[str]) -> None:
        self.total = len(targets)
        self._targets = tuple(targets)
        self._references = tuple(references)
        self._flags = SubtaskFlags(self.total)
        self._places: dict[str, tuple[float, float]] = {}
        names = [*(w.name for w in targets), *references]
        self._lift_tracker = LiftTracker(names, radius=0.08)
        self._wrong_lifts = 0
        self._out_of_order = 0

    @property
    def roles(self) -> dict[str, ObjectRole]:
        """The objects to turn, and those that show how."""
        shown = {name: ObjectRole() for name in self._references}
        return shown | {w.name: ObjectRole((i,)) for i, w in enumerate(self._targets)}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Remember the places; an object never lies as wanted at the start."""
        self._lift_tracker.start(snapshot)
        self._places = {w.name: snapshot.poses[w.name].position[:2] for w in self._targets}
        return ()

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Changes of the flags, lifted references; success."""
        events = self._lift_tracker.update(snapshot)
        time = snapshot.time
        for event in events:
            if event.kind == "grasped" and event.object in self._references:
                self._wrong_lifts += 1
                events += (Event(time, "wrong_object", event.object),)
        for i, target in enumerate(self._targets):
            now = self._right(snapshot, target)
            if now and not self._flags.held[i]:
                if closed_near(snapshot, snapshot.poses[target.name].position, HELD_RADIUS):
                    now = False
                elif i not in self._flags.order and not all(self._flags.held[:i]):
                    self._out_of_order += 1
                    events += (Event(time, "wrong_order", target.name, i),)
            events += self._flags.set(i, now, time, target.name)
        if self._flags.all and grippers_open(snapshot):
            events += (Event(time, "success"),)
        return events

    def _right(self, snapshot: Snapshot, target: OrientationTarget) -> bool:
        pose = snapshot.poses[target.name]
        x, y, z = pose.position
        px, py = self._places[target.name]
        return (
            z < target.below
            and math.hypot(x - px, y - py) < NEAR
            and angle_between(pose.rotation, target.rotation) < TURN
        )

    def diagnostics(self) -> dict[str, float]:
        """Idle progress (none), references lifted, objects out of order, drops."""
        return {
            "idle_progress": 0.0,
            "wrong_lifts": self._wrong_lifts,
            "out_of_order": self._out_of_order,
            "drops": self._lift_tracker.drops,
        }


def angle_between(a: Quat, b: Quat) -> float:
    """Angle [rad] of the rotation that leads from one to the other."""
    cosine = abs(sum(p * q for p, q in zip(a, b, strict=True)))
    return 2 * math.acos(min(1.0, cosine))
