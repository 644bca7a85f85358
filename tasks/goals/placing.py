"""Bringing objects to places, in any order: the table's regions, a container, a guarded strip.

Each is a `Checklist` of conditions, most of which do not latch, with something watched beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robospa.geometry import Pose
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.goals.checklist import Checklist, Watch
from robospa.tasks.goals.conditions import (
    HELD_RADIUS,
    Container,
    Inside,
    Region,
    Rests,
    lying_in,
    put_into,
)
from robospa.tasks.snapshot import Snapshot

FALLEN = 0.05
"""An origin so far [m] below the top of the table has left it."""
HEIGHT_TOLERANCE = 0.02
"""An object put down may be this much higher [m] than at the start."""
CLOSE = 0.03
"""A gripper that is not open and whose grasp centre is nearer [m] than this holds a block."""


@dataclass(frozen=True)
class Destination:
    """`name` belongs into one of the regions `to`; `astray` are those it was not asked for."""

    name: str
    to: tuple[Region, ...]
    astray: tuple[Region, ...] = ()


def bring(parts: Sequence[Destination], table_top: float, released: bool = False) -> Checklist:
    """Every object in one of its regions at once, with `released` both grippers open too.

    An object stops counting when it leaves. One that falls off the table, whose top is at
    `table_top` [m], counts nowhere; one in a region of `astray` is a diagnostic, no failure.
    """
    lowest = table_top - FALLEN
    return Checklist(
        [Rests(part.name, lying_in(part.to, lowest)) for part in parts],
        released,
        HELD_RADIUS,
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


def bring_alone(name: str, region: Region, released: bool = True) -> Checklist:
    """One object in a region of the table, let go of there; latched.

    The official rule has no height test; here the object must be at most HEIGHT_TOLERANCE above or
    below its first height. It is let go of where no gripper that is not open is near it, with
    `released` once both grippers are open.
    """

    def near(pose: Pose, home: Pose) -> bool:
        level = abs(pose.position[2] - home.position[2]) <= HEIGHT_TOLERANCE
        return level and region.over(pose.position)

    return Checklist([Rests(name, near, latched=True, open_grippers=released)], radius=0.06)


def gather(targets: Sequence[str], others: Sequence[str], region: Region) -> Checklist:
    """All of `targets` in `region` at once and let go of, none of `others` ever.

    A target counts while it lies no higher than before; the official rule also counts what is
    carried through. A wrong object in the region, at any height, fails for good (official).
    """
    near = put_into(region, HEIGHT_TOLERANCE)
    return Checklist(
        [Rests(name, near, held_radius=CLOSE) for name in targets],
        released=True,
        radius=0.06,
        handled=(*targets, *others),
        watch=Bystanders(others, region),
    )


class Bystanders(Watch):
    """Objects that no one asked for: lifted, or in the `region` where they fail for good."""

    def __init__(self, names: Sequence[str], region: Region | None = None) -> None:
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


def collect(names: Sequence[str], container: Container, lost_below: float) -> Checklist:
    """Every object of `names` at rest inside `container`, until it leaves its walls again.

    `lost_below` [m] is the height under which an object outside the container cannot be fetched
    any more; it is reported as dropped, and the trial goes on (official).
    """
    return Checklist(
        [Inside(name, container) for name in names],
        radius=0.2,
        handled=names,
        watch=_Lost(names, container, lost_below),
    )


class _Lost(Watch):
    """Objects that lie beside the container, too low to be fetched."""

    def __init__(self, names: Sequence[str], container: Container, below: float) -> None:
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
