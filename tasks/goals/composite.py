"""Several things to do, some clicks and some placements; the order between them is not enforced.

The paper asks for interleaving, the official code only counts: so does the primary metric here,
while `diagnostics` and `wrong_order` events say whether the asked order was kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robospa.tasks.events import Event
from robospa.tasks.goals.flags import Flags, both_open, closed_near
from robospa.tasks.goals.handling import Handling
from robospa.tasks.goals.hands import Role
from robospa.tasks.goals.repeat import PressCounter
from robospa.tasks.snapshot import Snapshot

HELD_RADIUS = 0.07
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds the object."""


@dataclass(frozen=True)
class Placement:
    """`name` lies at `target`: origins within `reach` [m] in x and in y of each other.

    The height of the origin must lie in `height` [m, world]. It counts from the moment nothing
    holds the object, and stops counting when the object leaves.
    """

    name: str
    target: str
    reach: float
    height: tuple[float, float]

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        """Whether the object lies there, given whether it did `before`."""
        x, y, z = snapshot.poses[self.name].position
        tx, ty, _ = snapshot.poses[self.target].position
        low, high = self.height
        if abs(x - tx) >= self.reach or abs(y - ty) >= self.reach or not low < z < high:
            return False
        return before or not closed_near(snapshot, (x, y, z), HELD_RADIUS)


class ClickAndPlace:
    """`subtasks` in the asked order: None is one more click, a Placement is a placement.

    Clicks latch and are capped, placements do not latch. Success: all hold and both grippers are
    open.
    """

    needs_contacts = True

    def __init__(self, counter: PressCounter, subtasks: Sequence[Placement | None]) -> None:
        self.total = len(subtasks)
        self._counter = counter
        self._subtasks = tuple(subtasks)
        self._clicks = [i for i, part in enumerate(subtasks) if part is None]
        self._flags = Flags(self.total)
        self._handling = Handling(part.name for part in subtasks if part is not None)
        self._out_of_order = 0

    @property
    def roles(self) -> dict[str, Role]:
        """What is clicked, what is placed, and where to: the places themselves are distractors."""
        parts = [(i, part) for i, part in enumerate(self._subtasks) if part is not None]
        found = {part.target: Role() for _, part in parts}
        found |= {part.name: Role((i,)) for i, part in parts}
        return found | {self._counter.name: Role(tuple(self._clicks), pressed=True)}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Placements that hold already, if any."""
        self._counter.start(snapshot)
        self._handling.start(snapshot)
        return self._placements(snapshot)

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Changes of the flags, clicks beyond the last, drops; success."""
        events = self._handling.update(snapshot)
        if self._counter.update(snapshot):
            events += self._click(snapshot.time)
        events += self._placements(snapshot)
        if self._flags.all and both_open(snapshot):
            events += (Event(snapshot.time, "success"),)
        return events

    def _click(self, time: float) -> tuple[Event, ...]:
        if self._counter.count > len(self._clicks):
            return (Event(time, "repeated", self._counter.name, self._clicks[-1]),)
        return self._set(self._clicks[self._counter.count - 1], True, time, self._counter.name)

    def _placements(self, snapshot: Snapshot) -> tuple[Event, ...]:
        events: tuple[Event, ...] = ()
        for i, part in enumerate(self._subtasks):
            if part is not None:
                now = part.holds(snapshot, self._flags.held[i])
                if now != self._flags.held[i]:
                    events += self._set(i, now, snapshot.time, part.name)
        return events

    def _set(self, i: int, value: bool, time: float, name: str) -> tuple[Event, ...]:
        first = value and i not in self._flags.order
        events = self._flags.set(i, value, time, name)
        if first and not all(self._flags.held[:i]):
            self._out_of_order += 1
            return (Event(time, "wrong_order", name, i), *events)
        return events

    def diagnostics(self) -> dict[str, float | bool]:
        """Whether the order was kept so far, how often not, clicks with and without chatter."""
        return {
            "idle_progress": 0.0,
            "order_obeyed": self._out_of_order == 0,
            "out_of_order": self._out_of_order,
            "presses": self._counter.count,
            "raw_presses": self._counter.raw_count,
            "drops": self._handling.drops,
        }
