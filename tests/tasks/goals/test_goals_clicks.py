"""Clicking in order, pressing by count, using a tool: what counts, what does not, what is noted."""

from __future__ import annotations

from dataclasses import replace

import pytest
from snapshots_by_hand import AWAY, TICK, held, kinds, run, snap

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals.clicks import ClickInOrder, PressCounts
from robospa.tasks.goals.repeat import PressCounter
from robospa.tasks.goals.stamping import StampCounter
from robospa.tasks.goals.tools import HitCounter, UseInOrder
from robospa.tasks.snapshot import Contact, Snapshot

PLACES: dict[str, Vec3] = {"a": (-0.2, 0.0, 0.74), "b": (-0.1, 0.0, 0.74), "c": (0.0, 0.1, 0.74)}
TOP = Pose((0.0, 0.0, 0.04))


def counter(name: str, closed: bool = True) -> PressCounter:
    return PressCounter(name, TOP, arm=0 if closed else None)


def touching(names: str, opening: float = 0.0) -> list[Snapshot]:
    """A touch of each named object in turn, each followed by 0.2 s without one."""
    made = [snap(0, PLACES)]
    for name in names:
        x, y, z = PLACES[name]
        contact = [(name, (x, y, z + 0.04))]
        made += [snap(0, PLACES, (opening, 1.0), AWAY, contact)] * 3
        made += [snap(0, PLACES, (opening, 1.0))] * 10
    return timed(made)


def timed(snapshots: list[Snapshot]) -> list[Snapshot]:
    return [replace(s, time=i * TICK) for i, s in enumerate(snapshots)]


def click(order: str, touched: str, others: str = "", opening: float = 0.0) -> list[Event]:
    goal = ClickInOrder([counter(n) for n in order], [counter(n) for n in others])
    return run(goal, touching(touched, opening))


def test_clicks_in_the_asked_order_succeed_with_the_last_touch() -> None:
    events = click("abc", "abc")
    assert kinds(events) == ["subtask_done"] * 3 + ["success"]
    assert [e.object for e in events[:3]] == ["a", "b", "c"]


def test_a_click_with_an_open_gripper_does_not_count() -> None:
    assert click("ab", "ab", opening=1.0) == []


def test_a_click_out_of_turn_is_noted_and_has_to_come_again() -> None:
    events = click("ab", "bab")
    assert kinds(events) == ["wrong_order", "subtask_done", "subtask_done", "success"]
    assert outcome(click("ab", "ba"), 2).done == 1


def test_a_repeated_click_and_a_wrong_object_are_noted_and_not_punished() -> None:
    events = click("ab", "aacb", others="c")
    assert kinds(events) == ["subtask_done", "repeated", "wrong_object", "subtask_done", "success"]


def test_diagnostics_count_what_went_wrong() -> None:
    goal = ClickInOrder([counter("a"), counter("b")], [counter("c")])
    run(goal, touching("bcaa"))
    found = goal.diagnostics()
    assert (found["out_of_order"], found["wrong_clicks"], found["repeated_clicks"]) == (1, 1, 1)
    assert (found["presses"], found["idle_progress"]) == (4, 0.0)


def test_one_long_touch_is_one_click() -> None:
    x, y, z = PLACES["a"]
    touch = snap(0, PLACES, (0.0, 1.0), AWAY, [("a", (x, y, z + 0.04))])
    goal = ClickInOrder([counter("a"), counter("a")])
    assert "success" not in kinds(run(goal, timed([snap(0, PLACES), *[touch] * 40])))


def test_holding_still_clicks_nothing() -> None:
    idle = timed([snap(0, PLACES)] * 50)
    assert run(ClickInOrder([counter("a")]), idle) == []
    assert run(PressCounts([counter("a")], [2]), idle) == []


# Counts


def press(times: tuple[int, ...], touched: str) -> tuple[PressCounts, list[Event]]:
    goal = PressCounts([counter(n, closed=False) for n in "ab"], times)
    return goal, run(goal, touching(touched, opening=1.0))


def test_exact_counts_succeed_in_any_order() -> None:
    for touched in ("aab", "baa", "aba"):
        assert outcome(press((2, 1), touched)[1], 2).success


def test_too_few_presses_are_not_enough() -> None:
    assert outcome(press((2, 1), "ab")[1], 2).done == 1


def test_one_press_too_many_undoes_the_subtask_for_good() -> None:
    goal, events = press((2, 1), "aaaba")
    assert kinds(events)[:3] == ["subtask_done", "repeated", "subtask_undone"]
    result = outcome(events, 2)
    assert (result.success, result.failed, result.done) == (False, False, 1)
    assert goal.diagnostics()["excess_presses"] == 2


def test_beginning_further_right_is_noted() -> None:
    assert press((2, 1), "aab")[0].diagnostics()["out_of_order"] == 0
    assert press((2, 1), "aba")[0].diagnostics()["out_of_order"] == 1


# Tools


HEAD = Pose((0.0, 0.05, 0.0))


def hits(points: list[tuple[Vec3, str]]) -> list[Event]:
    """The hammer's origin at each point, touching the named block (or nothing)."""
    goal = UseInOrder([HitCounter(n, TOP, "hammer", HEAD) for n in "ab"], "hammer")
    far = (0.3, 0.0, 1.0)
    made = [snap(0, {**PLACES, "hammer": (0.3, 0.0, 0.74)})]
    for point, name in points:
        pose = {**PLACES, "hammer": point}
        touch = snap(0, pose)
        contacts = (Contact(name, "hammer", point),) if name else ()
        made += [replace(touch, contacts=contacts)]
        made += [snap(0, {**PLACES, "hammer": far})] * 8
    return run(goal, timed(made))


OVER_A: Vec3 = (-0.2, -0.05, 0.78)
OVER_B: Vec3 = (-0.1, -0.05, 0.78)


def test_hits_in_order_succeed() -> None:
    events = [e for e in hits([(OVER_A, "a"), (OVER_B, "b")]) if e.kind != "dropped"]
    assert kinds(events) == ["subtask_done", "subtask_done", "success"]


@pytest.mark.parametrize(
    ("point", "name"), [(OVER_A, ""), ((-0.2, 0.0, 0.78), "a"), ((-0.178, -0.05, 0.78), "a")]
)
def test_no_hit_without_touch_or_beside_the_middle(point: Vec3, name: str) -> None:
    assert "subtask_done" not in kinds(hits([(point, name)]))


def test_hitting_the_wrong_block_is_noted() -> None:
    events = kinds(hits([(OVER_B, "b"), (OVER_A, "a")]))
    assert events.index("wrong_order") < events.index("subtask_done")
    assert "success" not in events


def stamped(*points: Vec3) -> list[Event]:
    """A seal, held, that goes to the points in turn and up in between."""
    goal = UseInOrder([StampCounter(n, "seal") for n in "ab"], "seal")
    start: Vec3 = (0.2, 0.0, 0.74)
    made = [snap(0, {**PLACES, "seal": start})]
    for x, y, z in points:
        for height in (0.05, 0.0, 0.05):
            here = (x, y, z + height)
            made.append(snap(0, {**PLACES, "seal": here}, (0.1, 1.0), held(here)))
    return run(goal, timed(made))


def test_stamps_in_order_succeed_even_if_the_seal_is_never_let_go() -> None:
    assert outcome(stamped(PLACES["a"], PLACES["b"]), 2).success


def test_carrying_the_seal_over_the_pads_is_no_stamp() -> None:
    (ax, ay, az), (bx, by, bz) = PLACES["a"], PLACES["b"]
    assert outcome(stamped((ax, ay, az + 0.011), (bx, by, bz + 0.05)), 2).done == 0


def test_stamps_in_the_wrong_order_count_only_from_the_first_pad_on() -> None:
    assert outcome(stamped(PLACES["b"], PLACES["a"]), 2).done == 1


def test_a_stamp_beside_the_middle_does_not_count() -> None:
    x, y, z = PLACES["a"]
    assert outcome(stamped((x + 0.0101, y, z)), 2).done == 0
    assert outcome(stamped((x + 0.0099, y, z)), 2).done == 1
