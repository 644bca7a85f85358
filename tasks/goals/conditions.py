"""Conditions on where an object is, or how far open: subtasks of a checklist.

A placement counts from the moment nothing holds the object: the official rules also count what is
carried past.
"""

import math
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

from robospa.geometry import Pose, Vec3
from robospa.tasks.goals.lifting import closed_near, grippers_open
from robospa.tasks.snapshot import Snapshot

HELD_RADIUS = 0.07
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds the object."""
SLOW = 0.2
"""Speed [m/s] below which an object inside a container counts: one that flies past does not."""


@dataclass
class Condition:
    """A condition on object `name`; `targets` are the objects it is judged against.

    It stays done once done if `latched`; it cannot hold before subtask `after` was done once.
    """

    name: str
    _: KW_ONLY
    targets: tuple[str, ...] = ()
    latched: bool = False
    after: int | None = None

    @property
    def movers(self) -> tuple[str, ...]:
        """The objects that are moved to meet it."""
        return (self.name,)

    def start(self, snapshot: Snapshot) -> None:
        """Take over the settled scene."""

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        """True if it holds at this instant; `before` is the last value."""
        raise NotImplementedError


@dataclass
class Given(Condition):
    """A subtask about `name` that holds from the start (official), of an object that is `moved`."""

    moved: bool = False
    latched: bool = True

    @property
    def movers(self) -> tuple[str, ...]:
        return (self.name,) if self.moved else ()

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        return True


Near = Callable[[Pose, Pose], bool]
"""Whether an object's pose is right, given that of its target (or its own at the start)."""


@dataclass
class Rests(Condition):
    """`name` is where `near` wants it relative to one of `targets`, let go of.

    Without targets it is judged against its own pose at the start. A gripper that is not open holds
    it while its grasp centre is within `held_radius` [m] of `grip`, a point of the object. With
    `open_grippers` both have to be open where it begins to count.
    """

    near: Near
    held_radius: float = HELD_RADIUS
    grip: Vec3 = (0.0, 0.0, 0.0)
    open_grippers: bool = False
    _home: Pose = Pose()

    def start(self, snapshot: Snapshot) -> None:
        self._home = snapshot.poses[self.name]

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        pose = snapshot.poses[self.name]
        against = [snapshot.poses[t] for t in self.targets] or [self._home]
        if not any(self.near(pose, other) for other in against):
            return False
        if before:
            return True
        free = not closed_near(snapshot, pose.apply(self.grip), self.held_radius)
        return free and (not self.open_grippers or grippers_open(snapshot))


@dataclass
class Opened(Condition):
    """The door of `name` is open by at least `angle` [rad].

    It stops counting when the door closes again (official). Nothing is asked about the gripper:
    a door that is held open is open.
    """

    angle: float

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        return snapshot.hinges[self.name] >= self.angle


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


@dataclass
class Inside(Condition):
    """`name` came to rest inside `container`.

    If it is not `latched`, it counts until it leaves the container, rolling about or not.
    """

    container: Container
    _last: Vec3 = (0.0, 0.0, 0.0)
    _time: float = 0.0

    def start(self, snapshot: Snapshot) -> None:
        self._last, self._time = snapshot.position(self.name), snapshot.time

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        """True if it is inside, and slow if it was not there `before`."""
        here = snapshot.position(self.name)
        elapsed = max(snapshot.time - self._time, 1e-6)
        slow = math.dist(here, self._last) < SLOW * elapsed
        self._last, self._time = here, snapshot.time
        return (slow or before) and self.container.inside(here)


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
