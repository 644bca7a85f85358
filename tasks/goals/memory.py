"""Goals of memory tasks: hold still while something is shown, then do something about it.

What has to be remembered is hidden by objects that appear. Until then no arm may move; that is
official, and whoever breaks it has failed for good.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from robospa.geometry import Pose, Quat, Vec3
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.goals.checklist import Checklist, Watch
from robospa.tasks.goals.conditions import Rests
from robospa.tasks.goals.lifting import closed_near
from robospa.tasks.goals.placing import Bystanders
from robospa.tasks.snapshot import Snapshot
from robospa.tasks.task import Tracker

STILL = 0.03
"""No end effector may be farther [m] from its start before the cue is hidden."""


class AfterCue:
    """`goal`, which starts when the objects called `covers` have appeared; stillness before."""

    def __init__(self, goal: Tracker, covers: Sequence[str]) -> None:
        self.total = goal.total
        self.needs_contacts = goal.needs_contacts
        self._goal = goal
        self._covers = tuple(covers)
        self._origins: tuple[Vec3, ...] = ()
        self._motion = 0.0
        self._hidden_at: float | None = None
        self._over = False

    @property
    def roles(self) -> Mapping[str, ObjectRole]:
        return self._goal.roles

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        self._origins = tuple(pose.position for pose in snapshot.end_effector)
        return ()

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Before the covers: stillness. After: what the goal says, until it is won or lost."""
        if self._over:
            return ()
        if self._hidden_at is None:
            if any(name not in snapshot.poses for name in self._covers):
                for origin, pose in zip(self._origins, snapshot.end_effector, strict=True):
                    self._motion = max(self._motion, math.dist(origin, pose.position))
                self._over = self._motion > STILL
                early = Event(snapshot.time, "failed", note="moved before the cue was hidden")
                return (early,) if self._over else ()
            self._hidden_at = snapshot.time
            return (Event(snapshot.time, "cue_hidden"), *self._goal.start(snapshot))
        events = self._goal.update(snapshot)
        self._over = any(e.kind in ("success", "failed") for e in events)
        return events

    def diagnostics(self) -> dict[str, object]:
        """The goal's own, when the cue was hidden (-1: not yet) and the motion [m] before."""
        return {
            **self._goal.diagnostics(),
            "cue_hidden_at": -1.0 if self._hidden_at is None else self._hidden_at,
            "motion_before": self._motion,
        }


OPEN_REACH = 0.045
"""Horizontal distance [m] from its open place at which a cover is open."""
COVER_RADIUS = 0.1
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds a cover."""


@dataclass(frozen=True)
class Cover:
    """A cover, and the place (x, y) [m] where it has to be put, its origin lower than `below`."""

    name: str
    place: tuple[float, float]
    below: float

    def is_open(self, pose: Pose, home: Pose) -> bool:
        """True if its origin is there, wherever it began."""
        x, y, z = pose.position
        return z < self.below and math.hypot(x - self.place[0], y - self.place[1]) < OPEN_REACH


def uncover(covers: Sequence[Cover]) -> AfterCue:
    """Open `covers` in this order, each into its place, and never touch an opened one again.

    Subtask i is cover i. Whatever breaks the rules fails for good (official).
    """
    names = [cover.name for cover in covers]
    opened = [
        Rests(c.name, c.is_open, held_radius=0.0, latched=True, after=i - 1 if i else None)
        for i, c in enumerate(covers)
    ]
    watch = _Covers(covers)
    return AfterCue(Checklist(opened, radius=COVER_RADIUS, handled=names, watch=watch), names)


class _Covers(Watch):
    """Covers that are lifted or opened too early, and opened ones that do not stay open."""

    def __init__(self, covers: Sequence[Cover]) -> None:
        self._covers = tuple(covers)
        self._open = 0
        self._wrong_lifts = 0

    def update(self, snapshot: Snapshot, events: Sequence[Event]) -> tuple[Event, ...]:
        time, next_one = snapshot.time, self._covers[min(self._open, len(self._covers) - 1)].name
        lifted = [e.object for e in events if e.kind == "grasped" and e.object != next_one]
        self._wrong_lifts += len(lifted)
        found = tuple(Event(time, "wrong_object", name) for name in lifted)
        poses = [snapshot.poses[cover.name] for cover in self._covers]
        opened = [c.is_open(pose, pose) for c, pose in zip(self._covers, poses, strict=True)]
        for i, (cover, is_open) in enumerate(zip(self._covers, opened, strict=True)):
            if i < self._open and not is_open:
                here = snapshot.position(cover.name)
                how = "taken again" if closed_near(snapshot, here, COVER_RADIUS) else "moved away"
                return (*found, Event(time, "failed", cover.name, i, f"opened cover {how}"))
            if i > self._open and is_open:
                wrong = Event(time, "wrong_order", cover.name, i)
                return (*found, wrong, Event(time, "failed", cover.name, i, "opened too early"))
        self._open += self._open < len(opened) and opened[self._open]
        return found

    def diagnostics(self) -> dict[str, float]:
        return {"wrong_lifts": self._wrong_lifts}


NEAR = 0.03
"""Horizontal distance [m] from its start within which an object is in its place."""
TURN = math.radians(15)
"""Allowed error [rad] of the whole rotation."""
TURNED_RADIUS = 0.06
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds the object."""


@dataclass(frozen=True)
class OrientationTarget:
    """Object `name` is to lie with this `rotation`, its origin lower than `below` [m]."""

    name: str
    rotation: Quat
    below: float

    def met(self, pose: Pose, home: Pose) -> bool:
        """True if it lies so at `home`."""
        return (
            pose.position[2] < self.below
            and math.dist(pose.position[:2], home.position[:2]) < NEAR
            and angle_between(pose.rotation, self.rotation) < TURN
        )


def restore(targets: Sequence[OrientationTarget], references: Sequence[str]) -> Checklist:
    """Every object turned as asked at its own place, low, not held, all at once.

    Subtask i is object i; flags do not latch and there is no order (official). Success needs both
    grippers open. `references` must not be moved: lifting one is an event, not a failure.
    """
    return Checklist(
        [Rests(t.name, t.met, held_radius=TURNED_RADIUS) for t in targets],
        released=True,
        radius=0.08,
        early=lambda i, flags: not all(flags.held[:i]),
        handled=[*(t.name for t in targets), *references],
        watch=Bystanders(references),
        figures=("out_of_order", "drops"),
    )


def angle_between(a: Quat, b: Quat) -> float:
    """Angle [rad] of the rotation that leads from one to the other."""
    cosine = abs(sum(p * q for p, q in zip(a, b, strict=True)))
    return 2 * math.acos(min(1.0, cosine))
