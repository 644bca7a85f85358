"""Lists of things to do, in an order that is noted, or given, or in any order.

A subtask of a `Checklist` is a counter's next count (a counter may occur several times) or a
`Condition` on where an object is. Counts latch; a condition latches if it says so.

A click is a press (see `counters`): it counts when the touch begins, and the next one on the same
object needs the finger to leave. Clicks at the wrong time are never punished (official); events and
diagnostics say how many there were.
"""

from collections.abc import Callable, Mapping, Sequence

from robospa.geometry import Vec3
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.goals.conditions import Condition, Inside
from robospa.tasks.goals.counters import FIGURES, ActionCounter
from robospa.tasks.goals.lifting import LiftTracker, grippers_open
from robospa.tasks.snapshot import Snapshot


class SubtaskFlags:
    """The state of `total` subtasks; every change becomes an event."""

    def __init__(self, total: int) -> None:
        self.held = [False] * total
        self.order: list[int] = []
        """Indices in the order in which they were first done."""

    def set(self, index: int, value: bool, time: float, name: str = "") -> tuple[Event, ...]:
        """Give subtask `index` a value; an event if it changes."""
        if self.held[index] == value:
            return ()
        self.held[index] = value
        if value and index not in self.order:
            self.order.append(index)
        return (Event(time, "subtask_done" if value else "subtask_undone", name, index),)

    @property
    def all(self) -> bool:
        """True if every subtask holds."""
        return all(self.held)


class Watch:
    """A monitor beside the subtasks, with events and diagnostics of its own.

    `roles` are the objects that no subtask moves. `events` are those of this instant so far; an
    event "failed" among what `update` returns ends the trial.
    """

    roles: Mapping[str, ObjectRole] = {}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Events that hold before the first action."""
        return ()

    def update(self, snapshot: Snapshot, events: Sequence[Event]) -> tuple[Event, ...]:
        """Events of this instant."""
        return ()

    def diagnostics(self) -> Mapping[str, float]:
        """What it adds to the record."""
        return {}


Subtask = ActionCounter | Condition
Early = Callable[[int, SubtaskFlags], bool]
"""Whether a subtask that is done for the first time comes before what has to be done first."""
CHAIN = ("order_obeyed", "out_of_order", *FIGURES, "drops")
"""Figures of the order and of the presses, for records of chains of actions."""


def by_turns(turns: Sequence[int]) -> Early:
    """Whether a subtask of an earlier turn was never done; several may have the same turn."""

    def early(i: int, flags: SubtaskFlags) -> bool:
        return any(turn < turns[i] and k not in flags.order for k, turn in enumerate(turns))

    return early


class Checklist:
    """`subtasks` in the asked order. Success: all hold, with `released` both grippers open too.

    `radius` [m] bounds the distance from grasp centre to a held object's origin. `early` says what
    is out of order; without it nothing is noted of the order. Falling into a container is part of
    the task. `tools` gives the subtask of objects that are only used for it. `handled`
    are the objects whose grasps and drops are followed, by default all that are moved; `watch`
    looks at something more. `figures` are those that a record keeps beside the free progress.
    """

    def __init__(
        self,
        subtasks: Sequence[Subtask],
        released: bool = False,
        radius: float = 0.12,
        *,
        early: Early | None = None,
        tools: Mapping[str, int] | None = None,
        handled: Sequence[str] | None = None,
        watch: Watch | None = None,
        figures: Sequence[str] = ("drops",),
    ) -> None:
        self.total = len(subtasks)
        self._early = early
        self._watch = watch or Watch()
        self._conditions: dict[int, Condition] = {}
        self._counters: dict[str, ActionCounter] = {}
        self._counts: dict[str, list[int]] = {}
        for i, item in enumerate(subtasks):
            if isinstance(item, Condition):
                self._conditions[i] = item
            else:
                self._counters[item.name] = item
                self._counts.setdefault(item.name, []).append(i)
        self._tools = dict(tools or {})
        self.needs_contacts = not all(c.carried for c in self._counters.values())
        self._released = released
        self._flags = SubtaskFlags(self.total)
        names = {condition.name for condition in self._conditions.values()}
        names |= set(self._tools)
        names |= {name for name, counter in self._counters.items() if counter.carried}
        self._lift_tracker = LiftTracker(
            sorted(names) if handled is None else handled, radius, self.may_fall
        )
        self._figures = tuple(figures)
        self._idle = 0
        self._out_of_order = 0

    def may_fall(self, point: Vec3) -> bool:
        """Whether what falls there [m] falls into a container that it is to be in."""
        conditions = self._conditions.values()
        return any(c.container.over(point) for c in conditions if isinstance(c, Inside))

    @property
    def places(self) -> list[str]:
        """Objects that others are to be put on, into or beside."""
        return [t for c in self._conditions.values() for t in c.targets]

    @property
    def roles(self) -> dict[str, ObjectRole]:
        """Objects that are moved or pressed; targets of placements count as distractors."""
        found: dict[str, ObjectRole] = dict(self._watch.roles)
        found |= {place: ObjectRole() for place in self.places}
        for i, condition in self._conditions.items():
            for name in condition.movers:
                found[name] = ObjectRole((*found.get(name, ObjectRole()).subtasks, i))
        found |= {name: ObjectRole((index,)) for name, index in self._tools.items()}
        for name, indices in self._counts.items():
            found[name] = ObjectRole(tuple(indices), pressed=not self._counters[name].carried)
        return found

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        self._lift_tracker.start(snapshot)
        for counter in self._counters.values():
            counter.start(snapshot)
        for condition in self._conditions.values():
            condition.start(snapshot)
        events = (*self._watch.start(snapshot), *self._test(snapshot))
        self._idle = sum(self._flags.held)
        self._out_of_order = 0
        return tuple(e for e in events if e.kind != "wrong_order")

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Changes of the flags, counts beyond the last, drops; success."""
        events = self._lift_tracker.update(snapshot)
        for name, counter in self._counters.items():
            if counter.update(snapshot):
                events += self._count(name, counter.count, snapshot.time)
        watched = self._watch.update(snapshot, events)
        events += watched
        if any(event.kind == "failed" for event in watched):
            return events
        events += self._test(snapshot)
        if self._flags.all and (not self._released or grippers_open(snapshot)):
            events += (Event(snapshot.time, "success"),)
        return events

    def _count(self, name: str, count: int, time: float) -> tuple[Event, ...]:
        indices = self._counts[name]
        if count > len(indices):
            return (Event(time, "repeated", name, indices[-1]),)
        return self._set(indices[count - 1], True, time, name)

    def _test(self, snapshot: Snapshot) -> tuple[Event, ...]:
        events: tuple[Event, ...] = ()
        for i, condition in self._conditions.items():
            before = self._flags.held[i]
            if before and condition.latched:
                continue
            now = condition.holds(snapshot, before)
            if now and condition.after is not None and condition.after not in self._flags.order:
                now = False
            if now != before:
                events += self._set(i, now, snapshot.time, condition.name)
        return events

    def _set(self, i: int, value: bool, time: float, name: str) -> tuple[Event, ...]:
        first = value and i not in self._flags.order
        early = first and self._early is not None and self._early(i, self._flags)
        events = self._flags.set(i, value, time, name)
        if early:
            self._out_of_order += 1
            return (Event(time, "wrong_order", name, i), *events)
        return events

    def diagnostics(self) -> dict[str, float | bool]:
        found: dict[str, float | bool] = {
            "order_obeyed": self._out_of_order == 0,
            "out_of_order": self._out_of_order,
            "drops": self._lift_tracker.drops,
        }
        for counter in self._counters.values():
            for name, value in counter.figures().items():
                found[name] = found.get(name, 0) + value
        chosen = {name: found.get(name, 0) for name in self._figures}
        return {"idle_progress": self._idle / self.total, **chosen, **self._watch.diagnostics()}


class _Clicks:
    """What both goals have in common: subtask i is counter i, and nothing is done yet."""

    needs_contacts = True

    def __init__(self, counters: Sequence[ActionCounter]) -> None:
        self.total = len(counters)
        self._counters = tuple(counters)
        self._flags = SubtaskFlags(self.total)

    @property
    def roles(self) -> dict[str, ObjectRole]:
        return {c.name: ObjectRole((i,), pressed=True) for i, c in enumerate(self._counters)}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        for counter in self._counters:
            counter.start(snapshot)
        return ()


class ClickInOrder(_Clicks):
    """Click the objects of `counters` one after the other; subtasks are latched.

    With `standing` a touch that began before the object's turn counts when the turn comes, as
    where official rules look at every instant for itself.
    """

    def __init__(self, counters: Sequence[ActionCounter], standing: bool = False) -> None:
        super().__init__(counters)
        self._standing = standing
        self._early = 0
        self._again = 0

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """The next object clicked, or one at the wrong time; success with the last."""
        events: tuple[Event, ...] = ()
        time, stage = snapshot.time, sum(self._flags.held)
        for i, counter in enumerate(self._counters):
            new = counter.update(snapshot)
            due = i == sum(self._flags.held)
            if (due and self._standing and counter.pressing) or (new and i == stage):
                events += self._flags.set(i, True, time, counter.name)
            elif not new:
                continue
            elif i > stage:
                self._early += 1
                events += (Event(time, "wrong_order", counter.name, i),)
            else:
                self._again += 1
                events += (Event(time, "repeated", counter.name, i),)
        if events and self._flags.all and stage < self.total:
            events += (Event(time, "success"),)
        return events

    def diagnostics(self) -> dict[str, float]:
        """Clicks too early, on what was done before, and in all."""
        return {
            "idle_progress": 0.0,
            "out_of_order": self._early,
            "repeated_clicks": self._again,
            "wrong_clicks": 0,
            "presses": sum(c.count for c in self._counters),
            "touched": sum(c.figures()["touched"] for c in self._counters),
        }


class UseInOrder(ClickInOrder):
    """Use `tool` on the objects of `counters` one after the other; subtask i is counter i.

    The tool is grasped, may fall, and belongs to every subtask.
    """

    def __init__(self, counters: Sequence[ActionCounter], tool: str) -> None:
        super().__init__(counters)
        self._tool = tool
        self._lift_tracker = LiftTracker((tool,), radius=0.15)

    @property
    def roles(self) -> dict[str, ObjectRole]:
        """The tool serves all; the objects are only places where it is used."""
        places = {name: ObjectRole(pressed=True) for name in super().roles}
        return places | {self._tool: ObjectRole(tuple(range(self.total)))}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Nothing is done yet; remember where the tool lies."""
        self._lift_tracker.start(snapshot)
        return super().start(snapshot)

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        return (*self._lift_tracker.update(snapshot), *super().update(snapshot))

    def diagnostics(self) -> dict[str, float]:
        return {**super().diagnostics(), "drops": self._lift_tracker.drops}


class PressCounts(_Clicks):
    """Press each object of `counters` exactly as often as `times` says, in any order.

    Subtask i holds while the count of object i is the one asked for: one press too many undoes it
    for good, because counts never fall (official). Success: all hold at once.
    """

    def __init__(self, counters: Sequence[ActionCounter], times: Sequence[int]) -> None:
        super().__init__(counters)
        self._times = tuple(times)
        self._excess = 0
        self._out_of_order = 0

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Changes of the flags, presses too many, presses before the objects further left."""
        events: tuple[Event, ...] = ()
        time = snapshot.time
        for i, (counter, times) in enumerate(zip(self._counters, self._times, strict=True)):
            if not counter.update(snapshot):
                continue
            if counter.count > times:
                self._excess += 1
                events += (Event(time, "repeated", counter.name, i),)
            elif counter.count == 1 and not all(self._flags.held[:i]):
                self._out_of_order += 1
            events += self._flags.set(i, counter.count == times, time, counter.name)
        return (*events, Event(time, "success")) if events and self._flags.all else events

    def diagnostics(self) -> dict[str, float]:
        """Presses, those that touched, those beyond what was asked, and those out of order."""
        return {
            "idle_progress": 0.0,
            **{name: sum(c.figures()[name] for c in self._counters) for name in FIGURES},
            "excess_presses": self._excess,
            "out_of_order": self._out_of_order,
        }
