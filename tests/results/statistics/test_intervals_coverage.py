"""How often nominal 95 % intervals hold the truth, by enumeration or seeded simulation.

The bar is 93 to 97 %. Two corners miss it and are held here as they are, so that nobody claims
more: averages of rates that are all near 1 %, and bootstrapped progress that is rare and uneven.
Intervals of small or equal differences may cover more.
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np
import pytest

from robospa.results.statistics.intervals import (
    Estimate,
    difference,
    interval_of,
    mean,
    paired_difference,
    wilson,
)
from robospa.results.statistics.samples import Sample, rate

TRIALS = 100
NOISE = 0.011
"""Two standard errors of a coverage of 95 % found in 1,500 simulations."""


@cache
def cell(successes: int, method: str, candidates: int = 0) -> Estimate:
    return interval_of([rate(successes, TRIALS, candidates)], method=method)


def holds(found: Estimate, truth: float) -> bool:
    return found.low - 1e-12 <= truth <= found.high + 1e-12


def exact_coverage(p: float, method: str) -> float:
    """No simulation: all 101 outcomes, weighted by how likely they are."""
    found = 0.0
    for k in range(TRIALS + 1):
        if holds(cell(k, method), p):
            found += comb(TRIALS, k) * p**k * (1 - p) ** (TRIALS - k)
    return found


@pytest.mark.parametrize(
    ("method", "low", "high", "worst"),
    [("wilson", 0.94, 0.96, 0.92), ("exact", 0.95, 0.98, 0.95), ("jeffreys", 0.94, 0.96, 0.88)],
)
def test_a_single_rate(method: str, low: float, high: float, worst: float) -> None:
    found = [exact_coverage(p, method) for p in np.linspace(0.01, 0.99, 99)]
    assert low <= float(np.mean(found)) <= high
    assert min(found) >= worst


def test_the_papers_bootstrap_fails_at_rare_successes() -> None:
    assert exact_coverage(0.01, "bootstrap") < 0.7


def average_coverage(rates: list[float], candidates: list[int] | None = None) -> float:
    counts = candidates or [0] * len(rates)
    chances = [1 / n if n else 0.0 for n in counts]
    truth = float(np.mean([(p - c) / (1 - c) for p, c in zip(rates, chances, strict=True)]))
    draws = np.random.default_rng(0).binomial(TRIALS, rates, size=(1500, len(rates)))
    hits = 0
    for row in draws:
        parts = [cell(int(k), "wilson", n) for k, n in zip(row, counts, strict=True)]
        hits += holds(mean(parts), truth)
    return hits / len(draws)


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
    assert 0.93 - NOISE <= average_coverage(rates) <= 0.97 + NOISE


def test_an_average_of_onta() -> None:
    assert 0.93 - NOISE <= average_coverage([0.3, 0.4, 0.2, 0.5], [2, 3, 4, 6]) <= 0.97 + NOISE


def test_a_category_at_one_percent_is_covered_less() -> None:
    assert 0.87 <= average_coverage([0.01] * 5) <= 0.93


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


def test_rare_and_uneven_progress_is_covered_less() -> None:
    assert progress_coverage([0.9, 0.05, 0.02, 0.01, 0.01, 0.01], 1) >= 0.89


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


def test_a_coverage_is_the_same_every_time() -> None:
    assert average_coverage([0.1, 0.3]) == average_coverage([0.1, 0.3])
