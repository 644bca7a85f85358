"""Confidence intervals for success rates and their averages. Fractions, not percent.

Wilson for one rate, MOVER (Zou and Donner 2008) for a weighted sum of independent quantities from
their own limits: both are closed formulas, need no seed and stay honest at 0 and at all of n, where
the bootstrap collapses to a point. Progress is no 0/1 outcome: its mean takes a seeded bootstrap.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Z95 = 1.959963984540054
"""Two-sided 95 % quantile of the normal distribution."""
RESAMPLES = 10_000


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


def wilson(successes: int, trials: int, z: float = Z95) -> Estimate:
    """Rate of `successes` in `trials` with Wilson's interval; ValueError if there are no trials."""
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes in {trials} trials is no rate")
    p, zz = successes / trials, z * z / trials
    centre = (p + zz / 2) / (1 + zz)
    half = z / (1 + zz) * math.sqrt(p * (1 - p) / trials + zz / (4 * trials))
    low = 0.0 if successes == 0 else centre - half
    high = 1.0 if successes == trials else centre + half
    return Estimate(p, low, high)


def mover(parts: Sequence[Estimate], weights: Sequence[float]) -> Estimate:
    """The weighted sum of independent estimates (weights not negative) with its interval."""
    if len(parts) != len(weights) or not parts:
        raise ValueError("MOVER needs one weight for each of at least one estimate")
    value = sum(w * p.value for p, w in zip(parts, weights, strict=True))
    down = sum((w * (p.value - p.low)) ** 2 for p, w in zip(parts, weights, strict=True))
    up = sum((w * (p.high - p.value)) ** 2 for p, w in zip(parts, weights, strict=True))
    return Estimate(value, value - math.sqrt(down), value + math.sqrt(up))


def mean(parts: Sequence[Estimate]) -> Estimate:
    """The unweighted mean of independent estimates."""
    return mover(parts, [1 / len(parts)] * len(parts))


def chance_corrected(rate: Estimate, candidates: int) -> Estimate:
    """ONTA of a success rate among `candidates` objects: 0 at chance 1/n, 1 at certainty."""
    if candidates < 2:
        raise ValueError(f"chance among {candidates} candidates is certainty")
    chance = 1 / candidates

    def rescale(x: float) -> float:
        return (x - chance) / (1 - chance)

    return Estimate(rescale(rate.value), rescale(rate.low), rescale(rate.high))


def bootstrap_mean(
    values: NDArray[np.float64], seed: int = 0, resamples: int = RESAMPLES
) -> Estimate:
    """Mean of `values`, each in 0..1, with the percentile bootstrap over episodes.

    Where all values are 0 (or all 1) the bootstrap knows nothing; then the mean is at most the
    share of values above 0, whose Wilson limit holds (and likewise from above).
    """
    count = len(values)
    if count == 0:
        raise ValueError("a mean needs at least one value")
    value = float(values.mean())
    if np.all(values == 0) or np.all(values == 1):
        return wilson(round(count * value), count)
    generator = np.random.default_rng(seed)
    distinct, counts = np.unique(values, return_counts=True)
    draws = generator.multinomial(count, counts / count, size=resamples) @ distinct / count
    low, high = np.percentile(draws, [2.5, 97.5])
    return Estimate(value, float(low), float(high))
