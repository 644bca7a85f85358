"""The paper's stratified percentile bootstrap, drawn from exact distributions instead of episodes.

Resampling n episodes of a variant with replacement and adding up their outcomes gives a sum whose
distribution is known: the n-th convolution power of the outcomes' histogram (for 0/1 outcomes the
binomial). So a resample of a variant costs one number instead of n.

What it answers: the same tasks with other seeds. `draw_over_tasks` resamples the tasks as well.
Where all outcomes of a variant are equal its resamples are all equal too, so a percentile interval
there is a point: see `robospa.results.statistics.intervals` for what to print instead."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray


def scale_and_shift(candidates: int) -> tuple[float, float]:
    """ONTA as `shift + scale * rate`; ValueError if there are fewer than two candidates."""
    _check_candidates(candidates)
    return scale_of_chance(1 / candidates)


def scale_of_chance(chance: float) -> tuple[float, float]:
    """A rate as `shift + scale * rate` that is 0 where the rate is `chance`, and 1 at 1."""
    return 1 / (1 - chance), -chance / (1 - chance)


def onta_of_percent(success: float, candidates: int) -> float:
    """ONTA in percent of a success rate in percent, computed as the paper does."""
    _check_candidates(candidates)
    return (success - 100 / candidates) / (1 - 1 / candidates)


def onta_of_bound(rate: float, candidates: int) -> float:
    """ONTA of a bound of a success rate (a fraction): exactly 1 at 1."""
    _check_candidates(candidates)
    return (rate * candidates - 1) / (candidates - 1)


def _check_candidates(candidates: int) -> None:
    if candidates < 2:
        raise ValueError(f"chance among {candidates} candidates is certainty")


RESAMPLES = 10_000
CHUNK = 16
"""Variants drawn at once: keeps the random numbers in the processor's cache."""
GRID = 1 << 16
"""Steps of the tabulated inverse distribution; probabilities are rounded to 1 in 65,536."""


@dataclass(frozen=True)
class Sample:
    """The outcomes of one variant's trials: `counts[c]` trials had outcome c = 0, 1, 2...

    The value of a trial is `shift + scale * c`, that of the variant the mean over its trials.
    """

    counts: tuple[int, ...]
    scale: float = 1.0
    shift: float = 0.0

    def __post_init__(self) -> None:
        if sum(self.counts) < 1 or min(self.counts) < 0 or len(self.counts) < 2:
            raise ValueError(f"{self.counts} are no counts of the outcomes of trials")
        if self.scale <= 0:
            raise ValueError(f"a scale of {self.scale} is not positive")

    @property
    def trials(self) -> int:
        return sum(self.counts)

    @property
    def total(self) -> int:
        """Sum of the outcomes; of 0/1 outcomes the successes."""
        return sum(c * count for c, count in enumerate(self.counts))

    @property
    def value(self) -> float:
        """Mean value of a trial."""
        return self.shift + self.scale * self.total / self.trials

    @property
    def binary(self) -> bool:
        return len(self.counts) == 2

    @property
    def constant(self) -> bool:
        """Whether all outcomes are equal: resampling them changes nothing."""
        return max(self.counts) == self.trials


def rate(successes: int, trials: int, candidates: int = 0) -> Sample:
    """Success rate; with `candidates` its chance-corrected form (ONTA)."""
    if not 0 <= successes <= trials or trials < 1:
        raise ValueError(f"{successes} successes in {trials} trials is no rate")
    if candidates == 0:
        return Sample((trials - successes, successes))
    return Sample((trials - successes, successes), *scale_and_shift(candidates))


def progress(done_of: Iterable[tuple[int, int]]) -> Sample:
    """Progress score of trials that each did `done` of `total` subtasks, as (done, total)."""
    pairs = list(done_of)
    if wrong := [f"{d} of {t}" for d, t in pairs if t < 1 or not 0 <= d <= t]:
        raise ValueError(f"{wrong[0]} subtasks done is no progress")
    steps = math.lcm(*(t for _, t in pairs)) if pairs else 1
    counts = [0] * (steps + 1)
    for done, total in pairs:
        counts[done * steps // total] += 1
    return Sample(tuple(counts), 1 / steps)


@lru_cache(maxsize=2048)
def _chances(counts: tuple[int, ...]) -> NDArray[np.float64]:
    """Probability of every sum of `n` outcomes drawn from the histogram `counts` (n its size)."""
    trials = sum(counts)
    size = trials * (len(counts) - 1) + 1
    spectrum = np.fft.rfft(np.array(counts) / trials, n=size)
    chances: NDArray[np.float64] = np.fft.irfft(spectrum**trials, n=size).clip(min=0.0)
    chances /= chances.sum()
    return chances


@lru_cache(maxsize=1024)
def _deck(counts: tuple[int, ...]) -> NDArray[np.unsignedinteger]:
    """The sum that belongs to each of GRID equally likely random numbers."""
    cumulated = np.rint(np.cumsum(_chances(counts)) * GRID).astype(np.int64)
    cumulated[-1] = GRID
    sums = np.arange(len(cumulated), dtype=np.uint16 if len(cumulated) <= GRID else np.uint32)
    deck: NDArray[np.unsignedinteger] = np.repeat(sums, np.diff(cumulated, prepend=0).clip(min=0))
    return deck


def draw(
    samples: Sequence[Sample],
    weights: Sequence[float],
    seed: int = 0,
    resamples: int = RESAMPLES,
) -> NDArray[np.float64]:
    """Resampled values of the weighted sum of independent `samples`, shape [resamples]."""
    if len(samples) != len(weights) or not samples:
        raise ValueError("a weighted sum needs one weight for each of at least one sample")
    generator = np.random.default_rng(seed)
    drawn = np.full(resamples, sum(w * s.shift for s, w in zip(samples, weights, strict=True)))
    for first in range(0, len(samples), CHUNK):
        group = samples[first : first + CHUNK]
        random = generator.integers(0, GRID, size=(len(group), resamples), dtype=np.uint16)
        for sample, weight, row in zip(group, weights[first : first + CHUNK], random, strict=True):
            step = weight * sample.scale / sample.trials
            if sample.constant:
                drawn += step * sample.total
            else:
                drawn += step * _deck(sample.counts).take(row)
    return drawn


def draw_over_tasks(
    groups: Sequence[Sequence[Sample]],
    seed: int = 0,
    resamples: int = RESAMPLES,
    against: Sequence[Sequence[Sample]] = (),
) -> NDArray[np.float64]:
    """The mean over groups (categories) of the mean over tasks, resampling tasks, then episodes.

    With `against`, of the same tasks, the difference: every resample has the same tasks of both.
    """
    if not groups or not all(groups):
        raise ValueError("resampling tasks needs at least one task in every category")
    if against and [len(g) for g in against] != [len(g) for g in groups]:
        raise ValueError("a difference over tasks needs the same tasks on both sides")
    generator = np.random.default_rng([seed, 1])
    drawn = np.zeros(resamples)
    for number, group in enumerate(groups):
        minus = against[number] if against else ()
        fixed = np.array([_constant_value(sample) for sample in group])
        if minus:
            fixed -= [_constant_value(sample) for sample in minus]
        varying = [
            place
            for place, pair in enumerate(zip(group, minus or group, strict=True))
            if not all(sample.constant for sample in pair)
        ]
        chosen = generator.integers(0, len(group), size=(len(group), resamples))
        for choice in chosen:
            values = fixed.take(choice)
            for place in varying:
                sample = group[place]
                picked = np.flatnonzero(choice == place)
                if not sample.constant:
                    values[picked] += _values(sample, len(picked), generator)
                if minus and not minus[place].constant:
                    values[picked] -= _values(minus[place], len(picked), generator)
            drawn += values / (len(group) * len(groups))
    return drawn


def _constant_value(sample: Sample) -> float:
    """The value of a variant whose trials are all alike, 0 for others."""
    return sample.value if sample.constant else 0.0


def _values(sample: Sample, resamples: int, generator: np.random.Generator) -> NDArray[np.float64]:
    """Resampled values of a variant whose trials are not all alike."""
    random = generator.integers(0, GRID, size=resamples, dtype=np.uint16)
    step = sample.scale / sample.trials
    return np.asarray(sample.shift + step * _deck(sample.counts).take(random), dtype=np.float64)
