"""Which objects are carried and which fall: events for the failure analysis, never for success.

An object is grasped once it is 3 cm above its rest height with a gripper that is not open around
it. It is dropped if it then falls faster than 0.6 m/s, which takes about 2 cm of free fall, at a
place where it is not meant to fall.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from robospa.tasks.events import Event
from robospa.tasks.geometry import Vec3
from robospa.tasks.goals.flags import closed_near
from robospa.tasks.snapshot import Snapshot

LIFT = 0.03
"""Height [m] above the last rest height at which a held object counts as lifted."""

FALL_SPEED = 0.6
"""Downward speed [m/s] of a falling object."""

RELEASE = 0.2
"""Seconds after letting go during which a fall still belongs to the lift."""


def _nowhere(position: Vec3) -> bool:
    return False


class Handling:
    """Follows `names`; `radius` [m] bounds the distance from grasp centre to a held origin.

    `may_fall(position)` says where falling is part of the task (over a bin).
    """

    def __init__(
        self,
        names: Iterable[str],
        radius: float = 0.12,
        may_fall: Callable[[Vec3], bool] = _nowhere,
    ) -> None:
        self._names = tuple(names)
        self._radius = radius
        self._may_fall = may_fall
        self._lifted: dict[str, float] = {}  # when it was last held
        self._rest: dict[str, float] = {}
        self._last: dict[str, tuple[float, float]] = {}
        self.drops = 0

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """`grasped` and `dropped` events of this instant."""
        events: tuple[Event, ...] = ()
        time = snapshot.time
        for name in self._names:
            pose = snapshot.poses.get(name)
            if pose is None:
                continue
            z = pose.position[2]
            before_time, before = self._last.get(name, (time - 0.02, z))
            self._last[name] = (time, z)
            rest = self._rest.setdefault(name, z)
            held_at = self._lifted.get(name)
            if held_at is None:
                if z == before:
                    continue
                if not closed_near(snapshot, pose.position, self._radius):
                    self._rest[name] = z
                elif z > rest + LIFT:
                    self._lifted[name] = time
                    events += (Event(time, "grasped", name),)
            elif (before - z) / max(time - before_time, 1e-6) > FALL_SPEED:
                del self._lifted[name]
                self._rest[name] = z
                if not self._may_fall(pose.position):
                    self.drops += 1
                    events += (Event(time, "dropped", name),)
            elif closed_near(snapshot, pose.position, self._radius):
                self._lifted[name] = time
            elif time - held_at > RELEASE:
                del self._lifted[name]
                self._rest[name] = z
        return events
