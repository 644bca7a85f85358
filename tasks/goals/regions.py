"""Bringing objects into regions of the table, in any order.

An object counts from the moment it lies in one of its regions with nothing holding it, and stops
counting when it leaves. One that falls off the table counts nowhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robospa.tasks.events import Event
from robospa.tasks.goals.checklist import HELD_RADIUS
from robospa.tasks.goals.flags import Flags, both_open, closed_near
from robospa.tasks.goals.handling import Handling
from robospa.tasks.goals.hands import Role
from robospa.tasks.snapshot import Snapshot

FALLEN = 0.05
"""An origin so far [m] below the top of the table has left it."""


@dataclass(frozen=True)
class Region:
    """A rectangle of the table: `x` and `y` ranges [m], ends included."""

    x: tuple[float, float] = (-math.inf, math.inf)
    y: tuple[float, float] = (-math.inf, math.inf)

    def holds(self, x: float, y: float) -> bool:
        """Whether the point lies in it."""
        return self.x[0] <= x <= self.x[1] and self.y[0] <= y <= self.y[1]


@dataclass(frozen=True)
class Part:
    """`name` belongs into one of the regions `to`; `astray` are those it was not asked for."""

    name: str
    to: tuple[Region, ...]
    astray: tuple[Region, ...] = ()


class Regions:
    """Subtask i is part i, not latched. Success: all hold and, if `opened`, both grippers are open.

    `table_top` is the height of the table [m]. An object in a region of `astray` is a diagnostic,
    no failure.
    """

    needs_contacts = False

    def __init__(self, parts: Sequence[Part], table_top: float, opened: bool = False) -> None:
        self.total = len(parts)
        self._parts = tuple(parts)
        self._lowest = table_top - FALLEN
        self._opened = opened
        self._flags = Flags(self.total)
        self._handling = Handling((part.name for part in parts), radius=HELD_RADIUS)
        self._astray: set[str] = set()
        self._fallen: set[str] = set()

    @property
    def roles(self) -> dict[str, Role]:
        """Every object to bring."""
        return {part.name: Role((i,)) for i, part in enumerate(self._parts)}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """What lies in its region already, if anything does."""
        self._handling.start(snapshot)
        return self._look(snapshot)

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Changes of the flags, drops and falls; success."""
        events = self._handling.update(snapshot) + self._look(snapshot)
        if self._flags.all and (not self._opened or both_open(snapshot)):
            events += (Event(snapshot.time, "success"),)
        return events

    def _look(self, snapshot: Snapshot) -> tuple[Event, ...]:
        events: tuple[Event, ...] = ()
        for i, part in enumerate(self._parts):
            x, y, z = snapshot.poses[part.name].position
            if z < self._lowest and part.name not in self._fallen:
                self._fallen.add(part.name)
                events += (Event(snapshot.time, "dropped", part.name, i, "off the table"),)
            if any(region.holds(x, y) for region in part.astray):
                self._astray.add(part.name)
            now = z >= self._lowest and any(region.holds(x, y) for region in part.to)
            if now == self._flags.held[i]:
                continue
            if not now or not closed_near(snapshot, (x, y, z), HELD_RADIUS):
                events += self._flags.set(i, now, snapshot.time, part.name)
        return events

    def diagnostics(self) -> dict[str, float]:
        """Progress of doing nothing (none), objects that went astray or off the table, drops."""
        return {
            "idle_progress": 0.0,
            "astray": len(self._astray),
            "fallen": len(self._fallen),
            "drops": self._handling.drops,
        }
