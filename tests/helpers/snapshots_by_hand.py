"""Snapshots written by hand: where things are and what the grippers do, without a simulator."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event
from robospa.tasks.snapshot import Contact, Snapshot
from robospa.tasks.task import Tracker

TICK = 0.02
DOWN = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
AWAY: tuple[Vec3, Vec3] = ((-0.3, -0.3, 1.1), (0.3, -0.3, 1.1))
"""Grasp centres of arms that hold nothing."""


def snap(
    time: float,
    positions: Mapping[str, Vec3],
    gripper: tuple[float, float] = (1.0, 1.0),
    grasp: tuple[Vec3, Vec3] = AWAY,
    touched: Iterable[tuple[str, Vec3]] = (),
) -> Snapshot:
    """A snapshot with upright objects, both grippers pointing down with these grasp centres."""
    left, right = (Pose((x, y, z + 0.12), DOWN) for x, y, z in grasp)
    contacts = tuple(Contact("left_gripper", name, point) for name, point in touched)
    poses = {name: Pose(position) for name, position in positions.items()}
    return Snapshot(time, poses, gripper, (left, right), contacts=contacts, grasp_points=grasp)


def held(point: Vec3) -> tuple[Vec3, Vec3]:
    """Grasp centres when the left arm is at `point`."""
    return (point, AWAY[1])


def run(tracker: Tracker, snapshots: Iterable[Snapshot]) -> list[Event]:
    """All events of a trial that goes through `snapshots`; the first one is the start."""
    first, *rest = snapshots
    events = list(tracker.start(first))
    for snapshot in rest:
        events += tracker.update(snapshot)
    return events


def play(tracker: Tracker, *instants: Snapshot | Mapping[str, Vec3]) -> list[Event]:
    """`run` through instants a TICK apart: snapshots, or positions of what nothing holds."""
    snapshots = [s if isinstance(s, Snapshot) else snap(0, s) for s in instants]
    return run(tracker, [replace(s, time=i * TICK) for i, s in enumerate(snapshots)])


def kinds(events: Iterable[Event]) -> list[str]:
    """The kinds of the events, in order."""
    return [event.kind for event in events]
