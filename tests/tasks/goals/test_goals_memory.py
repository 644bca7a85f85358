"""Opening covers from memory: stillness before, order after, and what fails for good."""

from __future__ import annotations

import pytest
from snapshots_by_hand import AWAY, TICK, held, kinds, run, snap

from robospa.geometry import Vec3
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals.memory import Cover, UncoverInOrder

PLACES = {"a": (-0.2, -0.05), "b": (0.0, -0.05), "c": (0.2, -0.05)}
CLOSED: dict[str, Vec3] = {name: (x, -0.18, 0.74) for name, (x, _) in PLACES.items()}
ORDER = "bca"


def tracker() -> UncoverInOrder:
    return UncoverInOrder([Cover(name, PLACES[name]) for name in ORDER], below=0.745)


def opened(*names: str, **elsewhere: Vec3) -> dict[str, Vec3]:
    return {**CLOSED, **{n: (*PLACES[n], 0.74) for n in names}, **elsewhere}


def play(*scenes: dict[str, Vec3]) -> tuple[UncoverInOrder, list[Event]]:
    """Nothing for two instants, then the covers, then `scenes`."""
    goal = tracker()
    whole = ({}, {}, CLOSED, *scenes)
    return goal, run(goal, [snap(i * TICK, scene) for i, scene in enumerate(whole)])


def test_the_cue_is_hidden_when_the_covers_appear() -> None:
    goal, events = play(CLOSED)
    assert [(e.kind, e.time) for e in events] == [("cue_hidden", 2 * TICK)]
    assert goal.diagnostics()["cue_hidden_at"] == 2 * TICK


def test_opening_in_the_asked_order_succeeds() -> None:
    _, events = play(opened("b"), opened("b", "c"), opened("b", "c", "a"))
    assert kinds(events) == ["cue_hidden", *["subtask_done"] * 3, "success"]
    assert [e.object for e in events if e.kind == "subtask_done"] == ["b", "c", "a"]


def test_opening_a_later_cover_too_early_fails_for_good() -> None:
    _, events = play(opened("b"), opened("b", "a"), opened("b", "c", "a"))
    assert kinds(events) == ["cue_hidden", "subtask_done", "wrong_order", "failed"]
    result = outcome(events, 3)
    assert (result.failed, result.done) == (True, 1)


def test_moving_an_opened_cover_away_fails_for_good() -> None:
    _, events = play(opened("b"), opened("b", b=(0.0, 0.05, 0.74)), opened("b", "c", "a"))
    assert [e.note for e in events if e.kind == "failed"] == ["opened cover moved away"]
    assert outcome(events, 3).done == 1


def test_lifting_a_wrong_cover_is_noted_and_not_punished() -> None:
    goal = tracker()
    lifted, grip = opened(a=(-0.2, -0.18, 0.80)), held((-0.2, -0.18, 0.84))
    # a lift is seen as one only from the instant after the covers appeared
    scenes = [({}, AWAY, 1.0), (CLOSED, AWAY, 1.0), (CLOSED, AWAY, 1.0), (lifted, grip, 0.1)]
    events = run(goal, [snap(i * TICK, s, (o, 1), g) for i, (s, g, o) in enumerate(scenes)])
    assert kinds(events) == ["cue_hidden", "grasped", "wrong_object"]
    assert goal.diagnostics()["wrong_lifts"] == 1


def test_moving_an_arm_before_the_covers_come_fails() -> None:
    moved = (AWAY[0], (AWAY[1][0], AWAY[1][1] + 0.031, AWAY[1][2]))
    events = run(tracker(), [snap(0, {}), snap(TICK, {}, grasp=moved), snap(2 * TICK, CLOSED)])
    assert kinds(events) == ["failed"]


def test_trembling_before_the_covers_come_is_fine() -> None:
    moved = (AWAY[0], (AWAY[1][0], AWAY[1][1] + 0.029, AWAY[1][2]))
    goal = tracker()
    events = run(goal, [snap(0, {}), snap(TICK, {}, grasp=moved), snap(2 * TICK, CLOSED)])
    assert kinds(events) == ["cue_hidden"]
    assert goal.diagnostics()["motion_before"] == pytest.approx(0.029)


@pytest.mark.parametrize(
    ("place", "is_open"),
    [((0.0, -0.006, 0.74), True), ((0.0, -0.004, 0.74), False), ((0.0, -0.05, 0.746), False)],
)
def test_a_cover_is_open_only_on_the_table_near_its_place(place: Vec3, is_open: bool) -> None:
    assert ("subtask_done" in kinds(play(opened(b=place))[1])) is is_open


def test_nothing_happens_after_the_end() -> None:
    _, events = play(opened("b"), opened("b", "c"), opened("b", "c", "a"), opened("a"))
    assert kinds(events)[-1] == "success"
