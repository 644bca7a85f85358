"""Tests of differences: paired, unpaired, from an interval, and what many of them at once allow.

`supported_best` answers the question behind bold type in a table: which models are better than
others, and worse than none. Nothing here needs SciPy, and nothing is random.
"""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from robospa.results.statistics.intervals import Z95, Estimate, difference, interval_of
from robospa.results.statistics.samples import Sample

ALPHA = 0.05
LARGEST = 1000
"""Boschloo's test is a sum over all pairs of counts: more trials than this a side are refused."""


def mcnemar_mid_p(only_first: int, only_second: int) -> float:
    """Two-sided mid-p of McNemar's test: does one of two win more of the trials that only one wins?

    Less conservative than the exact test at nearly the same false alarms. 1 if no pair differs.
    """
    count, fewer = only_first + only_second, min(only_first, only_second)
    if fewer < 0:
        raise ValueError(f"{only_first} and {only_second} are no counts")
    if only_first == only_second:
        return 1.0
    chances = [math.exp(log_choose(count, k) - count * math.log(2)) for k in range(fewer + 1)]
    return min(1.0, 2 * sum(chances) - chances[-1])


def boschloo(first: Sample, second: Sample) -> float:
    """Two-sided p of Boschloo's exact test of two success rates on unrelated seeds.

    Twice the smaller one-sided p, as SciPy counts it. Uniformly more powerful than Fisher's test.
    """
    if not (first.binary and second.binary):
        raise ValueError("Boschloo's test compares success rates; progress has none")
    a, b = first.total, second.total
    n, m = first.trials, second.trials
    if max(n, m) > LARGEST:
        raise ValueError(f"Boschloo's test of {max(n, m)} trials takes too long: use the interval")
    if a * m == b * n:
        return 1.0
    less = _boschloo_less(a, n, b, m) if a * m < b * n else _boschloo_less(b, m, a, n)
    return min(1.0, 2 * less)


def p_of_interval(found: Estimate) -> float:
    """Two-sided p of "the true value is 0" that agrees with the interval: < 0.05 if 0 is outside.

    The distance to the limit on zero's side is taken for 1.96 standard errors.
    """
    reach = found.value - found.low if found.value > 0 else found.high - found.value
    if found.value == 0:
        return 1.0
    if reach <= 0:
        raise ValueError("an interval without width says nothing about chance; use another method")
    return math.erfc(Z95 * abs(found.value) / reach / math.sqrt(2))


BETS = np.array([-0.8, -0.4, -0.2, -0.1, 0.1, 0.2, 0.4, 0.8])
"""Shares of what one has that are bet on a difference of 1."""


def anytime_p(gaps: Sequence[Sample]) -> float:
    """Two-sided p of "no pair differs but by chance", of success or progress, that holds however
    often one looks and stops: below 0.05 ever happens by chance in at most one series of twenty.

    The inverse of what betting on every pair would have won (an e-value); `gaps` are differences of
    pairs, of which those of progress count in parts.
    """
    won = np.zeros(len(BETS))
    for gap in gaps:
        reach = max(1, len(gap.counts) // 2)
        parts = (np.arange(len(gap.counts)) - reach) / reach
        won += np.log1p(np.outer(BETS, parts)) @ np.array(gap.counts)
    top = float(won.max())
    return min(1.0, math.exp(-top) / float(np.mean(np.exp(won - top))))


def benjamini_hochberg(chances: Sequence[float]) -> list[float]:
    """q of each p: at q < 0.05, one in twenty of all that are called different is a false alarm."""
    count, order = len(chances), np.argsort(chances, kind="stable")[::-1]
    scaled = np.array(chances)[order] * count / np.arange(count, 0, -1)
    best = np.minimum(1.0, np.minimum.accumulate(scaled))
    return [float(q) for q in best[np.argsort(order)]]


def holm(chances: Sequence[float]) -> list[float]:
    """Each p corrected by Holm: calling those below 0.05 different, any of them is a false alarm in
    at most one table of twenty."""
    order = np.argsort(chances, kind="stable")
    scaled = np.array(chances)[order] * np.arange(len(chances), 0, -1)
    worst = np.minimum(1.0, np.maximum.accumulate(scaled))
    return [float(p) for p in worst[np.argsort(order)]]


RateOrEstimate = Sample | Estimate | None
"""A cell of a table: outcomes of a variant, an average with its interval, or nothing."""


def supported_best(rows: Sequence[Sequence[RateOrEstimate]]) -> list[frozenset[int]]:
    """For each row of a table, the places of the entries that may be called its best.

    Nothing in the row is better than these, and they are better than something in it: an entry of
    four trials, which cannot be told from any other, is never among them, and a row in which
    nothing can be told apart has none. All comparisons over all rows share Benjamini and Hochberg's
    correction, so pass whole tables. Two success rates take Boschloo's test, anything else the
    interval of the difference of independent estimates. Entries that are None take no part.
    """
    tests: dict[tuple[int, int, int], float] = {}
    for number, row in enumerate(rows):
        known = [(place, entry) for place, entry in enumerate(row) if entry is not None]
        known.sort(key=lambda found: -found[1].value)
        for (high, first), (low, second) in combinations(known, 2):
            tests[number, high, low] = p_of_difference(first, second)
    better: list[set[int]] = [set() for _ in rows]
    worse: list[set[int]] = [set() for _ in rows]
    adjusted = benjamini_hochberg([*tests.values()])
    for (number, high, low), q in zip(tests, adjusted, strict=True):
        if q < ALPHA:
            better[number].add(high)
            worse[number].add(low)
    return [frozenset(one - other) for one, other in zip(better, worse, strict=True)]


def p_of_difference(first: Sample | Estimate, second: Sample | Estimate) -> float:
    """Two-sided p that two independent entries of a table have the same true value."""
    if isinstance(first, Sample) and isinstance(second, Sample) and first.binary and second.binary:
        same = (first.scale, first.shift) == (second.scale, second.shift)
        if same and max(first.trials, second.trials) <= LARGEST:
            return boschloo(first, second)
    a, b = (interval_of([x]) if isinstance(x, Sample) else x for x in (first, second))
    return p_of_interval(difference(a, b))


def at_least(count: int, trials: Mapping[float, int]) -> float:
    """The chance of `count` successes or more, in so many `trials` by each chance of success."""
    whole = np.ones(1)
    for chance, n in trials.items():
        whole = np.convolve(whole, np.diff(-_tables(n, chance, chance, 1)[1][0]))
    return float(min(1.0, whole[count:].sum()))


def log_choose(n: int, k: int) -> float:
    """The logarithm of the number of ways to choose `k` of `n`."""
    if not 0 <= k <= n:
        return -math.inf
    return math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)


@lru_cache(maxsize=4096)
def _boschloo_less(a: int, n: int, b: int, m: int) -> float:
    """One-sided p of "the first rate is smaller": Fisher's p is only the order of the tables.

    For each first count the tables at least as extreme are those from some second count on.
    """
    order = _fisher_less(n, m)
    starts = (order > order[a, b] * (1 + 1e-9)).sum(axis=1)

    def chance(low: float, high: float, steps: int) -> NDArray[np.float64]:
        first, second = _tables(n, low, high, steps)[0], _tables(m, low, high, steps)[1]
        return np.asarray(np.einsum("ra,ra->r", first, second[:, starts]), dtype=np.float64)

    top = int(np.argmax(chance(0.0, 1.0, 201)))
    around = chance(max(0, top - 1) / 200, min(200, top + 1) / 200, 101)
    return float(around.max())


@lru_cache(maxsize=64)
def _fisher_less(n: int, m: int) -> NDArray[np.float64]:
    """Fisher's one-sided p for all counts of `n` and `m` trials, shape [n + 1, m + 1]."""
    first = np.array([log_choose(n, k) for k in range(n + 1)])
    second = np.array([log_choose(m, k) for k in range(m + 1)])
    table = np.zeros((n + 1, m + 1))
    for total in range(n + m + 1):
        a = np.arange(max(0, total - m), min(n, total) + 1)
        weights = np.exp(first[a] + second[total - a] - log_choose(n + m, total))
        table[a, total - a] = np.minimum(1.0, np.cumsum(weights))
    return table


@lru_cache(maxsize=256)
def _tables(
    n: int, low: float, high: float, steps: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """P(count = k) and P(count >= k) of `n` trials for rates from `low` to `high`.

    Shapes [steps, n + 1] and [steps, n + 2]: the last column is 0.
    """
    rates = np.linspace(low, high, steps)[:, None]
    counts = np.arange(n + 1)
    ways = np.array([log_choose(n, k) for k in range(n + 1)])
    with np.errstate(divide="ignore", invalid="ignore"):
        ups = np.where(counts == 0, 0.0, counts * np.log(rates))
        downs = np.where(counts == n, 0.0, (n - counts) * np.log1p(-rates))
    chances = np.asarray(np.exp(ways + ups + downs), dtype=np.float64)
    tails = np.zeros((steps, n + 2))
    tails[:, :-1] = chances[:, ::-1].cumsum(axis=1)[:, ::-1]
    return chances, tails
