"""Clicking in order, pressing by count, using a tool: what counts, what does not, what is noted."""

from __future__ import annotations

from dataclasses import replace

import pytest
from snapshots_by_hand import AWAY, held, kinds, play, snap

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals.clicks import ClickInOrder, PressCounts, UseInOrder
from robospa.tasks.goals.counters import HitCounter, PressCounter, StampCounter
from robospa.tasks.snapshot import Contact, Snapshot

PLACES: dict[str, Vec3] = {"a": (-0.2, 0.0, 0.74), "b": (-0.1, 0.0, 0.74), "c": (0.0, 0.1, 0.74)}
TOP = Pose((0.0, 0.0, 0.04))


def counter(name: str, closed: bool = True) -> PressCounter:
    return PressCounter(name, TOP, arm=0 if closed else None)


def touching(names: str, opening: float = 0.0, instants: int = 3) -> list[Snapshot]:
    """A touch of each named object in turn, each followed by 0.2 s without one."""
    made = [snap(0, PLACES)]
    for name in names:
        x, y, z = PLACES[name]
        contact = [(name, (x, y, z + 0.04))]
        made += [snap(0, PLACES, (opening, 1.0), AWAY, contact)] * instants
        made += [snap(0, PLACES, (opening, 1.0))] * 10
    return made


DONE, WRONG = "subtask_done", "wrong_order"


@pytest.mark.parametrize(
    ("order", "touched", "opening", "found"),
    [
        ("abc", "abc", 0.0, [DONE, DONE, DONE, "success"]),
        ("ab", "ab", 1.0, []),
        ("ab", "bab", 0.0, [WRONG, DONE, DONE, "success"]),
        ("ab", "ba", 0.0, [WRONG, DONE]),
        ("ab", "aacb", 0.0, [DONE, "repeated", "wrong_object", DONE, "success"]),
        ("a", "", 0.0, []),
    ],
)
def test_clicks_in_order(order: str, touched: str, opening: float, found: list[str]) -> None:
    tracker = ClickInOrder([counter(n) for n in order], [] if "c" in order else [counter("c")])
    events = play(tracker, *touching(touched, opening))
    assert kinds(events) == found
    assert [e.object for e in events if e.kind == DONE] == list(order)[: found.count(DONE)]


def test_diagnostics_count_what_went_wrong() -> None:
    tracker = ClickInOrder([counter("a"), counter("b")], [counter("c")])
    play(tracker, *touching("bcaa"))
    found = tracker.diagnostics()
    assert (found["out_of_order"], found["wrong_clicks"], found["repeated_clicks"]) == (1, 1, 1)
    assert (found["presses"], found["idle_progress"]) == (4, 0.0)


def test_one_long_touch_is_one_click() -> None:
    tracker = ClickInOrder([counter("a"), counter("a")])
    assert "success" not in kinds(play(tracker, *touching("a", instants=40)))


# Counts


def press(times: tuple[int, ...], touched: str) -> tuple[PressCounts, list[Event]]:
    tracker = PressCounts([counter(n, closed=False) for n in "ab"], times)
    return tracker, play(tracker, *touching(touched, opening=1.0))


@pytest.mark.parametrize(
    ("touched", "done", "out_of_order", "excess"),
    [("aab", 2, 0, 0), ("baa", 2, 1, 0), ("aba", 2, 1, 0), ("ab", 1, 1, 0), ("aaaba", 1, 1, 2)],
)
def test_exact_counts_in_any_order(touched: str, done: int, out_of_order: int, excess: int) -> None:
    tracker, events = press((2, 1), touched)
    result = outcome(events, 2)
    assert (result.success, result.failed, result.done) == (done == 2, False, done)
    found = tracker.diagnostics()
    assert (found["out_of_order"], found["excess_presses"]) == (out_of_order, excess)


def test_one_press_too_many_undoes_the_subtask_for_good() -> None:
    assert kinds(press((2, 1), "aaaba")[1])[:3] == [DONE, "repeated", "subtask_undone"]


# Tools

HEAD = Pose((0.0, 0.05, 0.0))
OVER_A: Vec3 = (-0.2, -0.05, 0.78)
OVER_B: Vec3 = (-0.1, -0.05, 0.78)


def hits(*points: tuple[Vec3, str]) -> list[str]:
    """The hammer's origin at each point, touching the named block (or nothing)."""
    made = [snap(0, {**PLACES, "hammer": (0.3, 0.0, 0.74)})]
    for point, name in points:
        contacts = (Contact(name, "hammer", point),) if name else ()
        made.append(replace(snap(0, {**PLACES, "hammer": point}), contacts=contacts))
        made += [snap(0, {**PLACES, "hammer": (0.3, 0.0, 1.0)})] * 8
    counters = [HitCounter(n, TOP, "hammer", HEAD) for n in "ab"]
    return [k for k in kinds(play(UseInOrder(counters, "hammer"), *made)) if k != "dropped"]


@pytest.mark.parametrize(
    ("points", "found"),
    [
        ([(OVER_A, "a"), (OVER_B, "b")], [DONE, DONE, "success"]),
        ([(OVER_B, "b"), (OVER_A, "a")], [WRONG, DONE]),
        ([(OVER_A, "")], []),
        ([((-0.2, 0.0, 0.78), "a")], []),
        ([((-0.178, -0.05, 0.78), "a")], []),
    ],
)
def test_hits_touch_the_middle_in_order(points: list[tuple[Vec3, str]], found: list[str]) -> None:
    assert hits(*points) == found


(AX, AY, AZ), (BX, BY, BZ) = PLACES["a"], PLACES["b"]


@pytest.mark.parametrize(
    ("points", "done"),
    [
        ([PLACES["a"], PLACES["b"]], 2),  # even if the seal is never let go
        ([(AX, AY, AZ + 0.011), (BX, BY, BZ + 0.05)], 0),  # carried over the pads
        ([PLACES["b"], PLACES["a"]], 1),  # only from the first pad on
        ([(AX + 0.0101, AY, AZ)], 0),
        ([(AX + 0.0099, AY, AZ)], 1),
    ],
)
def test_stamps_in_order(points: list[Vec3], done: int) -> None:
    made = [snap(0, {**PLACES, "seal": (0.2, 0.0, 0.74)})]
    for x, y, z in points:
        for height in (0.05, 0.0, 0.05):
            here = (x, y, z + height)
            made.append(snap(0, {**PLACES, "seal": here}, (0.1, 1.0), held(here)))
    tracker = UseInOrder([StampCounter(n, "seal") for n in "ab"], "seal")
    assert outcome(play(tracker, *made), 2).done == done
