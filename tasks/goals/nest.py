"""Stacking equal vessels into each other on a base, in any order.

The lowest vessel over the base begins the stack; then, again and again, the lowest of the others
that stands in the topmost one joins it. A vessel begins to count when nothing holds it; the stack
is looked for afresh every time, so that taking the lowest one away takes all others with it.
"""

from __future__ import annotations

from collections.abc import Sequence

from robospa.geometry import Vec3
from robospa.tasks.events import Event
from robospa.tasks.goals.flags import Flags, both_open, closed_near
from robospa.tasks.goals.handling import Handling
from robospa.tasks.goals.hands import Role
from robospa.tasks.snapshot import Snapshot

OVER_BASE, OVER_TOP = 0.05, 0.04
"""Largest offset [m] in x and in y from the base's centre, and from the vessel below."""

RISE = (0.005, 0.08)
"""A vessel stands so much higher [m] than the one below it."""

HELD_RADIUS = 0.09
"""A gripper that is not open and this near [m] to a vessel's origin may hold its rim."""


class Nest:
    """`names` stacked on the fixed object `base`; subtask i is vessel i, not latched.

    Success: all are in one stack and both grippers are open.
    """

    needs_contacts = False

    def __init__(self, names: Sequence[str], base: str) -> None:
        self.total = len(names)
        self._names = tuple(names)
        self._base = base
        self._flags = Flags(self.total)
        self._handling = Handling(names, radius=HELD_RADIUS)

    @property
    def roles(self) -> dict[str, Role]:
        """Every vessel; the base is a mere place."""
        found = {name: Role((i,)) for i, name in enumerate(self._names)}
        return {self._base: Role(), **found}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """What stands on the base already, if anything does."""
        self._handling.start(snapshot)
        return self._look(snapshot)

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Changes of the flags, drops; success."""
        events = self._handling.update(snapshot) + self._look(snapshot)
        if self._flags.all and both_open(snapshot):
            events += (Event(snapshot.time, "success"),)
        return events

    def _look(self, snapshot: Snapshot) -> tuple[Event, ...]:
        stack = self._stack(snapshot)
        events: tuple[Event, ...] = ()
        for i, name in enumerate(self._names):
            now = name in stack
            if now == self._flags.held[i]:
                continue
            if not now or not closed_near(snapshot, snapshot.poses[name].position, HELD_RADIUS):
                events += self._flags.set(i, now, snapshot.time, name)
        return events

    def _stack(self, snapshot: Snapshot) -> list[str]:
        """The vessels of the stack from bottom to top."""
        at = {name: snapshot.poses[name].position for name in self._names}
        rest = sorted(self._names, key=lambda name: at[name][2])
        below, reach = snapshot.poses[self._base].position, OVER_BASE
        lowest, highest = float("-inf"), float("inf")
        stack: list[str] = []
        while True:
            found = next(
                (
                    name
                    for name in rest
                    if _over(at[name], below, reach) and lowest < at[name][2] - below[2] < highest
                ),
                None,
            )
            if found is None:
                return stack
            stack.append(found)
            rest.remove(found)
            below, reach, (lowest, highest) = at[found], OVER_TOP, RISE

    def diagnostics(self) -> dict[str, float]:
        """Progress of doing nothing (none), and drops."""
        return {"idle_progress": 0.0, "drops": self._handling.drops}


def _over(point: Vec3, below: Vec3, reach: float) -> bool:
    return abs(point[0] - below[0]) < reach and abs(point[1] - below[1]) < reach
