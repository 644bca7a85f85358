"""Collecting objects in a container, in any order.

An object counts once it is inside the container's walls, below its rim, and slow: one that merely
flies past does not. It stops counting only when it leaves the walls again, so that it may be
jostled by the next one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event
from robospa.tasks.goals.flags import Flags
from robospa.tasks.goals.handling import Handling
from robospa.tasks.goals.hands import Role
from robospa.tasks.snapshot import Snapshot

SLOW = 0.2
"""Speed [m/s] below which an object inside the container counts."""


class Container:
    """A fixed container at `pose`: `half` sizes [m] of its walls in x and y, `rim` height [m]."""

    def __init__(self, pose: Pose, half: tuple[float, float], rim: float) -> None:
        self.half = half
        self.rim = rim
        self._base = pose.position[2]
        self._to_local = pose.inverse()

    def over(self, point: Vec3) -> bool:
        """Whether `point` [m, world] lies inside the walls, at any height."""
        x, y, _ = self._to_local.apply(point)
        return abs(x) < self.half[0] and abs(y) < self.half[1]

    def inside(self, point: Vec3) -> bool:
        """Whether `point` [m, world] lies inside the walls and between ground and rim.

        Containers stand upright.
        """
        return 0.0 <= point[2] - self._base < self.rim and self.over(point)


class Collect:
    """Bring every object of `names` into `container`; subtask i is object i, not latched.

    `lost_below` [m] is the height under which an object outside the container cannot be fetched
    any more; it is reported as dropped, and the trial goes on (official).
    """

    needs_contacts = False

    def __init__(self, names: Sequence[str], container: Container, lost_below: float) -> None:
        self.total = len(names)
        self._names = tuple(names)
        self._container = container
        self._lost_below = lost_below
        self._flags = Flags(self.total)
        self._handling = Handling(names, radius=0.2, may_fall=container.over)
        self._last: dict[str, Vec3] = {}
        self._time = 0.0
        self._lost: set[str] = set()

    @property
    def roles(self) -> dict[str, Role]:
        """Every object to collect."""
        return {name: Role((i,)) for i, name in enumerate(self._names)}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Nothing is collected yet."""
        self._handling.start(snapshot)
        self._time, self._last = snapshot.time, self._places(snapshot)
        return ()

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Changes of the flags, drops; success once every object is in."""
        events = self._handling.update(snapshot)
        elapsed = max(snapshot.time - self._time, 1e-6)
        held, places = self._flags.held, self._places(snapshot)
        for i, (name, here) in enumerate(places.items()):
            inside = self._container.inside(here)
            if inside and not held[i]:
                inside = math.dist(here, self._last[name]) < SLOW * elapsed
            elif not inside and here[2] < self._lost_below and self._is_lost(name, here):
                events += (Event(snapshot.time, "dropped", name, i, "out of reach"),)
            if inside != held[i]:
                events += self._flags.set(i, inside, snapshot.time, name)
        self._time, self._last = snapshot.time, places
        return (*events, Event(snapshot.time, "success")) if self._flags.all else events

    def _is_lost(self, name: str, here: Vec3) -> bool:
        """Whether a low object is beside the container, for the first time."""
        if name in self._lost or self._container.over(here):
            return False
        self._lost.add(name)
        return True

    def _places(self, snapshot: Snapshot) -> dict[str, Vec3]:
        return {name: snapshot.position(name) for name in self._names}

    def diagnostics(self) -> dict[str, float]:
        """`idle_progress` (none), objects `lost` beside the container, and `drops`."""
        return {"idle_progress": 0.0, "lost": len(self._lost), "drops": self._handling.drops}
