"""What the events of a trial add up to."""

from __future__ import annotations

from robospa.tasks.events import Event, outcome


def done(time: float, index: int) -> Event:
    return Event(time, "subtask_done", "", index)


def undone(time: float, index: int) -> Event:
    return Event(time, "subtask_undone", "", index)


def test_the_best_stays_when_a_subtask_is_undone() -> None:
    both_undone = [done(0.1, 0), done(0.2, 1), undone(0.3, 1), undone(0.4, 0)]
    found = outcome([*both_undone, done(0.5, 0)], 3)
    assert (found.done, found.best, found.success) == (1, 2, False)


def test_doing_one_subtask_twice_is_one_subtask() -> None:
    found = outcome([done(0.1, 0), undone(0.2, 0), done(0.3, 0)], 3)
    assert (found.done, found.best) == (1, 1)


def test_success_counts_all_and_failure_none() -> None:
    assert outcome([Event(0.1, "success")], 2).success
    assert outcome([done(0.1, 0), Event(0.2, "failed")], 2).failed
