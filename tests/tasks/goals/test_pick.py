"""The pick tracker: what counts as picked, what does not, and what it says about the rest."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from snapshots_by_hand import AWAY, held, kinds, run, snap

from robospa.geometry import Vec3
from robospa.tasks.goals.lifting import Lift, PickTracker
from robospa.tasks.snapshot import Snapshot

NAMES = ("object_0", "object_1", "object_2")
LOW: Mapping[str, Vec3] = {n: (0.2 * i - 0.2, 0.0, 0.76) for i, n in enumerate(NAMES)}
PICKED = ["grasped", "subtask_done", "success"]
HIGH, RISE, STEADY = Lift(above=0.82), Lift(rise=0.06), Lift(rise=0.04, steady=0.03)
TOUCHED = Lift(rise=0.06, closed=True, touching=True)


def raised(
    name: str = "object_0",
    height: float = 0.1,
    time: float = 0.02,
    gripper: float = 0.0,
    carried: bool = True,
    touched: bool = False,
    **others: float,
) -> Snapshot:
    """`name` (and others) lifted by `height` [m], between the left arm's fingers if carried."""
    positions = dict(LOW)
    for other, rise in {name: height, **others}.items():
        x, y, z = positions[other]
        positions[other] = (x, y, z + rise)
    point = positions[name]
    contacts = [(name, point)] if touched else []
    return snap(time, positions, (gripper, 1.0), held(point) if carried else AWAY, contacts)


def tracker(lift: Lift = HIGH) -> PickTracker:
    return PickTracker("object_0", NAMES, lift)


@pytest.mark.parametrize(
    ("lift", "snapshot", "picked"),
    [
        (HIGH, raised(), True),
        (HIGH, raised(height=0.059), False),
        (RISE, raised(height=0.059), False),
        (RISE, raised(height=0.061), True),
        (HIGH, raised(carried=False), False),  # thrown
        (HIGH, raised(gripper=1.0), False),  # an open gripper carries nothing
        (RISE, raised(gripper=0.5), True),
        (Lift(rise=0.06, closed=True), raised(gripper=0.5), False),
        (TOUCHED, raised(), False),
        (TOUCHED, raised(touched=True), True),
        (STEADY, raised(object_1=0.029), True),
        (STEADY, raised(object_1=0.031), False),
        (STEADY, raised(object_1=-0.031), False),
    ],
)
def test_what_counts_as_picked(lift: Lift, snapshot: Snapshot, picked: bool) -> None:
    assert tracker(lift).needs_contacts is lift.touching
    assert ("success" in kinds(run(tracker(lift), [snap(0, LOW), snapshot]))) is picked


def test_nothing_after_success_and_a_second_start_forgets_the_first() -> None:
    track = tracker()
    events = run(track, [snap(0, LOW), raised()])
    assert kinds(events) == PICKED and events[1].index == 0
    assert track.update(raised("object_1", time=0.04)) == ()
    assert kinds(run(track, [snap(0, LOW), raised()])) == PICKED


def test_steady_is_judged_at_the_instant() -> None:
    snapshots = [snap(0, LOW), raised(object_1=0.1), raised(time=0.04)]
    assert kinds(run(tracker(STEADY), snapshots)) == ["grasped", "wrong_object", *PICKED[1:]]


def test_a_wrong_object_is_reported_once_a_lift_and_spoils_nothing() -> None:
    snapshots = [snap(0, LOW), raised("object_1"), raised("object_1", time=0.04)]
    snapshots += [snap(0.06, LOW), raised("object_1", time=0.08)]
    events = run(tracker(), snapshots)
    assert [e.object for e in events if e.kind == "wrong_object"] == ["object_1"] * 2
    assert "success" not in kinds(events)
    assert kinds(run(tracker(), [*snapshots, raised(time=0.1)]))[-1] == "success"


@pytest.mark.parametrize(
    ("target", "lift", "word"),
    [("object_9", HIGH, "object_9"), ("object_0", Lift(closed=True), "height test")],
)
def test_nonsense_is_refused(target: str, lift: Lift, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        PickTracker(target, NAMES, lift)


def test_a_tall_target_is_carried_by_its_middle() -> None:
    """A gripper 0.16 m over the origin carries what is 0.155 m tall, and no flat thing."""
    x, y, z = LOW["object_0"]
    up = {**LOW, "object_0": (x, y, z + 0.1)}
    lifted = snap(0.02, up, (0.0, 1.0), held((x, y, z + 0.26)))
    tall = PickTracker("object_0", NAMES, HIGH, {"object_0": (0.0, 0.0, 0.0775)})
    assert kinds(run(tall, [snap(0, LOW), lifted])) == PICKED
    assert kinds(run(tracker(), [snap(0, LOW), lifted])) == []
