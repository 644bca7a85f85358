"""Conditions on where an object is: the parts of a checklist.

A placement counts from the moment nothing holds the object: the official rules also count what is
carried past.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from robospa.geometry import Pose, Vec3
from robospa.tasks.goals.subtask_flags import closed_near
from robospa.tasks.snapshot import Snapshot

HELD_RADIUS = 0.07
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds the object."""
SLOW = 0.2
"""Speed [m/s] below which an object inside a container counts: one that flies past does not."""


class Part(Protocol):
    """A condition on object `name`; `targets` are the objects it is judged against.

    `movers` are the objects that are moved to meet it. It stays done once done if `latched`; it
    cannot hold before subtask `after` was done once.
    """

    @property
    def name(self) -> str: ...

    @property
    def movers(self) -> tuple[str, ...]: ...

    @property
    def targets(self) -> tuple[str, ...]: ...

    @property
    def latched(self) -> bool: ...

    @property
    def after(self) -> int | None: ...

    def start(self, snapshot: Snapshot) -> None: ...

    def holds(self, snapshot: Snapshot, before: bool) -> bool: ...


@dataclass(frozen=True)
class Given:
    """A subtask about `name` that holds from the start (official)."""

    name: str
    movers: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    latched: bool = True
    after: int | None = None

    def start(self, snapshot: Snapshot) -> None:
        """Nothing to remember."""

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        """Always."""
        return True


Near = Callable[[Pose, Pose], bool]
"""Whether an object's pose is right, given that of its target (or its own at the start)."""


@dataclass
class Rests:
    """`name` is where `near` wants it relative to one of `targets`, let go of.

    Without targets it is judged against its own pose at the start. A gripper that is not open holds
    it while its grasp centre is within `held_radius` [m] of `grip`, a point of the object.
    """

    name: str
    targets: tuple[str, ...]
    near: Near
    latched: bool = False
    after: int | None = None
    held_radius: float = HELD_RADIUS
    grip: Vec3 = (0.0, 0.0, 0.0)
    _home: Pose = Pose()

    @property
    def movers(self) -> tuple[str, ...]:
        """The object itself."""
        return (self.name,)

    def start(self, snapshot: Snapshot) -> None:
        """Remember where the object was."""
        self._home = snapshot.poses[self.name]

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        """True if it lies there; `before` is the last value."""
        pose = snapshot.poses[self.name]
        against = [snapshot.poses[t] for t in self.targets] or [self._home]
        if not any(self.near(pose, other) for other in against):
            return False
        return before or not closed_near(snapshot, pose.apply(self.grip), self.held_radius)


class Container:
    """A fixed container at `pose`: `half` sizes [m] of its walls in x and y, `rim` height [m]."""

    def __init__(self, pose: Pose, half: tuple[float, float], rim: float) -> None:
        self.half = half
        self.rim = rim
        self._base = pose.position[2]
        self._to_local = pose.inverse()

    def over(self, point: Vec3) -> bool:
        """True if `point` [m, world] lies inside the walls, at any height."""
        x, y, _ = self._to_local.apply(point)
        return abs(x) < self.half[0] and abs(y) < self.half[1]

    def inside(self, point: Vec3) -> bool:
        """True if `point` [m, world] lies inside the walls and between ground and rim.

        Containers stand upright.
        """
        return 0.0 <= point[2] - self._base < self.rim and self.over(point)


class Inside:
    """`name` came to rest inside `container`; `target` names the container's object, if it counts.

    If it is not `latched`, it counts until it leaves the container, rolling about or not.
    """

    after: int | None = None

    def __init__(
        self, name: str, target: str | None, container: Container, latched: bool = True
    ) -> None:
        self.name = name
        self.latched = latched
        self.movers = (name,)
        self.targets = () if target is None else (target,)
        self._container = container
        self._last: Vec3 = (0.0, 0.0, 0.0)
        self._time = 0.0

    def start(self, snapshot: Snapshot) -> None:
        """Remember where it was, to tell how fast it is."""
        self._last, self._time = snapshot.position(self.name), snapshot.time

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        """True if it is inside, and slow if it was not there `before`."""
        here = snapshot.position(self.name)
        elapsed = max(snapshot.time - self._time, 1e-6)
        slow = math.dist(here, self._last) < SLOW * elapsed
        self._last, self._time = here, snapshot.time
        return (slow or before) and self._container.inside(here)


def on_spot(reach: float, low: float, high: float, of: Pose, at: Pose) -> Near:
    """Point `of` of the object is over point `at` of the target: level and height [m].

    Less than `reach` apart in the plane, and between `low` and `high` above it.
    """

    def near(pose: Pose, target: Pose) -> bool:
        x, y, z = pose.apply(of.position)
        tx, ty, tz = target.apply(at.position)
        return math.hypot(x - tx, y - ty) < reach and low < z - tz < high

    return near


def level_with(reach: float, low: float, high: float) -> Near:
    """Origins less than `reach` [m] apart in x and in y, the object's at a height in low..high.

    Heights are in metres, world frame.
    """

    def near(pose: Pose, target: Pose) -> bool:
        x, y, z = pose.position
        tx, ty, _ = target.position
        return abs(x - tx) < reach and abs(y - ty) < reach and low < z < high

    return near


@dataclass(frozen=True)
class Region:
    """A rectangle of the table: `x` and `y` ranges [m]."""

    x: tuple[float, float] = (-math.inf, math.inf)
    y: tuple[float, float] = (-math.inf, math.inf)

    def holds(self, x: float, y: float) -> bool:
        """True if the point lies in it, its edge included."""
        return self.x[0] <= x <= self.x[1] and self.y[0] <= y <= self.y[1]

    def over(self, point: Vec3) -> bool:
        """True if `point` [m, world] lies inside, at any height, its edge left out."""
        return self.x[0] < point[0] < self.x[1] and self.y[0] < point[1] < self.y[1]


def lying_in(regions: Sequence[Region], lowest: float) -> Near:
    """In one of `regions`, its origin not below `lowest` [m, world]."""

    def near(pose: Pose, home: Pose) -> bool:
        x, y, z = pose.position
        return z >= lowest and any(region.holds(x, y) for region in regions)

    return near


def put_into(region: Region, rise: float) -> Near:
    """Inside `region`, its origin at most `rise` [m] higher than it was at the start."""

    def near(pose: Pose, home: Pose) -> bool:
        return region.over(pose.position) and pose.position[2] <= home.position[2] + rise

    return near
