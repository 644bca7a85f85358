"""The variants that two models have in common, trial by trial where both ran the same seeds."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robospa.results.paper.origin import banner
from robospa.results.paper.rounding import shown
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.models import COMPARISON, IncomparableError, ModelResults, check_alike
from robospa.results.scoring.scores import Variant, sample_of, succeeded, weights_of
from robospa.results.statistics.samples import Sample
from robospa.text import counted
from robospa.trial import METRIC_CATEGORIES


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
    if metric == "ps":
        top = max(len(one.counts) - 1, 1)
        gaps = [a.done * top // a.total - b.done * top // b.total for a, b in pairs]
    else:
        top, gaps = 1, [succeeded(a, metric) - succeeded(b, metric) for a, b in pairs]
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


def banner_of(first: ModelResults, second: ModelResults) -> str:
    """What to know of a run against a published model, or of two under different clocks; empty for
    two of a kind."""
    sides = (first, second)
    names = [side.name for side in sides if side.published]
    runs = [side for side in sides if not side.published]
    if len(names) == 1:
        return banner(names, runs)
    clocks = [side.setting.clock for side in sides]
    if clocks[0] == clocks[1] or names:
        return ""
    one, two = (", ".join(clock) for clock in clocks)
    return (
        f"Latency comparison: {first.name} ran on the clock {one}, {second.name} on {two}. The "
        "difference is that of policies and of what their thinking costs; it ranks neither."
    )


def notes(
    first: ModelResults,
    second: ModelResults,
    common: Sequence[Variant],
    listed: set[Variant],
    paired: bool,
) -> list[str]:
    """The limits of the comparison."""
    found = []
    for what, ours, theirs in (
        ("robots", first.setting.embodiment, second.setting.embodiment),
        ("scene modes", first.setting.mode, second.setting.mode),
        ("instruction splits", first.setting.split, second.setting.split),
    ):
        if ours and theirs and ours != theirs:
            found.append(
                f"Different {what}: {', '.join(ours)} and {', '.join(theirs)}, with the same "
                "objects in the scenes of one seed."
            )
    if paired:
        found.append("Paired: trials on the same seeds are held against each other.")
        alone = sum(len(first.trials[v].keys() ^ second.trials[v].keys()) for v in common)
        if alone:
            found.append(f"{counted(alone, 'trial')} with a result on one side alone: left out.")
        blind = [side.name for side in (first, second) if side.manifest.policy.seeded is False]
        if blind:
            found.append(
                f"{' and '.join(blind)} ignores the policy seed: another run may differ, so the "
                "pairs tell less than the intervals say."
            )
    else:
        found.append("Unpaired: the sides share no seeds, so every difference needs more trials.")
    if len(common) < len(listed):
        found.append(
            f"Only {len(common)} of {len(listed)} variants are in both: means are of those."
        )
    for side in (first, second):
        for scale in side.setting.step_scale:
            if scale != 1 and first.setting.step_scale != second.setting.step_scale:
                found.append(f"{side.name} ran with {scale:g} times the official step limits.")
    mine, other, unknown = _contract(first), _contract(second), "not stated"
    if apart := [n for n in sorted(mine | other) if mine.get(n) != other.get(n)]:
        texts = (f"{n} ({mine.get(n, unknown)}, {other.get(n, unknown)})" for n in apart)
        found.append(f"The policies declare different contracts: {', '.join(texts)}.")
    one, two = _versions(first), _versions(second)
    if changed := sorted(n for n in one.keys() & two.keys() if one[n] != two[n]):
        found.append(f"Made by different versions of {', '.join(changed)}.")
    return found


def _contract(model: ModelResults) -> dict[str, str]:
    """What the policies of a run declare beside their weights, by name."""
    stated = () if model.published else model.manifest.settings.stated
    parts = sorted({p for spec in stated for p in spec.contract})
    return {name: text for name, _, text in (part.partition("=") for part in parts)}


def _versions(model: ModelResults) -> dict[str, object]:
    about = model.manifest.about
    return {} if model.published else {**about.versions, "code": about.code}


def worst_and_best(first: ModelResults, second: ModelResults, metric: str) -> list[str]:
    """Bounds of the mean difference over all variants that both list, if trials are missing."""
    category = {**second.categories, **first.categories}
    both = [
        v
        for v in first.listed
        if v in second.listed and category[v[0]] in METRIC_CATEGORIES[metric]
    ]
    models = (first, second)
    missing = [sum(model.scores.cells[v].missing for v in both) for model in models]
    if not any(missing):
        return []
    weights = weights_of(both, category)
    (low, high), (other_low, other_high) = (_bounds(m, both, weights, metric) for m in models)
    counts = " and ".join(
        f"{model.name} lacks {n}" for model, n in zip(models, missing, strict=True) if n
    )
    worst, best = (shown(100 * gap) for gap in (low - other_high, high - other_low))
    return [
        f"{counts} of the trials that both list: over these the difference is {worst:+.1f} in the "
        f"worst and {best:+.1f} in the best case for {first.name}."
    ]


def _bounds(
    model: ModelResults, variants: Sequence[Variant], weights: Sequence[float], metric: str
) -> tuple[float, float]:
    spans = [model.scores.cells[v].bounds(metric) or (0.0, 1.0) for v in variants]
    low = sum(w * low for w, (low, _) in zip(weights, spans, strict=True))
    return low, sum(w * high for w, (_, high) in zip(weights, spans, strict=True))
