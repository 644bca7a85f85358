"""Which objects are carried and which fall: events for the failure analysis, never for success.

An object is grasped once it is 3 cm above its rest height with a gripper that is not open around
it. It is dropped if it then falls faster than 0.6 m/s, which takes about 2 cm of free fall, away
from that gripper and at a place where it is not meant to fall.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from robospa.tasks.events import Event
from robospa.tasks.geometry import Vec3
from robospa.tasks.goals.flags import grasp_centre, holding_arm
from robospa.tasks.snapshot import Snapshot

LIFT = 0.03
"""Height [m] above the last rest height at which a held object counts as lifted."""

FALL_SPEED = 0.6
"""Downward speed [m/s] of a falling object."""

RELEASE = 0.2
"""Seconds after letting go during which a fall still belongs to the lift."""


SLIP = 0.01
"""A falling object has left the gripper by more than this [m]."""


@dataclass
class _Hold:
    """Who held an object, when last, and how far [m] below the grasp centre its origin was."""

    arm: int
    time: float
    below: float


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
        self._lifted: dict[str, _Hold] = {}
        self._rest: dict[str, float] = {}
        self._last: dict[str, tuple[float, float]] = {}
        self.drops = 0

    def start(self, snapshot: Snapshot) -> None:
        """Take the heights at rest from the settled scene (else from the first update)."""
        for name in self._names:
            if name in snapshot.poses:
                z = snapshot.poses[name].position[2]
                self._rest[name], self._last[name] = z, (snapshot.time, z)

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """`grasped` and `dropped` events of this instant."""
        events: tuple[Event, ...] = ()
        time = snapshot.time
        poses = snapshot.poses
        for name in self._names:
            if name not in poses:
                continue
            z = snapshot.height(name)
            before_time, before = self._last.get(name, (time - 0.02, z))
            self._last[name] = (time, z)
            self._rest.setdefault(name, z)
            if name not in self._lifted:
                if z != before:
                    events += self._raised(snapshot, name, poses[name].position)
            else:
                speed = (before - z) / max(time - before_time, 1e-6)
                events += self._carried(snapshot, name, poses[name].position, speed)
        return events

    def _raised(self, snapshot: Snapshot, name: str, at: Vec3) -> tuple[Event, ...]:
        """An object that moves up or down and is not lifted yet."""
        arm = holding_arm(snapshot, at, self._radius)
        if arm is None:
            self._rest[name] = at[2]
        elif at[2] > self._rest[name] + LIFT:
            below = grasp_centre(snapshot.end_effector[arm])[2] - at[2]
            self._lifted[name] = _Hold(arm, snapshot.time, below)
            return (Event(snapshot.time, "grasped", name),)
        return ()

    def _carried(self, snapshot: Snapshot, name: str, at: Vec3, speed: float) -> tuple[Event, ...]:
        """A lifted object that falls at `speed` [m/s]."""
        hold = self._lifted[name]
        below = grasp_centre(snapshot.end_effector[hold.arm])[2] - at[2]
        if speed > FALL_SPEED and below > hold.below + SLIP:
            del self._lifted[name]
            self._rest[name] = at[2]
            if not self._may_fall(at):
                self.drops += 1
                return (Event(snapshot.time, "dropped", name),)
            return ()
        arm = holding_arm(snapshot, at, self._radius)
        if arm is not None and speed <= FALL_SPEED:
            below = grasp_centre(snapshot.end_effector[arm])[2] - at[2]
            self._lifted[name] = _Hold(arm, snapshot.time, below)
        elif snapshot.time - hold.time > RELEASE:
            del self._lifted[name]
            self._rest[name] = at[2]
        return ()
