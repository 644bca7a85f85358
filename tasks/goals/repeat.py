"""Counting presses: how often a gripper touched an object's press frame.

A press counts when the touch begins. The next one needs 0.1 s without a touch first, so that the
chatter of one physical contact is one press; without that rule a single press can count for five.
Where the gripper has to be closed, opening it on the object is no leaving (official).
"""

from __future__ import annotations

from typing import Protocol

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.goals.subtask_flags import SubtaskFlags, inside_box
from robospa.tasks.snapshot import GRIPPER_CLOSED, Snapshot

PRESS_BOX: Vec3 = (0.03, 0.03, 0.03)
"""Half sizes [m] of the box around the press frame in which a touch counts."""

REARM = 0.1
"""Seconds without a touch before the next press can count."""


class ActionCounter(Protocol):
    """Counts what is done to object `name`, or with it in hand if it is `carried` (a stamp).

    `raw_count` is the count without the rule against chatter.
    """

    name: str
    count: int
    raw_count: int
    carried: bool

    def start(self, snapshot: Snapshot) -> None:
        """Take over the settled scene: what holds now is not counted."""

    def update(self, snapshot: Snapshot) -> bool:
        """True if a count is added at this instant."""


class PressCounter:
    """Counts presses of object `name` at `frame` (given in the object's frame).

    With `arm` (0 left, 1 right) a touch counts only while that arm's gripper is commanded closed.
    """

    carried = False

    def __init__(
        self, name: str, frame: Pose, box: Vec3 = PRESS_BOX, arm: int | None = None
    ) -> None:
        self.name = name
        self.arm = arm
        self.frame = frame
        self.box = box
        self.count = 0
        self.raw_count = 0
        """Touches that began, chatter included: what a counter without re-arming would say."""
        self._pressing = False
        self._left = True
        self._last_touch = float("-inf")

    def touched(self, snapshot: Snapshot) -> bool:
        """True if a gripper touches the object inside the box at this instant."""
        if not snapshot.contacts:
            return False
        contacts = snapshot.gripper_contacts(self.name)
        if not contacts:
            return False
        centre = snapshot.poses[self.name].apply(self.frame.position)
        return any(inside_box(c.point, centre, self.box) for c in contacts)

    def start(self, snapshot: Snapshot) -> None:
        """Begin with what is touched now not counting as a press."""
        touching = self.touched(snapshot)
        self._pressing = touching and self._closed(snapshot)
        self._left = not touching
        if touching:
            self._last_touch = snapshot.time

    def update(self, snapshot: Snapshot) -> bool:
        """True if a press begins at this instant."""
        touching = self.touched(snapshot)
        if touching:
            self._left |= snapshot.time - self._last_touch >= REARM - 1e-9
            self._last_touch = snapshot.time
        pressing = touching and self._closed(snapshot)
        self.raw_count += pressing and not self._pressing
        self._pressing = pressing
        new = pressing and self._left
        if new:
            self._left = False
            self.count += 1
        return new

    def _closed(self, snapshot: Snapshot) -> bool:
        return self.arm is None or snapshot.gripper[self.arm] < GRIPPER_CLOSED


class Repeat:
    """Press one object a given number of times; subtask i is press i + 1, latched.

    Grippers need not be closed and the last press needs no retreat (both official). One press too
    many cannot happen before the trial ends: success latches at the last one asked for.
    """

    needs_contacts = True

    def __init__(self, counter: PressCounter, times: int) -> None:
        self.total = times
        self.counter = counter
        self._flags = SubtaskFlags(times)

    @property
    def roles(self) -> dict[str, ObjectRole]:
        """The pressed object."""
        return {self.counter.name: ObjectRole(tuple(range(self.total)), pressed=True)}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Nothing is done yet."""
        self.counter.start(snapshot)
        return ()

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """A subtask per press; success with the last one; `repeated` for each one beyond."""
        if not self.counter.update(snapshot):
            return ()
        time, name, count = snapshot.time, self.counter.name, self.counter.count
        if count > self.total:
            return (Event(time, "repeated", name, self.total - 1),)
        events = self._flags.set(count - 1, True, time, name)
        return (*events, Event(time, "success")) if count == self.total else events

    def diagnostics(self) -> dict[str, float]:
        """`presses` counted, and `raw_presses` as a counter without re-arming would see them."""
        return {
            "idle_progress": 0.0,
            "presses": self.counter.count,
            "raw_presses": self.counter.raw_count,
        }
