"""Confidence intervals for rates, progress, their averages and differences. Fractions, not percent.

Wilson for one rate, MOVER (Zou and Donner 2008) for a weighted sum of independent quantities from
their own limits: both are closed formulas, need no seed and stay honest at 0 and at all of n, where
the bootstrap collapses to a point. Progress is no 0/1 outcome: its mean takes a seeded bootstrap,
with the limit of a rate where no episode differs from another.
Every `Estimate` names the method that made it. Exact intervals need SciPy.

Except for `over_tasks`, all of them answer: the same tasks with other seeds.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from robospa.results.statistics.samples import Sample, draw, draw_over_tasks, scale_and_shift

Z95 = 1.959963984540054
"""Two-sided 95 % quantile of the normal distribution."""
LEVEL = 0.95
METHODS = ("wilson", "exact", "bootstrap")
"""Methods for the interval of a rate (`--ci`); the first is the default."""


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval and, in words, how the interval was made."""

    value: float
    low: float
    high: float
    method: str = ""


def wilson(successes: float, trials: float) -> Estimate:
    """Rate of `successes` in `trials` with Wilson's interval; ValueError if there are no trials."""
    _check(successes, trials)
    p, zz = successes / trials, Z95 * Z95 / trials
    centre = (p + zz / 2) / (1 + zz)
    half = Z95 / (1 + zz) * math.sqrt(p * (1 - p) / trials + zz / (4 * trials))
    low = 0.0 if successes == 0 else max(0.0, centre - half)
    high = 1.0 if successes == trials else min(1.0, centre + half)
    return Estimate(p, low, high, "Wilson")


def clustered(trials: Sequence[tuple[int, int]]) -> Estimate | None:
    """Rate of things that come several to a trial, as (good, all) a trial; None if there are none.

    Wilson's interval for as many independent things as tell as much: what a trial has in common
    makes them fewer, and where all are alike they are as many as the trials.
    """
    trials = [one for one in trials if one[1]]
    good, count = (sum(one[i] for one in trials) for i in (0, 1))
    if not count:
        return None
    rate = good / count
    if good in (0, count):
        worth = float(len(trials))
    else:
        spread = sum((k - rate * n) ** 2 for k, n in trials) / (count * rate * (1 - rate))
        worth = count / max(1.0, spread * len(trials) / max(1, len(trials) - 1))
    found = wilson(rate * worth, worth)
    return replace(found, value=rate, method="Wilson" if worth == count else "Wilson, by trials")


def exact(successes: int, trials: int) -> Estimate:
    """Rate with the interval of Clopper and Pearson: covers at least 95 %, often more."""
    from scipy.special import betaincinv

    _check(successes, trials)
    k, n, tail = successes, trials, (1 - LEVEL) / 2
    low = 0.0 if k == 0 else float(betaincinv(k, n - k + 1, tail))
    high = 1.0 if k == n else float(betaincinv(k + 1, n - k, 1 - tail))
    return Estimate(k / n, low, high, "exact")


def bounded_mean(value: float, trials: int) -> Estimate:
    """Interval of a mean of numbers in 0..1 of which only the mean is known (a printed PS).

    No such numbers vary more than 0/1 outcomes of that mean, so Wilson's limits are wide enough.
    """
    return replace(wilson(value * trials, trials), method="Wilson, at most as wide as needed")


def mover(parts: Sequence[Estimate], weights: Sequence[float]) -> Estimate:
    """The weighted sum of independent estimates (weights not negative) with its interval."""
    if len(parts) != len(weights) or not parts:
        raise ValueError("MOVER needs one weight for each of at least one estimate")
    if min(weights) < 0:
        raise ValueError("MOVER takes no negative weight; a difference has its own function")
    value = sum(w * p.value for p, w in zip(parts, weights, strict=True))
    down = sum((w * (p.value - p.low)) ** 2 for p, w in zip(parts, weights, strict=True))
    up = sum((w * (p.high - p.value)) ** 2 for p, w in zip(parts, weights, strict=True))
    name = parts[0].method if len(parts) == 1 and weights[0] == 1 else mover_name(parts)
    return Estimate(value, value - math.sqrt(down), value + math.sqrt(up), name)


def mover_name(parts: Sequence[Estimate]) -> str:
    """`MOVER on Wilson`, from the methods of what it was made of."""
    names = {p.method.removeprefix("MOVER on ").partition(",")[0] for p in parts}
    return "MOVER on " + " and ".join(sorted(names)) if any(names) else "MOVER"


def mean(parts: Sequence[Estimate]) -> Estimate:
    """The unweighted mean of independent estimates."""
    return mover(parts, [1 / len(parts)] * len(parts))


def chance_corrected(rate: Estimate, candidates: int) -> Estimate:
    """ONTA of a success rate among `candidates` objects: 0 at chance 1/n, 1 at certainty."""
    return rescaled(rate, *scale_and_shift(candidates))


def difference(first: Estimate, second: Estimate) -> Estimate:
    """`first - second` of independent estimates; of two Wilson intervals it is Newcombe's."""
    value = first.value - second.value
    down = math.hypot(first.value - first.low, second.high - second.value)
    up = math.hypot(first.high - first.value, second.value - second.low)
    return Estimate(value, value - down, value + up, mover_name([first, second]))


def paired_difference(only_first: int, only_second: int, trials: int) -> Estimate:
    """Rate of the first minus rate of the second on the same seeds: Tango's score interval.

    Of `trials` pairs, `only_first` succeeded for the first alone, `only_second` for the second
    alone. Excludes 0 exactly where McNemar's score test does, and is no point if all pairs agree.
    """
    b, c, n = only_first, only_second, trials
    if n < 1 or min(b, c) < 0 or b + c > n:
        raise ValueError(f"{b} and {c} discordant of {n} pairs cannot be")

    def score(d: float) -> float:
        # Maximum likelihood of the second discordant rate, given that the difference is d.
        linear, constant = -b - c + (2 * n - b + c) * d, -c * d * (1 - d)
        root = math.sqrt(max(0.0, linear * linear - 8 * n * constant))
        spread = n * (2 * max(0.0, root - linear) / (4 * n) + d * (1 - d))
        return (b - c - n * d) / math.sqrt(spread) if spread > 0 else math.copysign(1e9, b - c - d)

    value = (b - c) / n
    low = -1.0 if b - c == -n else _root(lambda d: score(d) - Z95, -1.0, value)
    high = 1.0 if b - c == n else _root(lambda d: score(d) + Z95, value, 1.0)
    return Estimate(value, low, high, "Tango")


@lru_cache(maxsize=4096)
def paired_sample_difference(gaps: Sample) -> Estimate:
    """Mean of the differences of pairs: `gaps` has as many outcomes below 0 as above.

    Tango's interval for success rates, the bootstrap for progress. Where all pairs differ alike,
    the interval is that of `_alike`, which of success rates is Tango's.
    """
    reach = (len(gaps.counts) - 1) // 2
    if gaps.shift != -reach * gaps.scale:
        raise ValueError("differences of pairs reach as far below zero as above")
    if reach > 1 and not gaps.constant:
        return _percentile(gaps.value, draw([gaps], [1.0]), "bootstrap")
    if reach > 1:
        return replace(_alike(gaps, METHODS[0]), method="Tango, as for equals")
    found = paired_difference(gaps.counts[-1], gaps.counts[0], gaps.trials)
    return rescaled(found, reach * gaps.scale, 0.0)


def paired_mean(gaps: Sequence[Sample], weights: Sequence[float]) -> Estimate:
    """The weighted sum of the differences of pairs, as `paired_sample_difference` has them."""
    return mover([paired_sample_difference(gap) for gap in gaps], weights)


def interval_of(
    samples: Sequence[Sample],
    weights: Sequence[float] | None = None,
    method: str = METHODS[0],
    seed: int = 0,
) -> Estimate:
    """The weighted sum of `samples` (default: their mean) with the interval that `method` makes.

    One sample is a variant; an average over tasks and categories is the flat list of its variants,
    each weighted by 1 / (categories x tasks in its category). `bootstrap` is the paper's; the
    others are MOVER on the limits of the single rates, with progress always bootstrapped.
    """
    if method not in METHODS:
        raise ValueError(f"no interval is called {method!r}; there are {', '.join(METHODS)}")
    shares = [1 / len(samples)] * len(samples) if weights is None else list(weights)
    if method == "bootstrap":
        value = sum(w * s.value for s, w in zip(samples, shares, strict=True))
        name = "bootstrap" if len(samples) == 1 else "stratified bootstrap"
        return _percentile(value, draw(samples, shares, seed), name)
    cells = [_cell(s, method, seed + n) for n, s in enumerate(samples)]
    return mover(cells, shares)


def over_tasks(
    groups: Sequence[Sequence[Sample]],
    seed: int = 0,
    against: Sequence[Sequence[Sample]] = (),
    at_least: Estimate | None = None,
) -> Estimate:
    """Mean over `groups` (categories) of the mean over tasks, as it would move with other tasks.

    With `against`, the difference of both on the same tasks. It moves no less than with other seeds
    alone: `at_least` is that interval (without `against` by default MOVER's), so that tasks which
    are all at 0 do not give a point.
    """

    def mean_of(side: Sequence[Sequence[Sample]]) -> float:
        return sum(sum(s.value for s in group) / len(group) for group in side) / len(side)

    draws = draw_over_tasks(groups, seed, against=against)
    value = mean_of(groups) - (mean_of(against) if against else 0.0)
    found = _percentile(value, draws, "bootstrap over tasks")
    if at_least is None and not against:
        shares = [1 / (len(groups) * len(group)) for group in groups for _ in group]
        at_least = interval_of([s for group in groups for s in group], shares)
    if at_least is None:
        return found
    return replace(found, low=min(found.low, at_least.low), high=max(found.high, at_least.high))


_RATES: dict[str, Callable[[int, int], Estimate]] = {"wilson": wilson, "exact": exact}


def _cell(sample: Sample, method: str, seed: int) -> Estimate:
    """One variant. Progress that never varies is bounded by how often it may be another."""
    if sample.binary:
        return rescaled(_RATES[method](sample.total, sample.trials), sample.scale, sample.shift)
    if sample.constant:
        return _alike(sample, method)
    return _percentile(sample.value, draw([sample], [1.0], seed), "bootstrap")


def _alike(sample: Sample, method: str) -> Estimate:
    """Trials of one outcome: others are no more frequent than what so many may never show, and at
    worst the least or the most that there is."""
    others, value = _RATES[method](0, sample.trials), sample.value
    least, most = (sample.shift + sample.scale * c for c in (0, len(sample.counts) - 1))
    ends = value - others.high * (value - least), value + others.high * (most - value)
    return Estimate(value, *ends, f"bootstrap, {others.method} where all are equal")


def rescaled(estimate: Estimate, scale: float, shift: float) -> Estimate:
    """`shift + scale * estimate`."""
    value, low, high = (shift + scale * x for x in (estimate.value, estimate.low, estimate.high))
    return Estimate(value, low, high, estimate.method)


def _percentile(value: float, draws: NDArray[np.float64], method: str) -> Estimate:
    tail = 50 * (1 - LEVEL)
    low, high = np.percentile(draws, [tail, 100 - tail])
    return Estimate(value, float(low), float(high), method)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) > 0 else (low, middle)
    return (low + high) / 2


def _check(successes: float, trials: float) -> None:
    if trials <= 0 or not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes in {trials} trials is no rate")
