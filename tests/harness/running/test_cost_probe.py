"""What a run will cost, from a sample of it."""

from __future__ import annotations

import pytest

from robospa.harness.running.cost_probe import (
    Cost,
    Done,
    ProbeFailed,
    limit_of,
    predict,
    spread,
)
from robospa.trial import TrialKey

SHORT = [TrialKey("Pick_Blocks_Size", 1, seed) for seed in range(100)]
LONG = [TrialKey("Place_Bowls_Plates", 5, seed) for seed in range(50)]


def sample(places: int, trials: int, per_step: float, late: float = 0.0) -> list[Done]:
    """Short and long trials in turn on so many places, each `per_step` seconds a step of its
    limit; the first of a place takes `late` seconds more."""
    free, found = [0.0] * places, []
    for n in range(trials):
        key = (SHORT, LONG)[n % 2][0]
        began = min(free)
        place = free.index(began)
        took = per_step * limit_of(key) + (late if began == 0.0 else 0.0)
        free[place] = began + took
        found.append(Done(began, began + took, limit_of(key), 10, 0.5 * took))
    return found


def steps(keys: list[TrialKey]) -> int:
    return sum(map(limit_of, keys))


@pytest.mark.parametrize("late", [0.0, 3.0])
def test_the_rate_is_that_of_workers_that_have_started(late: float) -> None:
    keys = SHORT + LONG
    made = sample(4, 60, 0.01, late)
    started = max(one.ended for one in made if one.began == 0.0)
    cost = predict(made, keys, started)
    assert cost.seconds == pytest.approx(steps(keys) * 0.01 / 4 + late, rel=0.02)
    assert cost.least <= cost.seconds <= cost.most
    assert (cost.trials, cost.sampled) == (150, 60)


def test_queries_and_processor_time_grow_with_the_steps() -> None:
    cost = predict(sample(2, 40, 0.01), 10 * SHORT, 0.0)
    shorter = predict(sample(2, 40, 0.01), SHORT, 0.0)
    assert cost.calls == pytest.approx(10 * shorter.calls, abs=10)
    assert cost.core_hours == pytest.approx(10 * shorter.core_hours)


def test_uneven_trials_leave_more_doubt() -> None:
    def doubt(durations: list[float]) -> float:
        made = [Done(float(n), n + took, 100, 1, 0.0) for n, took in enumerate(durations)]
        cost: Cost = predict(made, SHORT, 0.0)
        return (cost.most - cost.least) / cost.seconds

    assert doubt([1.0] * 8) < 0.01 < doubt([0.2, 1.8] * 4)


def test_fewer_trials_than_places_are_still_told_of() -> None:
    made = [Done(0.0, 2.0, 150, 5, 1.0)]
    assert predict(made, SHORT[:1], 1.0).seconds == pytest.approx(2.0, rel=0.01)


def test_a_sample_without_a_trial_says_nothing() -> None:
    with pytest.raises(ProbeFailed, match="no trial of the probe could be run"):
        predict([], SHORT, 1.0)


def test_every_beginning_of_the_sample_has_short_and_long_trials() -> None:
    found = spread(SHORT + LONG)
    assert sorted(found) == sorted(SHORT + LONG)
    for count in (12, 30, 60):
        long = sum(key.task == LONG[0].task for key in found[:count])
        assert abs(long - count / 3) <= 2
