"""Which trial of a base task comes next, and what a trial is expected to take."""

from dataclasses import replace

import pytest
from run_fakes import LIMIT, fake_task_of

from robospa.harness.running.scheduler import Pending, TrialQueue
from robospa.harness.running.worker import task_finder
from robospa.harness.worlds import TASK_PARTS
from robospa.trial import TrialKey

KEYS = [TrialKey("Pick_Fake", 1, 100000 + n) for n in range(3)]


def test_a_retry_waits_for_its_time_and_then_goes_first() -> None:
    queue = TrialQueue(KEYS, fake_task_of)
    first = queue.take("Pick_Fake", 0.0)
    assert first is not None
    queue.requeue(replace(first, attempt=2), due=5.0)
    assert queue.next_due(4.0) == 5.0
    second, third = queue.take("Pick_Fake", 4.0), queue.take("Pick_Fake", 6.0)
    assert second is not None and third is not None
    assert (second.key, third.key, third.attempt) == (KEYS[1], first.key, 2)


def test_the_level_that_takes_longest_goes_first() -> None:
    slow, quick = TrialKey("Pick_Fake", 1, 7), TrialKey("Pick_Fake", 2, 7)
    queue = TrialQueue([slow, quick, replace(slow, seed=8), replace(quick, seed=8)], fake_task_of)
    assert queue.take("Pick_Fake", 0.0) == Pending(slow)  # equal limits: in order
    queue.durations.add(slow, 9.0)
    queue.durations.add(quick, 1.0)
    assert queue.take("Pick_Fake", 0.0) == Pending(replace(slow, seed=8))
    assert queue.take("Pick_Fake", 0.0) == Pending(quick)


def test_what_is_expected_moves_from_the_step_limit_to_what_was_measured() -> None:
    queue = TrialQueue(KEYS, fake_task_of)
    key, other = KEYS[0], TrialKey("Pick_Fake", 3, 1)
    assert (queue.durations.expect(key), queue.durations.known) == (LIMIT, False)
    queue.durations.add(key, 10.0)
    assert queue.durations.expect(key) == pytest.approx(10.0)
    assert queue.durations.expect(other) == pytest.approx(10.0)  # as many seconds a step
    queue.durations.add(other, 2.0)
    assert queue.durations.expect(key) == pytest.approx((10.0 + 6.0) / 2)
    assert queue.left() == pytest.approx(3 * 8.0)


def test_a_task_that_nobody_knows_still_counts() -> None:
    def unknown(key: TrialKey) -> object:
        raise KeyError(key.task)

    queue = TrialQueue(KEYS, unknown)
    assert queue.due(0.0) == {"Pick_Fake": 3.0}


def test_the_catalog_is_asked_for_the_task_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def built(*_: object) -> None:
        raise AssertionError("a scene was built")

    monkeypatch.setattr("robospa.harness.trial.build_scene", built)
    found = task_finder(TASK_PARTS)(TrialKey("Put_Bottles_Dustbin", 3, 100000))
    assert (found.name, found.levels[3].subtasks) == ("Put_Bottles_Dustbin", 3)
