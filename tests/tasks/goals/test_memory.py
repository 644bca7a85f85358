"""Memory goals: stillness before the cue is hidden; gathering, turning, uncovering after it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from snapshots_by_hand import AWAY, TICK, held, kinds, play, snap

from robospa.geometry import Pose, Vec3, yaw_rotation
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals import memory
from robospa.tasks.goals.conditions import Region
from robospa.tasks.goals.placing import gather
from robospa.tasks.snapshot import Snapshot

STRIP = Region((-0.26, 0.26), (-1.0, -0.11))
START: dict[str, Vec3] = {"a": (-0.1, 0.0, 0.755), "b": (0.1, 0.0, 0.755), "x": (0.0, 0.05, 0.755)}
WALL: dict[str, Vec3] = {"wall": (0.0, 0.12, 0.945)}
NEAR: dict[str, Vec3] = {"a": (-0.1, -0.18, 0.755), "b": (0.1, -0.18, 0.755)}
DONE, UNDONE = "subtask_done", "subtask_undone"


def reached(y: float) -> tuple[Vec3, Vec3]:
    """Grasp centres when the right arm has moved by `y` [m]."""
    (x, y0, z), left = AWAY[1], AWAY[0]
    return (left, (x, y0 + y, z))


def gathered(
    *after: Snapshot, before: tuple[Snapshot, ...] = ()
) -> tuple[memory.AfterCue, list[Event]]:
    """Two blocks to bring and one to leave; `after` the wall has come."""
    goal = memory.AfterCue(gather(["a", "b"], ["x"], STRIP), ["wall"])
    return goal, play(goal, START, *before, {**START, **WALL}, *after)


def there(*names: str, z: float = 0.755, gripper: float = 1.0, **elsewhere: Vec3) -> Snapshot:
    """The named blocks in the strip, the left arm around the last one if it is not open."""
    moved = {n: (NEAR[n][0], NEAR[n][1], z) for n in names}
    grasp = held(moved[names[-1]]) if names and gripper < 1 else AWAY
    return snap(0, {**START, **WALL, **moved, **elsewhere}, (gripper, 1.0), grasp)


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        ([there("a"), there("a", "b")], [DONE, DONE, "success"]),
        ([there("a", gripper=0.1)], []),
        ([there("a", z=0.80)], []),
        ([replace(there("a", "b"), gripper=(0.1, 1.0))], [DONE, DONE]),
        ([there("a"), there()], [DONE, UNDONE]),
        ([there("a"), there("a", x=(0.0, -0.12, 0.9)), there("a", "b")], [DONE, "failed"]),
    ],
)
def test_shown_blocks_in_the_strip(steps: list[Snapshot], found: list[str]) -> None:
    goal, events = gathered(*steps)
    assert kinds(events) == ["cue_hidden", *found]
    assert goal.diagnostics()["cue_hidden_at"] == TICK


def test_before_the_wall_nothing_counts_and_stillness_does() -> None:
    _, events = gathered(before=(snap(0, {**START, **NEAR}),) * 3)
    assert kinds(events) == ["cue_hidden"]
    _, events = gathered(there("a", "b"), before=(snap(0, START, grasp=reached(0.031)),))
    assert [(e.kind, e.note) for e in events] == [("failed", memory.MOVED_EARLY)]
    goal, events = gathered(before=(snap(0, START, grasp=reached(0.029)),))
    assert kinds(events) == ["cue_hidden"]
    assert goal.diagnostics()["motion_before"] == pytest.approx(0.029)


def test_lifting_another_block_is_noted() -> None:
    up: Vec3 = (0.0, 0.05, 0.80)
    goal, events = gathered(there(), snap(0, {**START, **WALL, "x": up}, (0.1, 1.0), held(up)))
    assert "wrong_object" in kinds(events) and goal.diagnostics()["wrong_lifts"] == 1


# Turning


def turned(*yaws: float, shift: float = 0.0, lift: float = 0.0, gripper: float = 1.0) -> Snapshot:
    poses = {
        name: Pose((0.1 * i + shift, 0.0, 0.74 + lift), yaw_rotation(yaw))
        for i, (name, yaw) in enumerate(zip("ab", yaws, strict=True))
    }
    blank = snap(0, {}, (gripper, 1.0), held((0.0, 0.0, 0.76)) if gripper < 1 else AWAY)
    return replace(blank, poses=poses)


QUARTER, HALF = math.pi / 2, math.pi


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        ([turned(QUARTER, 0), turned(QUARTER, -HALF)], [DONE, DONE, "success"]),
        *(([turned(math.radians(d), 0)], [DONE]) for d in (76, 104)),  # 15 degrees are allowed
        *(([turned(math.radians(d), 0)], []) for d in (74, 270)),
        ([turned(QUARTER, 0, shift=0.031)], []),
        ([turned(QUARTER, 0, lift=0.031)], []),
        ([turned(QUARTER, 0, gripper=0.1)], []),
        ([turned(0, HALF), turned(QUARTER, HALF)], ["wrong_order", DONE, DONE, "success"]),
        ([turned(QUARTER, 0), turned(0, 0)], [DONE, UNDONE]),
    ],
)
def test_blocks_turned_at_their_places(steps: list[Snapshot], found: list[str]) -> None:
    wanted = {"a": QUARTER, "b": HALF}
    targets = [memory.OrientationTarget(n, yaw_rotation(yaw), 0.77) for n, yaw in wanted.items()]
    assert kinds(play(memory.restore(targets, []), turned(0, 0), *steps)) == found


# Covers

PLACES = {"a": (-0.2, -0.05), "b": (0.0, -0.05), "c": (0.2, -0.05)}
CLOSED: dict[str, Vec3] = {name: (x, -0.18, 0.74) for name, (x, _) in PLACES.items()}


def covers() -> memory.AfterCue:
    return memory.uncover([memory.Cover(name, PLACES[name], below=0.745) for name in "bca"])


def opened(*names: str, **elsewhere: Vec3) -> dict[str, Vec3]:
    return {**CLOSED, **{n: (*PLACES[n], 0.74) for n in names}, **elsewhere}


ALL = [opened("b"), opened("b", "c"), opened("b", "c", "a")]


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        (ALL, [DONE, DONE, DONE, "success"]),
        ([*ALL, opened("a")], [DONE, DONE, DONE, "success"]),  # nothing after the end
        ([ALL[0], opened("b", "a"), ALL[2]], [DONE, "wrong_order", "failed"]),
        ([ALL[0], opened("b", b=(0.0, 0.05, 0.74)), ALL[2]], [DONE, "failed"]),
        ([opened(b=(0.0, -0.006, 0.74))], [DONE]),
        ([opened(b=(0.0, -0.004, 0.74))], []),
        ([opened(b=(0.0, -0.05, 0.746))], []),
    ],
)
def test_covers_are_opened_in_order(steps: list[dict[str, Vec3]], found: list[str]) -> None:
    goal = covers()
    events = play(goal, {}, {}, CLOSED, *steps)
    assert kinds(events) == ["cue_hidden", *found]
    assert goal.diagnostics()["cue_hidden_at"] == 2 * TICK
    assert outcome(events, 3).done == found.count(DONE)


def test_an_opened_cover_that_is_moved_says_how() -> None:
    away: Vec3 = (0.0, 0.05, 0.74)
    for gripper, note in ((1.0, "opened cover moved away"), (0.1, "opened cover taken again")):
        moved = snap(0, opened(b=away), (gripper, 1.0), held(away))
        events = play(covers(), {}, CLOSED, opened("b"), moved)
        assert [e.note for e in events if e.kind == "failed"] == [note]


def test_lifting_a_wrong_cover_is_noted_and_not_punished() -> None:
    goal = covers()
    lifted = snap(0, opened(a=(-0.2, -0.18, 0.80)), (0.1, 1.0), held((-0.2, -0.18, 0.84)))
    assert kinds(play(goal, {}, CLOSED, CLOSED, lifted)) == [
        "cue_hidden",
        "grasped",
        "wrong_object",
    ]
    assert goal.diagnostics()["wrong_lifts"] == 1


def test_moving_an_arm_before_the_covers_come_fails() -> None:
    assert kinds(play(covers(), {}, snap(0, {}, grasp=reached(0.031)), CLOSED)) == ["failed"]
