"""Tests of differences, against numbers by hand and against SciPy."""

from __future__ import annotations

import pytest

from robospa.results.paper.published import load
from robospa.results.statistics.intervals import Estimate, interval_of, paired_difference
from robospa.results.statistics.samples import Sample, rate
from robospa.results.statistics.significance import (
    at_least,
    benjamini_hochberg,
    boschloo,
    mcnemar_mid_p,
    p_of_difference,
    p_of_interval,
    supported_best,
)


def test_mcnemar_by_hand() -> None:
    # 5 against 1: (1 + 6) / 64 doubled, less the half of what was seen, doubled: 6 / 64
    assert mcnemar_mid_p(5, 1) == pytest.approx((2 * 7 - 6) / 64)
    assert mcnemar_mid_p(0, 0) == mcnemar_mid_p(4, 4) == 1.0
    assert mcnemar_mid_p(3, 9) == mcnemar_mid_p(9, 3)
    assert mcnemar_mid_p(0, 40) == pytest.approx(2.0**-40, rel=1e-9)
    with pytest.raises(ValueError, match="no counts"):
        mcnemar_mid_p(-1, 2)


def test_mcnemar_agrees_with_scipys_binomial() -> None:
    from scipy.stats import binom

    for b, c in ((17, 9), (2, 11), (400, 350)):
        low = min(b, c)
        expected = 2 * binom.cdf(low, b + c, 0.5) - binom.pmf(low, b + c, 0.5)
        assert mcnemar_mid_p(b, c) == pytest.approx(expected)


def test_boschloo_of_two_trials_by_hand() -> None:
    # Only 0 of 1 against 1 of 1 is as extreme: (1 - p) p is at most 1/4, and both sides double it.
    assert boschloo(rate(0, 1), rate(1, 1)) == pytest.approx(0.5)
    assert boschloo(rate(3, 10), rate(3, 10)) == 1.0


@pytest.mark.parametrize("table", [(20, 33, 100, 100), (0, 5, 100, 100), (9, 3, 30, 12)])
def test_boschloo_agrees_with_scipy(table: tuple[int, int, int, int]) -> None:
    from scipy.stats import boschloo_exact

    a, b, n, m = table
    expected = boschloo_exact([[a, b], [n - a, m - b]]).pvalue
    assert boschloo(rate(a, n), rate(b, m)) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(("a", "b"), [(0, 5), (20, 33), (30, 44), (50, 64)])
def test_the_smallest_difference_that_a_hundred_trials_show(a: int, b: int) -> None:
    assert boschloo(rate(a, 100), rate(b, 100)) < 0.05 <= boschloo(rate(a, 100), rate(b - 1, 100))


def test_boschloo_refuses_progress_and_thousands_of_trials() -> None:
    with pytest.raises(ValueError, match="progress has none"):
        boschloo(Sample((1, 1, 1)), rate(1, 3))
    with pytest.raises(ValueError, match="5000 trials takes too long"):
        boschloo(rate(1, 5000), rate(2, 5000))


def test_p_of_an_interval_by_hand() -> None:
    assert p_of_interval(Estimate(1.0, 0.0, 2.0)) == pytest.approx(0.05)
    assert p_of_interval(Estimate(-2.0, -3.0, -1.0)) == pytest.approx(0.0000887, abs=1e-6)
    assert p_of_interval(Estimate(0.0, 0.0, 0.0)) == 1.0
    with pytest.raises(ValueError, match="without width"):
        p_of_interval(Estimate(1.0, 1.0, 2.0))


def test_p_of_an_interval_is_small_exactly_if_zero_is_outside() -> None:
    for b in range(0, 40):
        found = paired_difference(b, 12, 100)
        assert (p_of_interval(found) < 0.05) == (found.low > 0 or found.high < 0)


def test_benjamini_hochberg_by_hand() -> None:
    assert benjamini_hochberg([0.01, 0.04, 0.03, 0.5]) == pytest.approx(
        [0.04, 0.04 * 4 / 3, 0.04 * 4 / 3, 0.5]
    )
    assert benjamini_hochberg([]) == []


def test_benjamini_hochberg_agrees_with_scipy() -> None:
    from scipy.stats import false_discovery_control

    chances = [0.001, 0.2, 0.03, 0.03, 0.9, 0.0]
    assert benjamini_hochberg(chances) == pytest.approx(false_discovery_control(chances))


def test_the_best_are_better_than_another_and_worse_than_none() -> None:
    row = [rate(50, 100), rate(48, 100), None, rate(5, 100)]
    assert supported_best([row]) == [frozenset({0, 1})]
    assert supported_best([row]) == supported_best([row])
    assert supported_best([[None, None], []]) == [frozenset(), frozenset()]
    assert supported_best([[rate(0, 100)] * 3]) == [frozenset()]


def test_a_handful_of_trials_is_never_the_best() -> None:
    """0 of 3 cannot be told from 58 of 100, but is better than nothing either."""
    assert p_of_difference(rate(58, 100), rate(0, 3)) > 0.05
    assert supported_best([[rate(58, 100), rate(20, 100), rate(0, 3)]]) == [frozenset({0})]
    assert supported_best([[rate(58, 100), rate(0, 3)]]) == [frozenset()]
    assert supported_best([[rate(58, 100), rate(3, 3)]]) == [frozenset()]


def test_many_rows_ask_for_more_evidence() -> None:
    close, equal = [rate(33, 100), rate(20, 100)], [rate(30, 100), rate(30, 100)]
    assert supported_best([close]) == [frozenset({0})]
    assert supported_best([close, *[equal] * 9])[0] == frozenset()


def test_averages_are_told_apart_by_the_interval_of_their_difference() -> None:
    high = interval_of([rate(60, 100), rate(40, 100)])
    low, near = interval_of([rate(20, 100)] * 2), interval_of([rate(55, 100), rate(43, 100)])
    assert supported_best([[low, high, near]]) == [frozenset({1, 2})]
    assert p_of_difference(high, low) < 0.001
    assert p_of_difference(rate(1, 2), high) > 0.05  # a sample and an average


def test_half_of_the_papers_best_cells_are_supported() -> None:
    data = load()
    rows = [
        [rate(int(data.value(m, "sr", t, n) or 0), 100) for m in data.models]
        for t in data.tasks
        for n in range(1, 6)
    ]
    marked = supported_best(rows)
    assert len(marked) == 280
    assert sum(len(places) == 1 for places in marked) == 142
    assert sum(len(places) == 0 for places in marked) == 33


def test_so_many_successes_or_more_of_trials_of_several_kinds() -> None:
    assert at_least(3, {0.5: 4}) == pytest.approx(5 / 16)
    assert at_least(3, {0.5: 2, 0.25: 1}) == pytest.approx(1 / 16)
    assert at_least(0, {}) == 1.0
