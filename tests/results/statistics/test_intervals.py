"""Intervals against numbers that can be checked by hand or against other software."""

import math
from collections.abc import Callable
from functools import cache
from math import comb
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robospa.results.paper.published import load
from robospa.results.statistics.intervals import (
    METHODS,
    Estimate,
    bounded_mean,
    chance_corrected,
    difference,
    exact,
    interval_of,
    mean,
    mover,
    over_tasks,
    paired_difference,
    paired_sample_difference,
    wilson,
)
from robospa.results.statistics.samples import Sample, draw, draw_over_tasks, progress, rate
from robospa.results.statistics.significance import (
    anytime_p,
    at_least,
    benjamini_hochberg,
    boschloo,
    mcnemar_mid_p,
    p_of_difference,
    p_of_interval,
    supported_best,
)


@pytest.mark.parametrize(
    ("method", "successes", "low", "high"),
    [
        *((wilson, 0, 0.0, 3.70), (wilson, 1, 0.18, 5.45), (wilson, 3, 1.03, 8.45)),
        *((wilson, 50, 40.4, 59.6), (wilson, 100, 96.30, 100.0)),
        *((exact, 0, 0.0, 3.62), (exact, 1, 0.03, 5.45), (exact, 3, 0.62, 8.52)),
        *((exact, 50, 39.8, 60.2), (exact, 100, 96.38, 100.0)),
    ],
)
def test_rates_of_a_hundred(
    method: Callable[[int, int], Estimate], successes: int, low: float, high: float
) -> None:
    found = method(successes, 100)
    assert (100 * found.low, 100 * found.high) == pytest.approx((low, high), abs=0.05)


@given(st.integers(1, 500), st.data())
def test_wilson_holds_its_value_and_is_symmetric(trials: int, data: st.DataObject) -> None:
    successes = data.draw(st.integers(0, trials))
    found, mirrored = wilson(successes, trials), wilson(trials - successes, trials)
    assert 0 <= found.low <= found.value <= found.high <= 1
    assert found.low == pytest.approx(1 - mirrored.high)


def test_mover_by_hand() -> None:
    parts = [Estimate(0.5, 0.2, 0.9), Estimate(0.1, 0.1, 0.4)]
    found = mover(parts, [0.5, 0.5])
    assert found.value == pytest.approx(0.3)
    assert found.low == pytest.approx(0.3 - 0.15)
    assert found.high == pytest.approx(0.3 + math.hypot(0.2, 0.15))


def test_onta_moves_the_limits_with_the_value() -> None:
    found = chance_corrected(wilson(50, 100), 2)
    assert found.value == pytest.approx(0.0)
    assert found.high == pytest.approx(0.19, abs=0.003)
    assert chance_corrected(wilson(100, 100), 6).value == pytest.approx(1.0)
    assert chance_corrected(wilson(22, 100), 6).value == pytest.approx(0.064)  # the paper's


def test_a_printed_mean_gets_the_interval_of_the_rate_that_varies_most() -> None:
    found = bounded_mean(0.5, 100)
    assert (found.low, found.high) == pytest.approx((wilson(50, 100).low, wilson(50, 100).high))


def test_newcombes_difference_by_hand() -> None:
    found = difference(wilson(56, 70), wilson(48, 80))
    assert (found.low, found.high) == pytest.approx((0.0524, 0.3339), abs=0.0001)


def test_the_difference_of_pairs_that_never_differ_by_hand() -> None:
    found = paired_difference(0, 0, 100)
    half = 1.96**2 / (100 + 1.96**2)
    assert (found.value, found.low, found.high) == pytest.approx((0.0, -half, half), abs=1e-5)


@pytest.mark.parametrize(("b", "c", "n"), [(12, 2, 50), (17, 9, 100), (1, 0, 100), (0, 3, 10)])
def test_limits_of_a_paired_difference_are_where_the_score_reaches_two(
    b: int, c: int, n: int
) -> None:
    found, mirrored = paired_difference(b, c, n), paired_difference(c, b, n)
    assert found.low == pytest.approx(-mirrored.high, abs=1e-9)
    assert found.low < found.value == (b - c) / n < found.high
    for limit in (found.low, found.high):
        shares = np.linspace(max(0.0, -limit), (1 - limit) / 2, 200_001)[1:-1]
        with np.errstate(divide="ignore"):
            fit = b * np.log(shares + limit) + c * np.log(shares)
            fit += (n - b - c) * np.log(1 - 2 * shares - limit)
        share = float(shares[np.argmax(fit)])
        score = (b - c - n * limit) / math.sqrt(n * (2 * share + limit * (1 - limit)))
        assert abs(score) == pytest.approx(1.96, abs=0.005)


def test_pairs_of_progress() -> None:
    differs = Sample((5, 10, 60, 20, 5), 0.5, -1.0)
    found = paired_sample_difference(differs)
    assert found == paired_sample_difference(differs)
    assert found.value == pytest.approx(0.05)
    assert found.low < found.value < found.high
    equal = paired_sample_difference(Sample((0, 0, 100, 0, 0), 0.5, -1.0))
    assert equal.high == pytest.approx(paired_difference(0, 0, 100).high)
    shifted = paired_sample_difference(Sample((0, 0, 0, 100, 0), 0.5, -1.0))
    assert shifted.low < shifted.value == 0.5 < shifted.high
    assert paired_sample_difference(Sample((0, 0, 0, 1, 0), 0.5, -1.0)).high < 1
    whole = paired_sample_difference(Sample((0, 0, 0, 0, 10), 0.5, -1.0))
    assert whole.low == pytest.approx(paired_difference(10, 0, 10).low)


def test_every_method_says_what_it_did() -> None:
    cells = [rate(1, 10), rate(5, 10)]
    one = [interval_of(cells[:1], method=m).method for m in METHODS]
    assert one == ["Wilson", "exact", "bootstrap"]
    several = [interval_of(cells, method=m).method for m in METHODS]
    assert several == ["MOVER on Wilson", "MOVER on exact", "stratified bootstrap"]
    assert mean([mean([wilson(1, 10)] * 2), wilson(3, 10)]).method == "MOVER on Wilson"
    assert over_tasks([cells]).method == "bootstrap over tasks"


def test_an_average_is_one_call_over_its_cells_or_means_of_means() -> None:
    cells = [rate(k, 100) for k in (0, 7, 40, 90)]
    flat = interval_of(cells, [1 / 2, 1 / 6, 1 / 6, 1 / 6])
    nested = mean([wilson(0, 100), mean([wilson(k, 100) for k in (7, 40, 90)])])
    assert (flat.low, flat.high) == pytest.approx((nested.low, nested.high))


def test_onta_of_several_candidate_counts_is_a_weighted_sum() -> None:
    found = interval_of([rate(30, 100, 2), rate(50, 100, 6)])
    by_hand = mean([chance_corrected(wilson(30, 100), 2), chance_corrected(wilson(50, 100), 6)])
    assert (found.value, found.low, found.high) == pytest.approx(
        (by_hand.value, by_hand.low, by_hand.high)
    )


@pytest.mark.parametrize("method", METHODS[:2])
@pytest.mark.parametrize("counts", [(100, 0, 0), (0, 0, 100), (0, 100, 0), (0, 1, 0)])
def test_progress_that_never_varies_keeps_a_width(method: str, counts: tuple[int, ...]) -> None:
    found = interval_of([Sample(counts, 0.5)], method=method)
    assert found.high - found.low > 0.02
    assert 0 <= found.low <= found.value <= found.high <= 1
    assert (found.value in (found.low, found.high)) == (not counts[1])
    assert "where all are equal" in found.method
    assert p_of_difference(Sample(counts, 0.5), Sample((0, 0, 0, 1, 0), 0.25)) > 0


def test_over_tasks_is_never_narrower_than_over_seeds() -> None:
    nothing = [[rate(0, 100)] * 5]
    assert over_tasks(nothing).high == pytest.approx(interval_of(nothing[0]).high)
    spread = [[rate(10, 100), rate(90, 100)], [rate(40, 100)]]
    found = over_tasks(spread)
    seeds = interval_of([rate(10, 100), rate(90, 100), rate(40, 100)], [0.25, 0.25, 0.5])
    assert found.low < seeds.low < seeds.high < found.high
    same = over_tasks(spread, against=spread)
    assert same.value == 0.0
    assert same.low < 0 < same.high


TRIALS = 100
NOISE = 0.011
"""Two standard errors of a coverage of 95 % found in 1,500 simulations."""


@cache
def cell(successes: int, method: str) -> Estimate:
    return interval_of([rate(successes, TRIALS)], method=method)


def holds(found: Estimate, truth: float | np.floating[Any]) -> bool:
    return bool(found.low - 1e-12 <= truth <= found.high + 1e-12)


def exact_coverage(p: float, method: str) -> float:
    """No simulation: all 101 outcomes, weighted by how likely they are."""
    found = 0.0
    for k in range(TRIALS + 1):
        if holds(cell(k, method), p):
            found += comb(TRIALS, k) * p**k * (1 - p) ** (TRIALS - k)
    return found


@pytest.mark.parametrize(
    ("method", "low", "high", "worst"), [("wilson", 0.94, 0.96, 0.92), ("exact", 0.95, 0.98, 0.95)]
)
def test_a_single_rate(method: str, low: float, high: float, worst: float) -> None:
    found = [exact_coverage(p, method) for p in np.linspace(0.01, 0.99, 99)]
    assert low <= float(np.mean(found)) <= high
    assert min(found) >= worst


@pytest.mark.parametrize(
    "rates",
    [
        [0.05, 0.2, 0.4, 0.6, 0.8],
        [0.0, 0.0, 0.01, 0.01, 0.02, 0.05, 0.1, 0.2],
        [0.0] * 16 + [0.01] * 4 + [0.02] * 4 + [0.1] * 4 + [0.3] * 4,
        list(np.linspace(0.02, 0.6, 56)),
    ],
    ids=["category", "hard-category", "mostly-impossible", "overall"],
)
def test_an_average_by_mover(rates: list[float]) -> None:
    draws = np.random.default_rng(0).binomial(TRIALS, rates, size=(1500, len(rates)))
    hits = [holds(mean([cell(int(k), "wilson") for k in row]), np.mean(rates)) for row in draws]
    assert 0.93 - NOISE <= float(np.mean(hits)) <= 0.97 + NOISE


def progress_coverage(chances: list[float], variants: int) -> float:
    top = len(chances) - 1
    truth = float(np.dot(chances, np.arange(top + 1)) / top)
    generator, hits, repeats = np.random.default_rng(1), 0, 1500 // variants
    for _ in range(repeats):
        counts = generator.multinomial(TRIALS, chances, size=variants)
        samples = [Sample(tuple(int(c) for c in row), 1 / top) for row in counts]
        hits += holds(interval_of(samples), truth)
    return hits / repeats


@pytest.mark.parametrize("variants", [1, 5])
@pytest.mark.parametrize("chances", [[0.3, 0.3, 0.2, 0.2], [0.1, 0.1, 0.8]])
def test_progress(chances: list[float], variants: int) -> None:
    found = progress_coverage(chances, variants)
    noise = NOISE * variants**0.5
    assert 0.93 - noise <= found <= 0.97 + noise


def test_rare_progress_is_never_a_point() -> None:
    assert progress_coverage([0.995, 0.005, 0.0], 1) >= 0.93


@pytest.mark.parametrize(("b", "c"), [(0.15, 0.1), (0.3, 0.05), (0.05, 0.02)])
@pytest.mark.parametrize("variants", [1, 5])
def test_a_paired_difference(b: float, c: float, variants: int) -> None:
    generator, hits, repeats = np.random.default_rng(2), 0, 1000
    found = cache(paired_difference)
    for _ in range(repeats):
        counts = generator.multinomial(TRIALS, [b, c, 1 - b - c], size=variants)
        parts = [found(int(x), int(y), TRIALS) for x, y, _ in counts]
        hits += holds(mean(parts), b - c)
    assert 0.93 - 1.3 * NOISE <= hits / repeats <= 0.97 + 1.3 * NOISE


@pytest.mark.parametrize(("p", "q"), [(0.2, 0.3), (0.02, 0.1), (0.5, 0.5)])
def test_an_unpaired_difference(p: float, q: float) -> None:
    generator = np.random.default_rng(3)
    counts = generator.binomial(TRIALS, [p, q], size=(1500, 2))
    hits = [
        holds(difference(wilson(int(a), TRIALS), wilson(int(b), TRIALS)), p - q) for a, b in counts
    ]
    assert 0.93 - NOISE <= float(np.mean(hits)) <= 0.97 + NOISE


# ----------- the bootstrap drawn from exact distributions, against resampled episodes and the paper


def rdt_groups() -> list[list[Sample]]:
    """RDT's printed successes at L5, a list for each category."""
    data = load()
    return [
        [rate(int(data.value("RDT", "sr", task, 5) or 0), 100) for task in tasks]
        for tasks in data.members.values()
    ]


def rdt_cells() -> tuple[list[Sample], list[float]]:
    """The same in one list, with the weights of the overall value."""
    groups = rdt_groups()
    weights = [1 / (len(groups) * len(group)) for group in groups for _ in group]
    return [cell for group in groups for cell in group], weights


def test_one_seed_gives_one_answer_and_another_seed_another() -> None:
    cells = rdt_cells()
    first, again, other = (draw(*cells, seed) for seed in (7, 7, 8))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    groups = [cells[0][:4], cells[0][4:9]]
    assert np.array_equal(draw_over_tasks(groups, 7, 500), draw_over_tasks(groups, 7, 500))
    assert over_tasks(groups, 4) == over_tasks(groups, 4)


@pytest.mark.parametrize(
    "samples",
    [
        [rate(1, 100), rate(30, 100), rate(99, 100)],
        [rate(22, 100, candidates=6), rate(50, 100, candidates=2)],
        [Sample((60, 25, 10, 5), 1 / 3), Sample((97, 0, 3), 0.5)],
        [Sample((10, 70, 20), 1.0, -1.0)],
    ],
    ids=["rates", "onta", "progress", "paired"],
)
def test_drawing_sums_is_resampling_episodes(samples: list[Sample]) -> None:
    weights = [1 / len(samples)] * len(samples)
    fast = draw(samples, weights, seed=1, resamples=40_000)
    slow, generator = np.zeros(40_000), np.random.default_rng(2)
    for sample, weight in zip(samples, weights, strict=True):
        outcomes = np.repeat(np.arange(len(sample.counts)), sample.counts)
        picked = generator.integers(0, len(outcomes), size=(40_000, len(outcomes)))
        slow += weight * (sample.shift + sample.scale * outcomes[picked].mean(axis=1))
    noise = slow.std() / math.sqrt(40_000)
    assert abs(fast.mean() - slow.mean()) < 6 * noise
    assert fast.std() == pytest.approx(slow.std(), rel=0.03)
    ends = [np.percentile(x, [2.5, 25, 75, 97.5]) for x in (fast, slow)]
    step = max(s.scale / s.trials for s in samples) / len(samples)  # means lie on a grid
    assert ends[0] == pytest.approx(ends[1], abs=0.05 * slow.std() + 1.01 * step)


def test_a_variant_that_never_varies_is_drawn_as_it_is() -> None:
    drawn = draw([rate(0, 100), rate(100, 100), rate(0, 9, candidates=3)], [1.0, 1.0, 1.0])
    assert drawn == pytest.approx(np.full(10_000, 1.0 - 0.5))


def test_other_tasks_make_the_interval_of_the_paper_three_to_four_times_wider() -> None:
    low, high = 100 * np.percentile(draw_over_tasks(rdt_groups()), [2.5, 97.5])
    assert (low, high) == pytest.approx((4.9, 9.3), abs=0.15)


def test_progress_counts_subtasks() -> None:
    found = progress([(0, 4), (1, 4), (4, 4), (3, 4)])
    assert found.counts == (1, 1, 0, 1, 1)
    assert found.value == pytest.approx(0.5)
    assert progress([(1, 2), (1, 3)]).value == pytest.approx((1 / 2 + 1 / 3) / 2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rate(3, 2), "3 successes in 2 trials is no rate"),
        (lambda: rate(0, 0), "0 successes in 0 trials is no rate"),
        (lambda: rate(1, 2, candidates=1), "chance among 1 candidates is certainty"),
        (lambda: progress([(3, 2)]), "3 of 2 subtasks done is no progress"),
        (lambda: progress([]), "are no counts"),
        (lambda: Sample((1, 1), -1.0), "not positive"),
        (lambda: draw([], []), "one weight for each of at least one sample"),
        (lambda: draw_over_tasks([[]]), "at least one task in every category"),
        (lambda: wilson(0, 0), "0 successes in 0 trials"),
        (lambda: interval_of([rate(1, 2)], method="wald"), "'wald'; there are wilson, exact, boot"),
        (lambda: over_tasks([[rate(1, 2)]], against=[[]] * 2), "the same tasks on both sides"),
        (lambda: paired_difference(3, 3, 4), "3 and 3 discordant of 4 pairs cannot be"),
        (lambda: paired_sample_difference(Sample((1, 1, 1))), "as far below zero as above"),
        (lambda: mcnemar_mid_p(-1, 2), "no counts"),
        (lambda: boschloo(Sample((1, 1, 1)), rate(1, 3)), "progress has none"),
        (lambda: boschloo(rate(1, 5000), rate(2, 5000)), "5000 trials takes too long"),
        (lambda: p_of_interval(Estimate(1.0, 1.0, 2.0)), "without width"),
    ],
)
def test_what_cannot_be_is_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]


# ---------------------------------- tests of differences, against numbers by hand and against SciPy


def test_mcnemar_by_hand() -> None:
    # 5 against 1: (1 + 6) / 64 doubled, less the half of what was seen, doubled: 6 / 64
    assert mcnemar_mid_p(5, 1) == pytest.approx((2 * 7 - 6) / 64)
    assert mcnemar_mid_p(0, 0) == mcnemar_mid_p(4, 4) == 1.0
    assert mcnemar_mid_p(3, 9) == mcnemar_mid_p(9, 3)
    assert mcnemar_mid_p(0, 40) == pytest.approx(2.0**-40, rel=1e-9)


@pytest.mark.parametrize(
    "table", [(20, 33, 100, 100), (0, 1, 1, 1), (3, 3, 10, 10), (9, 3, 30, 12)]
)
def test_boschloo_agrees_with_scipy(table: tuple[int, int, int, int]) -> None:
    from scipy.stats import boschloo_exact

    a, b, n, m = table
    expected = boschloo_exact([[a, b], [n - a, m - b]]).pvalue
    assert boschloo(rate(a, n), rate(b, m)) == pytest.approx(expected, abs=1e-5)


def test_p_of_an_interval_by_hand() -> None:
    assert p_of_interval(Estimate(1.0, 0.0, 2.0)) == pytest.approx(0.05)
    assert p_of_interval(Estimate(-2.0, -3.0, -1.0)) == pytest.approx(0.0000887, abs=1e-6)
    assert p_of_interval(Estimate(0.0, 0.0, 0.0)) == 1.0


def test_p_of_an_interval_is_small_exactly_if_zero_is_outside() -> None:
    for b in range(0, 40):
        found = paired_difference(b, 12, 100)
        assert (p_of_interval(found) < 0.05) == (found.low > 0 or found.high < 0)


def test_benjamini_hochberg_by_hand() -> None:
    assert benjamini_hochberg([0.01, 0.04, 0.03, 0.5]) == pytest.approx(
        [0.04, 0.04 * 4 / 3, 0.04 * 4 / 3, 0.5]
    )
    assert benjamini_hochberg([]) == []


def test_the_best_are_better_than_another_and_worse_than_none() -> None:
    row = [rate(50, 100), rate(48, 100), None, rate(5, 100)]
    assert supported_best([row]) == [frozenset({0, 1})]
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


def ever_below(shift: int, series: int = 400, pairs: int = 120) -> float:
    """Share of series of paired progress (of 4 subtasks; the first does `shift` more, if it can)
    in which the p is below 0.05 at any look, one after every pair."""
    random, found = np.random.default_rng(7), 0
    for _ in range(series):
        seeds = random.integers(-2, 3, pairs)  # what both policies have in common on a seed
        one, two = (np.clip(random.integers(0, 4, pairs) + seeds, 0, 4) for _ in range(2))
        counts = np.zeros((pairs, 9), int)
        counts[np.arange(pairs), np.clip(one + shift, 0, 4) - two + 4] = 1
        looks = map(tuple, counts.cumsum(axis=0).tolist())
        found += any(anytime_p([Sample(look, 0.25, -1.0)]) < 0.05 for look in looks)
    return found / series


def test_who_looks_after_every_pair_is_still_wrong_at_most_once_in_twenty() -> None:
    assert ever_below(0) <= 0.05
    assert ever_below(1) > 0.8
    assert anytime_p([Sample((0, 5, 0))]) == 1.0
    assert anytime_p([Sample((0, 0, 60)), Sample((9, 0, 0, 0, 1), 0.5, -1.0)]) < 1e-6
