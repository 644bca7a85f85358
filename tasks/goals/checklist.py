"""A list of things to do: presses and clicks, placements, stamps; order noted, never enforced.

A subtask is a counter's next count (a counter may occur several times) or a `Part`, a condition on
where an object is. Counts latch; a part latches if it says so. A placement counts from the moment
nothing holds the object: the official rules also count what is carried past.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeGuard

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event
from robospa.tasks.goals.anyorder import SLOW, Container
from robospa.tasks.goals.flags import Flags, both_open, closed_near
from robospa.tasks.goals.handling import Handling
from robospa.tasks.goals.hands import Role
from robospa.tasks.snapshot import Snapshot

HELD_RADIUS = 0.07
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds the object."""


class Part(Protocol):
    """A condition on object `name`; `targets` are the objects it is judged against.

    It stays done once done if `latched`; it cannot hold before subtask `after` was done once.
    """

    @property
    def name(self) -> str: ...

    @property
    def targets(self) -> tuple[str, ...]: ...

    @property
    def latched(self) -> bool: ...

    @property
    def after(self) -> int | None: ...

    def start(self, snapshot: Snapshot) -> None: ...

    def holds(self, snapshot: Snapshot, before: bool) -> bool: ...


class Counter(Protocol):
    """Something that is counted on object `name`: `update` is true when a count is added."""

    name: str
    count: int
    raw_count: int

    def start(self, snapshot: Snapshot) -> None: ...

    def update(self, snapshot: Snapshot) -> bool: ...


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

    def start(self, snapshot: Snapshot) -> None:
        """Remember where the object was."""
        self._home = snapshot.poses[self.name]

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        """Whether it lies there, given whether it did `before`."""
        pose = snapshot.poses[self.name]
        against = [snapshot.poses[t] for t in self.targets] or [self._home]
        if not any(self.near(pose, other) for other in against):
            return False
        return before or not closed_near(snapshot, pose.apply(self.grip), self.held_radius)


class Inside:
    """`name` came to rest inside `container`; `target` names the container's object.

    If it is not `latched`, it counts until it leaves the container, rolling about or not.
    """

    after: int | None = None

    def __init__(self, name: str, target: str, container: Container, latched: bool = True) -> None:
        self.name = name
        self.latched = latched
        self.targets = (target,)
        self._container = container
        self._last: Vec3 = (0.0, 0.0, 0.0)
        self._time = 0.0

    def start(self, snapshot: Snapshot) -> None:
        """Remember where it was, to tell how fast it is."""
        self._last, self._time = snapshot.poses[self.name].position, snapshot.time

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        """Whether it is inside, and slow if it was not there `before`."""
        here = snapshot.poses[self.name].position
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


def _is_part(item: Counter | Part) -> TypeGuard[Part]:
    return hasattr(item, "holds")


def _is_counter(item: Counter | Part) -> TypeGuard[Counter]:
    return hasattr(item, "count")


def _is_carried(counter: Counter) -> bool:
    """Whether what is counted is done with the object in hand (a stamp), not to it (a press)."""
    return bool(getattr(counter, "carried", False))


class Checklist:
    """`subtasks` in the asked order. Success: all hold, with `released` both grippers open too.

    `radius` [m] bounds the distance from grasp centre to a held object's origin, `may_fall` says
    where falling is part of the task. `turns` gives each subtask its turn in the asked order where
    several have the same one, `tools` the subtask of objects that are only used for it.
    """

    def __init__(
        self,
        subtasks: Sequence[Counter | Part],
        released: bool = False,
        radius: float = 0.12,
        may_fall: Callable[[Vec3], bool] = lambda position: False,
        turns: Sequence[int] | None = None,
        tools: Mapping[str, int] | None = None,
    ) -> None:
        self.total = len(subtasks)
        self._turns = tuple(range(self.total)) if turns is None else tuple(turns)
        self._parts: dict[int, Part] = {}
        self._counters: dict[str, Counter] = {}
        self._counts: dict[str, list[int]] = {}
        for i, item in enumerate(subtasks):
            if _is_part(item):
                self._parts[i] = item
            elif _is_counter(item):
                self._counters[item.name] = item
                self._counts.setdefault(item.name, []).append(i)
        self._tools = dict(tools or {})
        self.needs_contacts = not all(_is_carried(c) for c in self._counters.values())
        self._released = released
        self._flags = Flags(self.total)
        names = {part.name for part in self._parts.values()}
        names |= set(self._tools)
        names |= {name for name, counter in self._counters.items() if _is_carried(counter)}
        self._handling = Handling(sorted(names), radius, may_fall)
        self._idle = 0
        self._out_of_order = 0

    @property
    def roles(self) -> dict[str, Role]:
        """What is moved and what is pressed; mere places are distractors."""
        found: dict[str, Role] = {t: Role() for p in self._parts.values() for t in p.targets}
        for i, part in self._parts.items():
            known = found.get(part.name, Role()).subtasks
            found[part.name] = Role((*known, i))
        found |= {name: Role((index,)) for name, index in self._tools.items()}
        for name, indices in self._counts.items():
            found[name] = Role(tuple(indices), pressed=not _is_carried(self._counters[name]))
        return found

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """What holds already, if anything."""
        self._handling.start(snapshot)
        for counter in self._counters.values():
            counter.start(snapshot)
        for part in self._parts.values():
            part.start(snapshot)
        events = self._look(snapshot)
        self._idle = sum(self._flags.held)
        self._out_of_order = 0
        return tuple(e for e in events if e.kind != "wrong_order")

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Changes of the flags, counts beyond the last, drops; success."""
        events = self._handling.update(snapshot)
        for name, counter in self._counters.items():
            if counter.update(snapshot):
                events += self._count(name, counter.count, snapshot.time)
        events += self._look(snapshot)
        if self._flags.all and (not self._released or both_open(snapshot)):
            events += (Event(snapshot.time, "success"),)
        return events

    def _count(self, name: str, count: int, time: float) -> tuple[Event, ...]:
        indices = self._counts[name]
        if count > len(indices):
            return (Event(time, "repeated", name, indices[-1]),)
        return self._set(indices[count - 1], True, time, name)

    def _look(self, snapshot: Snapshot) -> tuple[Event, ...]:
        events: tuple[Event, ...] = ()
        for i, part in self._parts.items():
            before = self._flags.held[i]
            if before and part.latched:
                continue
            now = part.holds(snapshot, before)
            if now and part.after is not None and part.after not in self._flags.order:
                now = False
            if now != before:
                events += self._set(i, now, snapshot.time, part.name)
        return events

    def _set(self, i: int, value: bool, time: float, name: str) -> tuple[Event, ...]:
        first = value and i not in self._flags.order
        early = first and any(
            turn < self._turns[i] and k not in self._flags.order
            for k, turn in enumerate(self._turns)
        )
        events = self._flags.set(i, value, time, name)
        if early:
            self._out_of_order += 1
            return (Event(time, "wrong_order", name, i), *events)
        return events

    def diagnostics(self) -> dict[str, float | bool]:
        """Free progress, whether the order was kept so far, counts with and without chatter."""
        counters = self._counters.values()
        return {
            "idle_progress": self._idle / self.total,
            "order_obeyed": self._out_of_order == 0,
            "out_of_order": self._out_of_order,
            "presses": sum(c.count for c in counters),
            "raw_presses": sum(c.raw_count for c in counters),
            "drops": self._handling.drops,
        }
