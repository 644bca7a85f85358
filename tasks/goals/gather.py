"""Bringing the right objects into a region that no other object may enter.

Flags do not latch: an object that leaves the region stops counting. It counts from the moment
nothing holds it and it lies no higher than it lay before; the official rule also counts what is
carried through. A wrong object in the region, at any height, fails for good (official).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robospa.geometry import Vec3
from robospa.tasks.events import Event
from robospa.tasks.goals.flags import Flags, both_open, closed_near
from robospa.tasks.goals.handling import Handling
from robospa.tasks.goals.hands import Role
from robospa.tasks.snapshot import Snapshot

HEIGHT_TOLERANCE = 0.02
"""An object in the region may be this much higher [m] than at the start."""

HELD_RADIUS = 0.03
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds the object."""


@dataclass(frozen=True)
class Region:
    """A rectangle on the table: `x` and `y` ranges [m], at any height."""

    x: tuple[float, float]
    y: tuple[float, float]

    def over(self, point: Vec3) -> bool:
        """Whether `point` [m, world] lies inside, at any height."""
        return self.x[0] < point[0] < self.x[1] and self.y[0] < point[1] < self.y[1]


class Gather:
    """All of `targets` in `region` at once, none of `others` ever; subtask i is target i.

    Success needs both grippers open.
    """

    needs_contacts = False

    def __init__(self, targets: Sequence[str], others: Sequence[str], region: Region) -> None:
        self.total = len(targets)
        self._targets = tuple(targets)
        self._others = tuple(others)
        self._region = region
        self._flags = Flags(self.total)
        self._handling = Handling((*targets, *others), radius=0.06)
        self._heights: dict[str, float] = {}
        self._wrong_lifts = 0

    @property
    def roles(self) -> dict[str, Role]:
        """The objects to bring, and those to leave."""
        wrong = {name: Role() for name in self._others}
        return wrong | {name: Role((i,)) for i, name in enumerate(self._targets)}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Remember the heights; nothing is in the region yet."""
        self._handling.start(snapshot)
        self._heights = {name: snapshot.height(name) for name in self._targets}
        return ()

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Changes of the flags, wrong lifts, the failure; success."""
        events = self._handling.update(snapshot)
        time = snapshot.time
        for event in events:
            if event.kind == "grasped" and event.object in self._others:
                self._wrong_lifts += 1
                events += (Event(time, "wrong_object", event.object),)
        for name in self._others:
            if self._region.over(snapshot.poses[name].position):
                note = "an object that was not shown is in the region"
                return (*events, Event(time, "failed", name, note=note))
        for i, name in enumerate(self._targets):
            events += self._flags.set(i, self._in_place(snapshot, i, name), time, name)
        if self._flags.all and both_open(snapshot):
            events += (Event(time, "success"),)
        return events

    def _in_place(self, snapshot: Snapshot, i: int, name: str) -> bool:
        point = snapshot.poses[name].position
        if not self._region.over(point) or point[2] > self._heights[name] + HEIGHT_TOLERANCE:
            return False
        return self._flags.held[i] or not closed_near(snapshot, point, HELD_RADIUS)

    def diagnostics(self) -> dict[str, float]:
        """Idle progress (none), wrong objects lifted, drops."""
        return {
            "idle_progress": 0.0,
            "wrong_lifts": self._wrong_lifts,
            "drops": self._handling.drops,
        }
