"""Memory goals behind a wall: stillness before, gathering and turning after."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from snapshots_by_hand import AWAY, TICK, held, kinds, run, snap

from robospa.geometry import Pose, Vec3, yaw_rotation
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals.cue import MOVED_EARLY, AfterCue
from robospa.tasks.goals.parts import Region
from robospa.tasks.goals.placing import gather
from robospa.tasks.goals.restore import OrientationTarget, Restore
from robospa.tasks.snapshot import Snapshot

STRIP = Region((-0.26, 0.26), (-1.0, -0.11))
START: dict[str, Vec3] = {"a": (-0.1, 0.0, 0.755), "b": (0.1, 0.0, 0.755), "x": (0.0, 0.05, 0.755)}
WALL: dict[str, Vec3] = {"wall": (0.0, 0.12, 0.945)}
NEAR: dict[str, Vec3] = {"a": (-0.1, -0.18, 0.755), "b": (0.1, -0.18, 0.755)}


def timed(snapshots: list[Snapshot]) -> list[Snapshot]:
    return [replace(s, time=i * TICK) for i, s in enumerate(snapshots)]


def play(*after: Snapshot, before: list[Snapshot] | None = None) -> tuple[AfterCue, list[Event]]:
    """Two blocks to bring and one to leave; `after` the wall has come."""
    goal = AfterCue(gather(["a", "b"], ["x"], STRIP), ["wall"])
    first = [snap(0, START), *(before or []), snap(0, {**START, **WALL})]
    return goal, run(goal, timed([*first, *after]))


def there(*names: str, z: float = 0.755, gripper: float = 1.0, **elsewhere: Vec3) -> Snapshot:
    """The named blocks in the strip, the left arm around the last one if it is not open."""
    moved = {n: (NEAR[n][0], NEAR[n][1], z) for n in names}
    grasp = held(moved[names[-1]]) if names and gripper < 1 else AWAY
    return snap(0, {**START, **WALL, **moved, **elsewhere}, (gripper, 1.0), grasp)


def test_all_shown_blocks_in_the_strip_succeed() -> None:
    goal, events = play(there("a"), there("a", "b"))
    assert kinds(events) == ["cue_hidden", "subtask_done", "subtask_done", "success"]
    assert goal.diagnostics()["cue_hidden_at"] == TICK


def test_before_the_wall_nothing_counts_and_stillness_does() -> None:
    _, events = play(before=[snap(0, {**START, **NEAR})] * 3)
    assert kinds(events) == ["cue_hidden"]
    (x, y, z), right = AWAY
    moved = snap(0, START, grasp=((x, y + 0.031, z), right))
    _, events = play(there("a", "b"), before=[moved])
    assert [(e.kind, e.note) for e in events] == [("failed", MOVED_EARLY)]


def test_a_held_or_lifted_block_does_not_count() -> None:
    assert "subtask_done" not in kinds(play(there("a", gripper=0.1))[1])
    assert "subtask_done" not in kinds(play(there("a", z=0.80))[1])


def test_success_waits_for_open_grippers() -> None:
    closed = replace(there("a", "b"), gripper=(0.1, 1.0))
    _, events = play(closed)
    assert kinds(events).count("subtask_done") == 2 and "success" not in kinds(events)


def test_a_block_that_leaves_the_strip_stops_counting() -> None:
    _, events = play(there("a"), there())
    assert kinds(events)[-1] == "subtask_undone" and outcome(events, 2).done == 0


def test_another_block_in_the_strip_fails_for_good_at_any_height() -> None:
    _, events = play(there("a"), there("a", x=(0.0, -0.12, 0.9)), there("a", "b"))
    assert kinds(events)[-1] == "failed"
    assert outcome(events, 2).done == 1


def test_lifting_another_block_is_noted() -> None:
    up: Vec3 = (0.0, 0.05, 0.80)
    lifted = snap(0, {**START, **WALL, "x": up}, (0.1, 1.0), held(up))
    goal, events = play(there(), lifted)
    assert "wrong_object" in kinds(events) and goal.diagnostics()["wrong_lifts"] == 1


# Turning


def turned(*yaws: float, shift: float = 0.0, lift: float = 0.0, gripper: float = 1.0) -> Snapshot:
    poses = {
        name: Pose((0.1 * i + shift, 0.0, 0.74 + lift), yaw_rotation(yaw))
        for i, (name, yaw) in enumerate(zip("ab", yaws, strict=True))
    }
    blank = snap(0, {}, (gripper, 1.0), held((0.0, 0.0, 0.76)) if gripper < 1 else AWAY)
    return replace(blank, poses=poses)


def restore(*after: Snapshot) -> list[Event]:
    """Two blocks at yaw 0, wanted at 90 and 180 degrees."""
    quarter, half = yaw_rotation(math.pi / 2), yaw_rotation(math.pi)
    goal = Restore([OrientationTarget("a", quarter, 0.77), OrientationTarget("b", half, 0.77)], [])
    return run(goal, timed([turned(0, 0), *after]))


def test_blocks_turned_as_asked_succeed() -> None:
    events = restore(turned(math.pi / 2, 0), turned(math.pi / 2, -math.pi))
    assert kinds(events) == ["subtask_done", "subtask_done", "success"]


@pytest.mark.parametrize(
    ("degrees", "counts"), [(76, True), (74, False), (104, True), (270, False)]
)
def test_fifteen_degrees_are_allowed(degrees: float, counts: bool) -> None:
    assert ("subtask_done" in kinds(restore(turned(math.radians(degrees), 0)))) is counts


def test_a_moved_a_lifted_or_a_held_block_does_not_count() -> None:
    for wrong in ({"shift": 0.031}, {"lift": 0.031}, {"gripper": 0.1}):
        assert restore(turned(math.pi / 2, 0, **wrong)) == [], wrong


def test_turning_the_second_first_is_noted_and_allowed() -> None:
    events = restore(turned(0, math.pi), turned(math.pi / 2, math.pi))
    assert kinds(events) == ["wrong_order", "subtask_done", "subtask_done", "success"]


def test_a_block_turned_back_stops_counting() -> None:
    assert kinds(restore(turned(math.pi / 2, 0), turned(0, 0)))[-1] == "subtask_undone"
