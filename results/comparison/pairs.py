"""The variants that two models have in common, trial by trial where both ran the same seeds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.model_results import ModelResults, check_alike
from robospa.results.scoring.scores import sample_of
from robospa.results.scoring.setting import COMPARISON, IncomparableError
from robospa.results.scoring.weights import Variant
from robospa.results.statistics.bootstrap import Sample


@dataclass(frozen=True)
class VariantPair:
    """A variant of both models; `gap` is the sample of paired differences, None if unpaired."""

    variant: Variant
    first: Sample
    second: Sample
    gap: Sample | None


def check_comparable(first: ModelResults, second: ModelResults) -> None:
    """IncomparableError if one has no results, or the two were asked different things."""
    for one in (first, second):
        if not (one.published or one.trials):
            raise IncomparableError(
                f"{one.name} holds no result yet: finish it with robospa eval --resume"
            )
    check_alike((first, second), COMPARISON)


def common_seeds(first: ModelResults, second: ModelResults, variant: Variant) -> list[int]:
    """Seeds of `variant` that both have a result of, in the order of the first."""
    other = second.trials.get(variant, {})
    return [seed for seed in first.trials.get(variant, {}) if seed in other]


def paired_variants(
    first: ModelResults, second: ModelResults, metric: str
) -> tuple[list[VariantPair], bool]:
    """All variants that both have results of, and whether they are paired: each shares seeds."""
    check_comparable(first, second)
    one, two = first.samples(metric), second.samples(metric)
    common = [variant for variant in one if variant in two]
    if not all(common_seeds(first, second, variant) for variant in common):
        return [VariantPair(v, one[v], two[v], None) for v in common], False
    return [_paired(first, second, variant, metric) for variant in common], True


def _paired(
    first: ModelResults, second: ModelResults, variant: Variant, metric: str
) -> VariantPair:
    task, level = variant
    pairs = []
    for seed in common_seeds(first, second, variant):
        a, b = first.trials[variant][seed], second.trials[variant][seed]
        alike = (a.key.embodiment, a.key.mode) == (b.key.embodiment, b.key.mode)
        if alike and a.scene_digest != b.scene_digest:
            raise IncomparableError(
                f"seed {seed} of {task} L{level} is another scene in {second.name} than in "
                f"{first.name}: they were made by versions with different scenes"
            )
        pairs.append((a, b))
    one, two = (sample_of(side, metric) for side in zip(*pairs, strict=True))
    assert one is not None and two is not None, "parts of samples that exist"
    return VariantPair(variant, one, two, _gap(pairs, metric, one))


def _gap(pairs: Sequence[tuple[TrialRecord, TrialRecord]], metric: str, one: Sample) -> Sample:
    """Sample of the pairs' differences, on the scale of the metric."""
    if metric == "ps":
        top = max(len(one.counts) - 1, 1)
        gaps = [a.done * top // a.total - b.done * top // b.total for a, b in pairs]
    else:
        top, gaps = 1, [int(a.success) - int(b.success) for a, b in pairs]
    counts = [0] * (2 * top + 1)
    for gap in gaps:
        counts[gap + top] += 1
    return Sample(tuple(counts), one.scale, -top * one.scale)


def discordant(pairs: Iterable[VariantPair]) -> tuple[int, int]:
    """How many pairs the first and the second did better in."""
    better = worse = 0
    for pair in pairs:
        if pair.gap is not None:
            middle = len(pair.gap.counts) // 2
            worse += sum(pair.gap.counts[:middle])
            better += sum(pair.gap.counts[middle + 1 :])
    return better, worse
