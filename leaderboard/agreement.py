"""Do fresh trials agree with claimed ones? Exact tests, of everything that can be ranked.

If a variant's claimed and fresh trials have one success rate, then, given how many of them all
succeeded, the number of fresh successes is hypergeometric: Fisher's exact test. The sum over
variants, whose rates may all differ, is the convolution of these distributions, computed in full.
The whole is tested, and every cell that a table can be sorted by, corrected after Holm: a lie about
one variant of 280 is lost in the whole.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from robospa.results.statistics.significance import holm, log_choose
from robospa.trial import CATEGORIES, DIMENSIONS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Counts:
    """One variant: successes and trials, as claimed and afresh."""

    claimed: int
    claimed_trials: int
    fresh: int
    fresh_trials: int


@dataclass(frozen=True)
class Agreement:
    """Exact chances, if both had the same rates, of at most (`lower`) and at least (`upper`) as
    many fresh successes as there were; `p` is two-sided, twice the smaller one."""

    fresh: int
    expected: float
    lower: float
    upper: float

    @property
    def p(self) -> float:
        return min(1.0, 2 * min(self.lower, self.upper))


def agreement(variants: Iterable[Counts]) -> Agreement:
    """The exact test over `variants`."""
    found = list(variants)
    chances = np.ones(1)
    for counts in found:
        given = counts.claimed + counts.fresh
        own = _hypergeometric(given, counts.claimed_trials, counts.fresh_trials)
        chances = np.convolve(chances, own)
    fresh = sum(counts.fresh for counts in found)
    expected = float(chances @ np.arange(len(chances)))
    lower, upper = float(chances[: fresh + 1].sum()), float(chances[fresh:].sum())
    return Agreement(fresh, expected, min(1.0, lower), min(1.0, upper))


@cache
def _hypergeometric(successes: int, claimed: int, fresh: int) -> Array:
    """Chance of 0, 1, ... fresh successes, given all `successes` of so many trials."""
    total = log_choose(claimed + fresh, successes)
    return np.array(
        [
            math.exp(log_choose(fresh, k) + log_choose(claimed, successes - k) - total)
            for k in range(fresh + 1)
        ]
    )


def cells(variants: Iterable[str], categories: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """The `variants` ("TASK/LEVEL") behind every value of a table, by "ROW/LEVEL", level 0 being
    all. `categories` are those of the tasks."""
    found: dict[str, list[str]] = {}
    there, means = set(categories.values()), {"overall": CATEGORIES, **DIMENSIONS}
    whole = {row: of for row, of in means.items() if there.issuperset(of)}
    for variant in variants:
        task, _, level = variant.rpartition("/")
        own = categories[task]
        for row in (*(row for row, of in whole.items() if own in of), own, task):
            for place in (f"{row}/0", f"{row}/{level}"):
                found.setdefault(place, []).append(variant)
    return {place: tuple(own) for place, own in found.items()}


def contradictions(
    metrics: Mapping[str, Mapping[str, Counts]], categories: Mapping[str, str], alpha: float
) -> dict[str, float]:
    """What contradicts the claim at the level `alpha`, with its p: by metric the whole, and every
    cell, after Holm's correction over all of them. `metrics` have counts by variant."""
    found: dict[str, float] = {}
    parts: dict[str, float] = {}
    for metric, counts in metrics.items():
        found[f"{metric} of everything"] = agreement(counts.values()).p
        for own, place in {own: place for place, own in cells(counts, categories).items()}.items():
            parts[f"{metric} of {place}"] = agreement(counts[v] for v in own).p
    found |= dict(zip(parts, holm(list(parts.values())), strict=True))
    return {name: p for name, p in found.items() if p < alpha}


LIE = 0.05
"""How much higher claimed rates than the true ones, everywhere, have to be noticed."""
CELL_LIE = 0.2
"""The same in one cell alone, for a rank in it."""
LEAST_POWER = 0.95
"""The chance of that without which there is no badge, and no rank."""
MOST_TRIALS = 1000
"""More hidden trials of a variant than this are never asked for."""


def trials_needed(claims: Sequence[Counts], alpha: float, lie: float = LIE) -> int | None:
    """How many fresh trials of every variant notice a `lie` with LEAST_POWER; None if no number up
    to MOST_TRIALS does, because the claims themselves rest on too few. Of `claims` only what is
    claimed counts."""
    counts = range(1, MOST_TRIALS + 1)
    count = next(
        (n for n in counts if _likely(claims, n, alpha, lie) > LEAST_POWER), len(counts) + 1
    )
    while count <= MOST_TRIALS:  # the normal approximation may be off by a few
        planned = [replace(c, fresh=0, fresh_trials=count) for c in claims]
        if power(planned, lie, alpha) >= LEAST_POWER:
            return count
        count += max(1, count // 20)
    return None


def _likely(claims: Sequence[Counts], count: int, alpha: float, lie: float) -> float:
    """`power` for a `lie` with `count` fresh trials of every variant, by normal approximation."""
    n = float(count)
    claimed, trials = np.array([(c.claimed, c.claimed_trials) for c in claims], float).T
    true = np.maximum(0.0, claimed / trials - lie)
    shift = float((n * trials / (n + trials) * (claimed / trials - true)).sum())
    together, total = claimed + n * true, trials + n
    null = n * trials * together * (total - together) / (total**2 * (total - 1))
    spread = (trials / total) ** 2 * n * true * (1 - true)
    beyond = shift - NormalDist().inv_cdf(1 - alpha / 2) * math.sqrt(null.sum())
    return NormalDist().cdf(beyond / max(math.sqrt(spread.sum()), 1e-9))


def power(
    variants: Sequence[Counts], drop: float, alpha: float, draws: int = 400, seed: int = 0
) -> float:
    """How often the test at level `alpha` notices that every rate is lower by `drop` (a fraction)
    than claimed, or zero; by simulation with a fixed seed."""
    random = np.random.default_rng(seed)
    noticed = 0
    rates = [max(0.0, c.claimed / c.claimed_trials - drop) for c in variants]
    for _ in range(draws):
        again = [
            Counts(c.claimed, c.claimed_trials, int(random.binomial(c.fresh_trials, r)),
                   c.fresh_trials)
            for c, r in zip(variants, rates, strict=True)
        ]  # fmt: skip
        noticed += agreement(again).p < alpha
    return noticed / draws
