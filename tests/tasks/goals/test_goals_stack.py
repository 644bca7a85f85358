"""Towers: what counts as stacked, what takes it away, and what is only noted."""

from __future__ import annotations

import pytest
from snapshots_by_hand import TICK, held, kinds, run, snap

from robospa.geometry import Vec3
from robospa.tasks.events import outcome
from robospa.tasks.goals.stack import Bring, Stack

H = 0.036
GROUND = {"a": (0.0, -0.13, 0.758), "b": (0.2, 0.0, 0.758), "c": (-0.2, 0.0, 0.758)}


def tower(*names: str, shift: Vec3 = (0.0, 0.0, 0.0)) -> dict[str, Vec3]:
    """`GROUND` with `names` above each other, the last one out of place by `shift`."""
    result = dict(GROUND)
    for i, name in enumerate(names):
        result[name] = (0.0, -0.13, 0.758 + i * H)
    x, y, z = result[names[-1]]
    result[names[-1]] = (x + shift[0], y + shift[1], z + shift[2])
    return result


def play(*scenes: dict[str, Vec3], order: str = "abc"):  # type: ignore[no-untyped-def]
    goal = Stack(order, H)
    return goal, run(goal, [snap(i * TICK, s) for i, s in enumerate((GROUND, *scenes))])


def test_the_bottom_block_counts_from_the_start() -> None:
    goal, events = play(GROUND)
    assert [(e.kind, e.index) for e in events] == [("subtask_done", 0)]
    assert goal.diagnostics()["idle_progress"] == pytest.approx(1 / 3)


def test_a_tower_in_the_right_order_succeeds() -> None:
    _, events = play(tower("a", "b"), tower("a", "b", "c"))
    assert kinds(events) == ["subtask_done"] * 3 + ["success"]


def test_a_tower_in_the_wrong_order_does_not() -> None:
    goal, events = play(tower("a", "c"), tower("a", "c", "b"))
    assert outcome(events, 3).done == 1
    assert goal.diagnostics()["out_of_order"] == 0


def test_a_collapse_takes_the_subtasks_away_again() -> None:
    tilted = tower("a", "b")
    _, events = play(tilted, GROUND)
    result = outcome(events, 3)
    assert (result.done, result.best) == (1, 2)


@pytest.mark.parametrize("shift", [(0.026, 0, 0), (0, 0.026, 0), (0, 0, 0.021), (0, 0, -0.021)])
def test_beyond_a_tolerance_a_block_is_not_stacked(shift: Vec3) -> None:
    _, events = play(tower("a", "b", shift=shift))
    assert outcome(events, 3).done == 1


@pytest.mark.parametrize("shift", [(0.024, 0, 0), (0, -0.024, 0), (0, 0, 0.019)])
def test_within_the_tolerances_it_is(shift: Vec3) -> None:
    _, events = play(tower("a", "b", shift=shift))
    assert outcome(events, 3).done == 2


def test_a_held_block_counts_only_after_release() -> None:
    scene = tower("a", "b")
    grip = held(scene["b"])
    snapshots = [
        snap(0, GROUND),
        snap(TICK, scene, (0.3, 1), grip),
        snap(2 * TICK, scene, (0.9, 1), grip),
    ]
    assert kinds(run(Stack("ab", H), snapshots[:2])) == ["subtask_done", "grasped"]
    assert kinds(run(Stack("ab", H), snapshots))[-2:] == ["subtask_done", "success"]


def test_bringing_the_next_block_does_not_undo_the_one_below() -> None:
    goal = Stack("abc", H)
    two = tower("a", "b")
    near = held((0.0, -0.13, 0.758 + 1.5 * H))
    events = run(goal, [snap(0, GROUND), snap(TICK, two), snap(2 * TICK, two, (0, 1), near)])
    assert "subtask_undone" not in kinds(events)


def test_success_waits_for_both_grippers_to_open() -> None:
    scene = tower("a", "b", "c")
    snapshots = [snap(0, GROUND), snap(TICK, scene, (1.0, 0.5)), snap(2 * TICK, scene)]
    assert "success" not in kinds(run(Stack("abc", H), snapshots[:2]))
    assert kinds(run(Stack("abc", H), snapshots))[-1] == "success"


def test_a_block_stacked_before_the_one_below_is_noted() -> None:
    # c hangs in the right place (say, on something foreign) while b is still missing
    floating = dict(GROUND, b=(0.024, -0.13, 0.758), c=(0.0, -0.13, 0.758 + 2 * H))
    goal, events = play(floating)
    assert [e.kind for e in events if e.object == "c"] == ["wrong_order", "subtask_done"]
    assert goal.diagnostics()["out_of_order"] == 1


def bring(*steps: tuple[Vec3, tuple[float, float]]) -> list[str]:
    goal = Bring("a", (-0.05, 0.05), (-1.0, -0.08))
    start = snap(0, {"a": (0.2, 0.0, 0.758)})
    rest = [snap(i * TICK, {"a": p}, g) for i, (p, g) in enumerate(steps, 1)]
    return [k for k in kinds(run(goal, [start, *rest])) if k != "dropped"]


def test_level_one_needs_the_block_in_the_near_middle_and_released() -> None:
    there = (0.0, -0.15, 0.758)
    assert bring((there, (0.1, 1))) == []
    assert bring((there, (1, 1))) == ["subtask_done", "success"]


@pytest.mark.parametrize("where", [(0.06, -0.15, 0.758), (0, -0.07, 0.758), (0, -0.15, 0.85)])
def test_level_one_refuses_other_places(where: Vec3) -> None:
    assert bring((where, (1, 1))) == []
