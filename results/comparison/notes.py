"""Sentences on the limits of a comparison."""

from __future__ import annotations

from collections.abc import Sequence

from robospa.results.comparison.pairs import common_seeds
from robospa.results.paper.origin import banner
from robospa.results.scoring.model_results import ModelResults
from robospa.results.scoring.weights import Variant, weights_of
from robospa.trial import METRIC_CATEGORIES


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
        pairs = {v: len(common_seeds(first, second, v)) for v in common}
        alone = sum(max(first.listed[v], second.listed[v]) - pairs[v] for v in common)
        if alone:
            found.append(f"{alone} listed trials have no result on one of the sides: left out.")
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
    one, two = _versions(first), _versions(second)
    if changed := sorted(n for n in one.keys() & two.keys() if one[n] != two[n]):
        found.append(f"Made by different versions of {', '.join(changed)}.")
    return found


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
    return [
        f"{counts} of the trials that both list: over these the difference is "
        f"{100 * (low - other_high):+.1f} in the worst and {100 * (high - other_low):+.1f} in the "
        f"best case for {first.name}."
    ]


def _bounds(
    model: ModelResults, variants: Sequence[Variant], weights: Sequence[float], metric: str
) -> tuple[float, float]:
    """The mean if every missing trial had achieved nothing, and if every one everything."""
    spans = [model.scores.cells[v].bounds(metric) or (0.0, 1.0) for v in variants]
    low = sum(w * low for w, (low, _) in zip(weights, spans, strict=True))
    return low, sum(w * high for w, (_, high) in zip(weights, spans, strict=True))
