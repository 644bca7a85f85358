"""Clicks and placements: counting, releasing, undoing, and the order that is only noted."""

from __future__ import annotations

from dataclasses import replace

from snapshots_by_hand import AWAY, TICK, held, kinds, run, snap

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.parts import Rests, level_with
from robospa.tasks.goals.repeat import PressCounter
from robospa.tasks.snapshot import Snapshot

START: dict[str, Vec3] = {
    "can": (-0.1, -0.1, 0.74),
    "basket": (0.1, -0.2, 0.74),
    "bread": (0.2, 0.0, 0.74),
}
TIP: Vec3 = (-0.1, -0.1, 0.84)
IN_BASKET: Vec3 = (0.11, -0.19, 0.75)


def tracker() -> Checklist:
    """Click, bread into the basket, click."""
    bread = Rests("bread", ("basket",), level_with(0.05, 0.73, 0.80))
    counter = PressCounter("can", Pose((0.0, 0.0, 0.1)), (0.03, 0.03, 0.04))
    return Checklist([counter, bread, counter], released=True)


def click(bread: Vec3 = START["bread"], gripper: float = 0.0) -> list[Snapshot]:
    """A touch of the can and 0.1 s after it."""
    scene = dict(START, bread=bread)
    rest = [snap(0, scene, (gripper, 1.0))] * 6
    return [snap(0, scene, (gripper, 1.0), touched=[("can", TIP)]), *rest]


def put(bread: Vec3 = IN_BASKET) -> list[Snapshot]:
    return [snap(0, dict(START, bread=bread))] * 2


def play(*parts: list[Snapshot]) -> tuple[Checklist, list[Event]]:
    goal = tracker()
    flat = [snap(0, START), *(s for part in parts for s in part)]
    timed = [replace(s, time=i * TICK) for i, s in enumerate(flat)]
    return goal, run(goal, timed)


def test_click_place_click_succeeds_in_the_asked_order() -> None:
    goal, events = play(click(), put(), click(IN_BASKET), put())
    done = [e.index for e in events if e.kind == "subtask_done"]
    assert done == [0, 1, 2]
    assert "success" in kinds(events)
    assert goal.diagnostics()["order_obeyed"] is True


def test_all_clicks_first_succeeds_too_but_is_noted() -> None:
    goal, events = play(click(), click(), put())
    assert "success" in kinds(events)
    assert [e.index for e in events if e.kind == "wrong_order"] == [2]
    assert goal.diagnostics()["order_obeyed"] is False


def test_success_waits_for_open_grippers() -> None:
    parts = (click(), put(), click(IN_BASKET))
    assert "success" not in kinds(play(*parts)[1])
    assert kinds(play(*parts, put())[1])[-1] == "success"


def test_bread_held_over_the_basket_does_not_count() -> None:
    scene = dict(START, bread=(0.1, -0.2, 0.78))
    holding = snap(0, scene, (0.1, 1.0), held((0.1, -0.2, 0.80)))
    assert "subtask_done" not in kinds(play([holding] * 3)[1])


def test_bread_above_the_rim_does_not_count() -> None:
    assert "subtask_done" not in kinds(play(put((0.1, -0.2, 0.82)))[1])


def test_taking_the_bread_out_again_undoes_it() -> None:
    _, events = play(put(), put(START["bread"]))
    result = outcome(events, 3)
    assert (result.done, result.best) == (0, 1)


def test_a_click_too_many_is_reported_and_changes_nothing() -> None:
    _, events = play(click(), click(), click())
    assert kinds(events).count("repeated") == 1
    assert outcome(events, 3).done == 2


def test_clicks_stay_done() -> None:
    _, events = play(click(), put(), put(START["bread"]))
    assert outcome(events, 3).done == 1


def test_an_open_gripper_may_stay_around_what_it_has_put_down() -> None:
    near = snap(0, dict(START, bread=IN_BASKET), (1.0, 1.0), (AWAY[0], IN_BASKET))
    assert "subtask_done" in kinds(play([near])[1])
