"""What grippers hold, and objects that are lifted and dropped.

`LiftTracker` gives events for the failure analysis, never for success.

An object is grasped once it is 3 cm above its rest height with a gripper that is not open around
it. It is dropped if it then falls faster than 0.6 m/s, which takes about 2 cm of free fall, away
from that gripper and at a place where it is not meant to fall.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from robospa.geometry import Vec3
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.snapshot import GRIPPER_CLOSED, GRIPPER_OPEN, Snapshot

LIFT = 0.03
"""Height [m] above the last rest height at which a held object counts as lifted."""

FALL_SPEED = 0.6
"""Downward speed [m/s] of a falling object."""

RELEASE = 0.2
"""Seconds after letting go during which a fall still belongs to the lift."""

SLIP = 0.01
"""A falling object has left the gripper by more than this [m]."""


def grippers_open(snapshot: Snapshot) -> bool:
    """True if both grippers are commanded open."""
    left, right = snapshot.gripper
    return left > GRIPPER_OPEN and right > GRIPPER_OPEN


def closed_near(snapshot: Snapshot, point: Vec3, radius: float) -> bool:
    """True if a gripper that is not open has its grasp centre within `radius` [m] of `point`."""
    return holding_arm(snapshot, point, radius) is not None


def holding_arm(snapshot: Snapshot, point: Vec3, radius: float) -> int | None:
    """The arm (0 left, 1 right) whose gripper is not open and within `radius` [m] of `point`."""
    for arm, opening in enumerate(snapshot.gripper):
        if opening <= GRIPPER_OPEN:
            x, y, z = snapshot.grasp_points[arm]
            dx, dy, dz = x - point[0], y - point[1], z - point[2]
            if dx * dx + dy * dy + dz * dz < radius * radius:
                return arm
    return None


@dataclass
class _Hold:
    """Last time an arm held an object, and how far [m] below its grasp centre the origin was."""

    arm: int
    time: float
    below: float


class LiftTracker:
    """Follows `names`; `radius` [m] bounds the distance from grasp centre to a held origin.

    `middles` [m, object frame] are the points that count in place of the origins of tall objects.
    `may_fall(position)` says where falling is part of the task (over a bin).
    """

    def __init__(
        self,
        names: Iterable[str],
        radius: float = 0.12,
        may_fall: Callable[[Vec3], bool] = lambda position: False,
        middles: Mapping[str, Vec3] = MappingProxyType({}),
    ) -> None:
        self._names = tuple(names)
        self._middles = middles
        self._radius = radius
        self._may_fall = may_fall
        self._lifted: dict[str, _Hold] = {}
        self._rest: dict[str, float] = {}
        self._heights: list[float | None] = [None] * len(self._names)
        self._time = 0.0
        self.drops = 0

    def start(self, snapshot: Snapshot) -> None:
        """Take the heights at rest from the settled scene (else from the first update)."""
        self._heights, self._time = snapshot.heights(self._names), snapshot.time
        for name, z in zip(self._names, self._heights, strict=True):
            if z is not None:
                self._rest[name] = z

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        before, last_time = self._heights, self._time
        heights = self._heights = snapshot.heights(self._names)
        time = self._time = snapshot.time
        events: tuple[Event, ...] = ()
        if heights == before and not self._lifted:
            return events
        for name, z, last in zip(self._names, heights, before, strict=True):
            if z is None or last is None:
                if z is not None:
                    self._rest.setdefault(name, z)
            elif name in self._lifted:
                speed = (last - z) / max(time - last_time, 1e-6)
                events += self._carried(snapshot, name, snapshot.position(name), speed)
            elif z != last:
                events += self._raised(snapshot, name, snapshot.position(name))
        return events

    def _raised(self, snapshot: Snapshot, name: str, at: Vec3) -> tuple[Event, ...]:
        arm = self._holding_arm(snapshot, name, at)
        if arm is None:
            self._rest[name] = at[2]
        elif at[2] > self._rest[name] + LIFT:
            below = snapshot.grasp_points[arm][2] - at[2]
            self._lifted[name] = _Hold(arm, snapshot.time, below)
            return (Event(snapshot.time, "grasped", name),)
        return ()

    def _carried(self, snapshot: Snapshot, name: str, at: Vec3, speed: float) -> tuple[Event, ...]:
        """A lifted object that falls at `speed` [m/s]."""
        hold = self._lifted[name]
        below = snapshot.grasp_points[hold.arm][2] - at[2]
        if speed > FALL_SPEED and below > hold.below + SLIP:
            del self._lifted[name]
            self._rest[name] = at[2]
            if not self._may_fall(at):
                self.drops += 1
                return (Event(snapshot.time, "dropped", name),)
            return ()
        arm = self._holding_arm(snapshot, name, at)
        if arm is not None and speed <= FALL_SPEED:
            below = snapshot.grasp_points[arm][2] - at[2]
            self._lifted[name] = _Hold(arm, snapshot.time, below)
        elif snapshot.time - hold.time > RELEASE:
            del self._lifted[name]
            self._rest[name] = at[2]
        return ()

    def _holding_arm(self, snapshot: Snapshot, name: str, at: Vec3) -> int | None:
        """The arm that may hold the object whose origin is `at` [m], if any."""
        if name in self._middles:
            at = snapshot.poses[name].apply(self._middles[name])
        return holding_arm(snapshot, at, self._radius)


CARRY_DISTANCE = 0.15
"""An object whose middle is this near [m] to a grasp centre may be carried by that arm."""
WRONG = 0.03
"""Rise [m] above the start that makes another object wrongly lifted."""
BACK = 0.01
"""Rise [m] below which that object may be lifted anew."""


@dataclass(frozen=True)
class Lift:
    """The conditions of a lift; those that are None or False are not tested.

    `above`: the origin is higher than this [m, world]. `rise`: it is higher than at the start by
    more than this [m]. `steady`: every other object is within this [m] of its start height.
    `closed`: an arm that carries the object has its commanded gripper below 0.2 (else: below 0.8).
    `touching`: a gripper is in contact with the object.
    """

    above: float | None = None
    rise: float | None = None
    steady: float | None = None
    closed: bool = False
    touching: bool = False


class PickTracker:
    """Tracks the lifting of `target` among `names`; emits subtask 0 and success at once.

    `middles` [m, object frame] are the points of tall objects that a carrying gripper is near to,
    where that is not the origin.
    """

    total = 1

    def __init__(
        self,
        target: str,
        names: tuple[str, ...],
        lift: Lift,
        middles: Mapping[str, Vec3] = MappingProxyType({}),
    ) -> None:
        if target not in names:
            raise ValueError(f"target {target!r} is not among the objects {list(names)}")
        if lift.above is None and lift.rise is None:
            raise ValueError("a lift without a height test is never wrong; give `above` or `rise`")
        self.target = target
        self.others = tuple(name for name in names if name != target)
        self.lift = lift
        self.needs_contacts = lift.touching
        self._names = names
        self._middles = middles
        self._begin()

    @property
    def roles(self) -> dict[str, ObjectRole]:
        return {name: ObjectRole((0,) if name == self.target else ()) for name in self._names}

    def _begin(self) -> None:
        self._lift_tracker = LiftTracker(self._names, CARRY_DISTANCE, middles=self._middles)
        self._heights: list[float] = []
        self._goal_height = float("inf")
        self._wrong: set[str] = set()
        self._done = False

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        self._begin()
        self._heights = [snapshot.height(name) for name in self.others]
        heights = [] if self.lift.above is None else [self.lift.above]
        if self.lift.rise is not None:
            heights.append(snapshot.height(self.target) + self.lift.rise)
        self._goal_height = max(heights)
        return self._lift_tracker.update(snapshot)

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        if self._done:
            return ()
        events = self._lift_tracker.update(snapshot)
        steady, most = True, self.lift.steady
        for name, start in zip(self.others, self._heights, strict=True):
            rise = snapshot.height(name) - start
            if most is not None and abs(rise) > most:
                steady = False
            if rise > WRONG and name not in self._wrong:
                self._wrong.add(name)
                events += (Event(snapshot.time, "wrong_object", name),)
            elif rise < BACK:
                self._wrong.discard(name)
        if steady and snapshot.height(self.target) > self._goal_height and self._held(snapshot):
            self._done = True
            events += (
                Event(snapshot.time, "subtask_done", self.target, 0),
                Event(snapshot.time, "success", self.target),
            )
        return events

    def diagnostics(self) -> dict[str, object]:
        return {}

    def _held(self, snapshot: Snapshot) -> bool:
        """True if a gripper carries the target by the rules of this lift."""
        opening = GRIPPER_CLOSED if self.lift.closed else GRIPPER_OPEN
        point = snapshot.poses[self.target].apply(self._middles.get(self.target, (0.0, 0.0, 0.0)))
        if not carried(snapshot, point, opening):
            return False
        return not self.lift.touching or bool(snapshot.gripper_contacts(self.target))


def carried(snapshot: Snapshot, point: Vec3, opening: float) -> bool:
    """True if an arm commanded to less than `opening` has its grasp centre near `point`."""
    for commanded, (x, y, z) in zip(snapshot.gripper, snapshot.grasp_points, strict=True):
        if commanded < opening:
            dx, dy, dz = x - point[0], y - point[1], z - point[2]
            if dx * dx + dy * dy + dz * dz < CARRY_DISTANCE**2:
                return True
    return False
