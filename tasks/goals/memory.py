"""Opening covers in an order that could be seen only before the covers came.

Rules are the official ones: hold still until the covers are there; then open them one by one, each
into the place behind it, and never touch an opened one again. Whatever breaks them fails for good.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.goals.cue import MOVED_EARLY, Stillness
from robospa.tasks.goals.lift_tracker import LiftTracker
from robospa.tasks.goals.subtask_flags import SubtaskFlags, closed_near
from robospa.tasks.snapshot import Snapshot

OPEN_REACH = 0.045
"""Horizontal distance [m] from its open place at which a cover is open."""


HELD_RADIUS = 0.1
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds a cover."""


@dataclass(frozen=True)
class Cover:
    """A cover, and the place (x, y) [m] where it has to be put."""

    name: str
    place: tuple[float, float]


class UncoverInOrder:
    """`covers` in the order in which they have to be opened; subtask i is cover i.

    A cover is open when its origin is within 4.5 cm of its place and lower than `below` [m].
    """

    needs_contacts = False

    def __init__(self, covers: Sequence[Cover], below: float) -> None:
        self.total = len(covers)
        self._covers = tuple(covers)
        self._below = below
        self._flags = SubtaskFlags(self.total)
        self._lift_tracker = LiftTracker((c.name for c in covers), radius=HELD_RADIUS)
        self._stillness = Stillness()
        self._hidden_at: float | None = None
        self._wrong_lifts = 0
        self._over = False

    @property
    def roles(self) -> dict[str, ObjectRole]:
        """The covers."""
        return {cover.name: ObjectRole((i,)) for i, cover in enumerate(self._covers)}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Remember where the end effectors are."""
        self._stillness.start(snapshot)
        return ()

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Before the covers: stillness. After: the next cover, or what broke the order."""
        if self._over:
            return ()
        if self._hidden_at is None:
            if any(cover.name not in snapshot.poses for cover in self._covers):
                return self._still(snapshot)
            self._hidden_at = snapshot.time
            return (Event(snapshot.time, "cue_hidden"),)
        events = self._handled(snapshot)
        stage = sum(self._flags.held)
        for i, cover in enumerate(self._covers):
            is_open = self._is_open(snapshot, cover)
            if i < stage and not is_open:
                return (
                    *events,
                    self._fail(snapshot, cover.name, i, self._why_moved(snapshot, cover)),
                )
            if i > stage and is_open:
                wrong = Event(snapshot.time, "wrong_order", cover.name, i)
                return (*events, wrong, self._fail(snapshot, cover.name, i, "opened too early"))
            if i == stage and is_open:
                events += self._flags.set(i, True, snapshot.time, cover.name)
        if self._flags.all:
            self._over = True
            events += (Event(snapshot.time, "success"),)
        return events

    def _is_open(self, snapshot: Snapshot, cover: Cover) -> bool:
        x, y, z = snapshot.poses[cover.name].position
        px, py = cover.place
        return z < self._below and math.hypot(x - px, y - py) < OPEN_REACH

    def _why_moved(self, snapshot: Snapshot, cover: Cover) -> str:
        taken = closed_near(snapshot, snapshot.poses[cover.name].position, HELD_RADIUS)
        return "opened cover taken again" if taken else "opened cover moved away"

    def _still(self, snapshot: Snapshot) -> tuple[Event, ...]:
        if self._stillness.broken(snapshot):
            return (self._fail(snapshot, "", -1, MOVED_EARLY),)
        return ()

    def _handled(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Grasps and drops, and `wrong_object` for a lifted cover that is not due."""
        events = self._lift_tracker.update(snapshot)
        if not events:
            return ()
        due = self._covers[sum(self._flags.held)].name
        wrong = tuple(
            Event(e.time, "wrong_object", e.object)
            for e in events
            if e.kind == "grasped" and e.object != due
        )
        self._wrong_lifts += len(wrong)
        return (*events, *wrong)

    def _fail(self, snapshot: Snapshot, name: str, index: int, note: str) -> Event:
        self._over = True
        return Event(snapshot.time, "failed", name, index, note)

    def diagnostics(self) -> dict[str, float]:
        """Time at which the cue was hidden (-1: not yet), motion [m] before, wrong lifts, drops."""
        return {
            "idle_progress": 0.0,
            "cue_hidden_at": -1.0 if self._hidden_at is None else self._hidden_at,
            "motion_before": self._stillness.motion,
            "wrong_lifts": self._wrong_lifts,
            "drops": self._lift_tracker.drops,
        }
