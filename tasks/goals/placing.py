"""Bringing objects to places, and arranging them: a row, a tower, equal vessels in each other.

Places are the table's regions, a container, a guarded strip. Each goal is a `Checklist` of
conditions, most of which do not latch, with something watched beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.goals import conditions
from robospa.tasks.goals.checklist import Checklist, Watch
from robospa.tasks.goals.lifting import closed_near
from robospa.tasks.snapshot import Snapshot

FALLEN = 0.05
"""An origin so far [m] below the top of the table has left it."""
HEIGHT_TOLERANCE = 0.02
"""Allowed error [m] of the height of an object put down, and of a part above the bottom part."""
CLOSE = 0.03
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds a block."""


@dataclass(frozen=True)
class Destination:
    """`name` belongs into one of the regions `to`; `astray` are those it was not asked for."""

    name: str
    to: tuple[conditions.Region, ...]
    astray: tuple[conditions.Region, ...] = ()


def bring(parts: Sequence[Destination], table_top: float, released: bool = False) -> Checklist:
    """Every object in one of its regions at once, with `released` both grippers open too.

    An object stops counting when it leaves. One that falls off the table, whose top is at
    `table_top` [m], counts nowhere; one in a region of `astray` is a diagnostic, no failure.
    """
    lowest = table_top - FALLEN

    def near(part: Destination, pose: Pose, home: Pose) -> bool:
        x, y, z = pose.position
        return z >= lowest and any(region.holds(x, y) for region in part.to)

    return Checklist(
        [conditions.Rests(part.name, partial(near, part)) for part in parts],
        released,
        conditions.HELD_RADIUS,
        handled=[part.name for part in parts],
        watch=_Strays(parts, lowest),
    )


class _Strays(Watch):
    """Objects in regions that they were not asked for, and those that fell off the table."""

    def __init__(self, parts: Sequence[Destination], lowest: float) -> None:
        self._parts = tuple(parts)
        self._lowest = lowest
        self._astray: set[str] = set()
        self._fallen: set[str] = set()

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        return self.update(snapshot, ())

    def update(self, snapshot: Snapshot, events: Sequence[Event]) -> tuple[Event, ...]:
        found: tuple[Event, ...] = ()
        for i, part in enumerate(self._parts):
            x, y, z = snapshot.position(part.name)
            if z < self._lowest and part.name not in self._fallen:
                self._fallen.add(part.name)
                found += (Event(snapshot.time, "dropped", part.name, i, "off the table"),)
            if any(region.holds(x, y) for region in part.astray):
                self._astray.add(part.name)
        return found

    def diagnostics(self) -> dict[str, float]:
        return {"astray": len(self._astray), "fallen": len(self._fallen)}


def bring_alone(name: str, region: conditions.Region, released: bool = True) -> Checklist:
    """One object in a region of the table, let go of there; latched.

    The official rule has no height test; here the object must be at most HEIGHT_TOLERANCE above or
    below its first height. It is let go of where no gripper that is not open is near it, with
    `released` once both grippers are open.
    """

    def near(pose: Pose, home: Pose) -> bool:
        level = abs(pose.position[2] - home.position[2]) <= HEIGHT_TOLERANCE
        return level and region.over(pose.position)

    return Checklist(
        [conditions.Rests(name, near, latched=True, open_grippers=released)], radius=0.06
    )


def gather(targets: Sequence[str], others: Sequence[str], region: conditions.Region) -> Checklist:
    """All of `targets` in `region` at once and let go of, none of `others` ever.

    A target counts while it lies no higher than before; the official rule also counts what is
    carried through. A wrong object in the region, at any height, fails for good (official).
    """

    def near(pose: Pose, home: Pose) -> bool:
        low = pose.position[2] <= home.position[2] + HEIGHT_TOLERANCE
        return low and region.over(pose.position)

    return Checklist(
        [conditions.Rests(name, near, held_radius=CLOSE) for name in targets],
        released=True,
        radius=0.06,
        handled=(*targets, *others),
        watch=Bystanders(others, region),
    )


class Bystanders(Watch):
    """Objects that no one asked for: lifted, or in the `region` where they fail for good."""

    def __init__(self, names: Sequence[str], region: conditions.Region | None = None) -> None:
        self.roles = {name: ObjectRole() for name in names}
        self._region = region
        self._lifts = 0

    def update(self, snapshot: Snapshot, events: Sequence[Event]) -> tuple[Event, ...]:
        lifted = [e.object for e in events if e.kind == "grasped" and e.object in self.roles]
        self._lifts += len(lifted)
        found = tuple(Event(snapshot.time, "wrong_object", name) for name in lifted)
        for name in self.roles if self._region else ():
            if self._region and self._region.over(snapshot.position(name)):
                note = "an object that was not shown is in the region"
                return (*found, Event(snapshot.time, "failed", name, note=note))
        return found

    def diagnostics(self) -> dict[str, float]:
        return {"wrong_lifts": self._lifts}


def collect(names: Sequence[str], container: conditions.Container, lost_below: float) -> Checklist:
    """Every object of `names` at rest inside `container`, until it leaves its walls again.

    `lost_below` [m] is the height under which an object outside the container cannot be fetched
    any more; it is reported as dropped, and the trial goes on (official).
    """
    return Checklist(
        [conditions.Inside(name, container) for name in names],
        radius=0.2,
        handled=names,
        watch=_Lost(names, container, lost_below),
    )


class _Lost(Watch):
    """Objects that lie beside the container, too low to be fetched."""

    def __init__(self, names: Sequence[str], container: conditions.Container, below: float) -> None:
        self._names = tuple(names)
        self._container = container
        self._below = below
        self._lost: set[str] = set()

    def update(self, snapshot: Snapshot, events: Sequence[Event]) -> tuple[Event, ...]:
        found: tuple[Event, ...] = ()
        for i, name in enumerate(self._names):
            here = snapshot.position(name)
            if here[2] < self._below and name not in self._lost and not self._container.over(here):
                self._lost.add(name)
                found += (Event(snapshot.time, "dropped", name, i, "out of reach"),)
        return found

    def diagnostics(self) -> dict[str, float]:
        return {"lost": len(self._lost)}


ALIGNED = 0.03
"""Neighbours of the row differ by at most this [m] in y."""

RAISED = 0.01
"""An object this much higher [m] than at the start stands on something or hangs in the air."""


@dataclass
class Pair(conditions.Condition):
    """`left` and `name` are neighbours of the row: down, in line, nothing holding either."""

    left: str
    _ceilings: list[float] = field(default_factory=list)

    @property
    def movers(self) -> tuple[str, ...]:
        return (self.left, self.name)

    def start(self, snapshot: Snapshot) -> None:
        self._ceilings = [snapshot.height(name) + RAISED for name in self.movers]

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        left, right = places = [snapshot.position(name) for name in self.movers]
        in_place = (
            right[0] > left[0]
            and abs(right[1] - left[1]) <= ALIGNED
            and left[2] < self._ceilings[0]
            and right[2] < self._ceilings[1]
        )
        if not in_place or before:
            return in_place
        return not any(closed_near(snapshot, place, conditions.HELD_RADIUS) for place in places)


class _ChancePairs(Watch):
    """Counts the pairs that are in place before the first action."""

    def __init__(self, pairs: Sequence[Pair]) -> None:
        self._pairs = tuple(pairs)
        self._count = 0

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        self._count = sum(pair.holds(snapshot, False) for pair in self._pairs)
        return ()

    def diagnostics(self) -> dict[str, float]:
        return {"chance_pairs": self._count}


def row(order: Sequence[str], released: bool) -> Checklist:
    """The goal that `order` lies from left to right, with `released` both grippers open too.

    Subtask 0 holds from the start (official: the first of the row is given for free); subtask k is
    the pair (k - 1, k): its second object lies farther right and hardly nearer or farther away.
    Pairs do not latch, and some hold by chance before anything was done: `diagnostics` says how
    many.
    """
    pairs = [Pair(right, left) for left, right in pairwise(order)]
    return Checklist(
        [conditions.Given(order[0]), *pairs],
        released,
        radius=conditions.HELD_RADIUS,
        handled=order,
        watch=_ChancePairs(pairs),
    )


SIDE_TOLERANCE = 0.025
"""Allowed offset [m] in x and in y from the part below."""

PART_RADIUS = 0.03
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds the part."""


@dataclass
class Layer(conditions.Condition):
    """`name` is straight above `below`, higher than `bottom` by `rise` [m], and was let go of."""

    below: str
    bottom: str
    rise: float
    within: float

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        here = snapshot.position(self.name)
        below = snapshot.position(self.below)
        high = abs(here[2] - snapshot.height(self.bottom) - self.rise) <= self.within
        in_place = high and _over(here, below, SIDE_TOLERANCE)
        return in_place and (before or not closed_near(snapshot, here, PART_RADIUS))


def stack(
    order: Sequence[str], thick: Sequence[float], within: float = HEIGHT_TOLERANCE
) -> Checklist:
    """A tower of `order` from bottom to top, `thick` [m] parts with their centres as origins.

    One rule for every tower: part i is as high above the bottom part as the parts between them are
    thick, to `within` [m], and straight above part i - 1. Subtask 0, the bottom part, holds from
    the start (official). Nothing latches: a collapse takes it away. The order in time is not
    checked (official); parts that came to rest before the one below them are counted.
    """
    rise, layers = 0.0, []
    for (below, thick_below), (above, thick_above) in pairwise(zip(order, thick, strict=True)):
        rise += (thick_below + thick_above) / 2
        layers.append(Layer(above, below, order[0], rise, within))
    return Checklist(
        [conditions.Given(order[0], moved=True), *layers],
        released=True,
        radius=0.06,
        early=lambda i, flags: i > 0 and not flags.held[i - 1],
        handled=order,
        figures=("out_of_order", "drops"),
    )


OVER_BASE, OVER_TOP = 0.05, 0.04
"""Largest offset [m] in x and in y from the base's centre, and from the vessel below."""

RISE = (0.005, 0.08)
"""A vessel stands so much higher [m] than the one below it."""

RIM_RADIUS = 0.115
"""A gripper that is not open and this near [m] to a vessel's origin may hold its rim."""


class _Vessels:
    """The vessels that stand in each other on `base`, found once for every snapshot.

    The lowest one over the base begins; then, again and again, the lowest of the others that stands
    in the topmost one joins it. They are looked for afresh every time, so that taking the lowest
    one away takes all others with it.
    """

    def __init__(self, names: Sequence[str], base: str) -> None:
        self._base = base
        self._names = tuple(names)
        self._seen: Snapshot | None = None
        self._found: list[str] = []

    def at(self, snapshot: Snapshot) -> list[str]:
        if snapshot is not self._seen:
            self._seen, self._found = snapshot, self._stack(snapshot)
        return self._found

    def _stack(self, snapshot: Snapshot) -> list[str]:
        at = {name: snapshot.poses[name].position for name in self._names}
        rest = sorted(self._names, key=lambda name: at[name][2])
        below, reach = snapshot.poses[self._base].position, OVER_BASE
        lowest, highest = float("-inf"), float("inf")
        stack: list[str] = []
        while True:
            for found in rest:
                if _over(at[found], below, reach) and lowest < at[found][2] - below[2] < highest:
                    break
            else:
                return stack
            stack.append(found)
            rest.remove(found)
            below, reach, (lowest, highest) = at[found], OVER_TOP, RISE


@dataclass
class Nested(conditions.Condition):
    """`name` is one of the vessels that stand in each other, and was let go of there."""

    vessels: _Vessels

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        if self.name not in self.vessels.at(snapshot):
            return False
        return before or not closed_near(snapshot, snapshot.position(self.name), RIM_RADIUS)


def nest(names: Sequence[str], base: str) -> Checklist:
    """The goal that all `names` are in one stack on the fixed object `base`, grippers open."""
    vessels = _Vessels(names, base)
    return Checklist(
        [Nested(name, vessels, targets=(base,)) for name in names],
        released=True,
        radius=RIM_RADIUS,
        handled=names,
    )


def _over(point: Vec3, below: Vec3, reach: float) -> bool:
    return abs(point[0] - below[0]) < reach and abs(point[1] - below[1]) < reach
