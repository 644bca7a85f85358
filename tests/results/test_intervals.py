"""Intervals against numbers that can be checked by hand or against other software."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robospa.results.intervals import (
    Estimate,
    bootstrap_mean,
    chance_corrected,
    mean,
    mover,
    wilson,
)


@pytest.mark.parametrize(
    ("successes", "low", "high"),
    [(0, 0.0, 3.70), (1, 0.18, 5.45), (3, 1.03, 8.45), (50, 40.4, 59.6), (100, 96.30, 100.0)],
)
def test_wilson_of_a_hundred(successes: int, low: float, high: float) -> None:
    found = wilson(successes, 100)
    assert (100 * found.low, 100 * found.high) == pytest.approx((low, high), abs=0.05)


@given(st.integers(1, 500), st.data())
def test_wilson_holds_its_value_and_is_symmetric(trials: int, data: st.DataObject) -> None:
    successes = data.draw(st.integers(0, trials))
    found, mirrored = wilson(successes, trials), wilson(trials - successes, trials)
    assert 0 <= found.low <= found.value <= found.high <= 1
    assert found.low == pytest.approx(1 - mirrored.high)


def test_wilson_agrees_with_scipy() -> None:
    from scipy.stats import binomtest

    expected = binomtest(7, 23).proportion_ci(method="wilson")
    found = wilson(7, 23)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))


def test_no_trials_have_no_rate() -> None:
    with pytest.raises(ValueError, match="0 successes in 0 trials"):
        wilson(0, 0)


def test_mover_by_hand() -> None:
    parts = [Estimate(0.5, 0.2, 0.9), Estimate(0.1, 0.1, 0.4)]
    found = mover(parts, [0.5, 0.5])
    assert found.value == pytest.approx(0.3)
    assert found.low == pytest.approx(0.3 - 0.15)
    assert found.high == pytest.approx(0.3 + math.hypot(0.2, 0.15))


def test_mover_of_five_tasks_at_zero_of_a_hundred() -> None:
    found = mean([wilson(0, 100)] * 5)
    assert found.low == 0.0
    assert 100 * found.high == pytest.approx(1.65, abs=0.01)


def test_a_mean_of_means_of_equal_size_is_the_mean_of_all() -> None:
    cells = [wilson(k, 20) for k in (0, 3, 11, 20)]
    nested, flat = mean([mean(cells[:2]), mean(cells[2:])]), mean(cells)
    assert (nested.low, nested.high) == pytest.approx((flat.low, flat.high))


def test_onta_moves_the_limits_with_the_value() -> None:
    found = chance_corrected(wilson(50, 100), 2)
    assert found.value == pytest.approx(0.0)
    assert found.high == pytest.approx(0.19, abs=0.003)
    assert chance_corrected(wilson(100, 100), 6).value == pytest.approx(1.0)


def test_the_papers_onta_example() -> None:
    assert 100 * chance_corrected(wilson(22, 100), 6).value == pytest.approx(6.4)


def test_all_zero_progress_still_has_an_upper_limit() -> None:
    found = bootstrap_mean(np.zeros(100))
    assert (found.value, found.low) == (0.0, 0.0)
    assert 100 * found.high == pytest.approx(3.70, abs=0.01)


def test_the_bootstrap_is_repeatable_and_close_to_the_normal_interval() -> None:
    values = np.tile([0.0, 0.5, 1.0, 0.5], 25)
    found = bootstrap_mean(values, seed=3)
    assert found == bootstrap_mean(values, seed=3)
    half = 1.96 * values.std() / 10
    assert (found.low, found.high) == pytest.approx((0.5 - half, 0.5 + half), abs=0.006)


def test_mover_covers_ninety_five_percent_of_mostly_impossible_tasks() -> None:
    rates = np.array([0.0, 0.01, 0.02, 0.3])
    generator = np.random.default_rng(0)
    draws = generator.binomial(100, rates, size=(2000, 4))
    hits = 0
    for row in draws:
        found = mean([wilson(int(k), 100) for k in row])
        hits += found.low <= rates.mean() <= found.high
    assert 0.93 <= hits / 2000 <= 0.99
