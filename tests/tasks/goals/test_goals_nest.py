"""Stacked vessels: what belongs to the stack, in any order, and only after release."""

from __future__ import annotations

import pytest
from snapshots_by_hand import TICK, held, kinds, run, snap

from robospa.geometry import Vec3
from robospa.tasks.events import outcome
from robospa.tasks.goals.nest import nest

START: dict[str, Vec3] = {
    "p": (0.1, -0.12, 0.74),
    "a": (0.2, 0.1, 0.74),
    "b": (-0.2, 0.1, 0.74),
    "c": (-0.2, -0.03, 0.74),
}


def stacked(*names: str, shift: Vec3 = (0.0, 0.0, 0.0)) -> dict[str, Vec3]:
    """`START` with `names` nested on the plate, the last one out of place by `shift`."""
    found = dict(START)
    for i, name in enumerate(names):
        found[name] = (0.1, -0.12, 0.745 + 0.02 * i)
    x, y, z = found[names[-1]]
    found[names[-1]] = (x + shift[0], y + shift[1], z + shift[2])
    return found


def play(*scenes: dict[str, Vec3]):  # type: ignore[no-untyped-def]
    goal = nest("abc", "p")
    return run(goal, [snap(i * TICK, s) for i, s in enumerate((START, *scenes))])


def test_doing_nothing_earns_nothing() -> None:
    assert play(START) == []


@pytest.mark.parametrize("order", ["abc", "cab", "bca"])
def test_any_order_succeeds(order: str) -> None:
    events = play(*(stacked(*order[: i + 1]) for i in range(3)))
    assert kinds(events) == ["subtask_done"] * 3 + ["success"]


@pytest.mark.parametrize("shift", [(0.051, 0, 0), (0, -0.051, 0)])
def test_beside_the_plate_nothing_begins(shift: Vec3) -> None:
    assert outcome(play(stacked("a", shift=shift)), 3).done == 0


@pytest.mark.parametrize("shift", [(0.041, 0, 0), (0, 0.041, 0), (0, 0, 0.061), (0, 0, -0.016)])
def test_beside_or_far_above_the_bowl_below_it_does_not_count(shift: Vec3) -> None:
    assert outcome(play(stacked("a", "b", shift=shift)), 3).done == 1


def test_two_bowls_side_by_side_on_the_plate_count_once() -> None:
    scene = {**START, "a": (0.06, -0.12, 0.745), "b": (0.14, -0.12, 0.745)}
    assert outcome(play(scene), 3).done == 1


def test_taking_the_lowest_away_takes_the_stack_away() -> None:
    result = outcome(play(stacked("a", "b"), {**stacked("a", "b"), "a": START["a"],
                                              "b": START["b"]}), 3)  # fmt: skip
    assert (result.done, result.best) == (0, 2)


def test_a_bowl_held_over_the_plate_counts_only_after_release() -> None:
    scene = stacked("a")
    grip = held((0.15, -0.12, 0.78))
    snapshots = [snap(0, START), snap(TICK, scene, (0.1, 1), grip), snap(2 * TICK, scene)]
    assert outcome(run(nest("abc", "p"), snapshots[:2]), 3).done == 0
    assert outcome(run(nest("abc", "p"), snapshots), 3).done == 1


def test_success_waits_for_both_grippers_to_open() -> None:
    scene = stacked("a", "b", "c")
    snapshots = [snap(0, START), snap(TICK, scene, (1.0, 0.5)), snap(2 * TICK, scene)]
    assert "success" not in kinds(run(nest("abc", "p"), snapshots[:2]))
    assert kinds(run(nest("abc", "p"), snapshots))[-1] == "success"
