"""One policy on several robots, in several scene modes, on several kinds of sentences, or under
several clocks.

A table with a column for each, and the differences to the first, paired by task, level and seed.
"""

from __future__ import annotations

from collections.abc import Sequence

from robospa.results.comparison.groups import collections
from robospa.results.comparison.pairs import VariantPair, paired_variants
from robospa.results.scoring.model_results import FREE, ModelResults, one_policy
from robospa.results.scoring.weights import Variant, weights_of
from robospa.results.statistics.intervals import (
    Estimate,
    difference,
    interval_of,
    paired_mean,
)
from robospa.results.tables import Table, TableCell, TableRow

AXES = {
    "embodiment": "robots",
    "mode": "scene modes",
    "split": "instruction splits",
    "clock": "clocks",
}
"""What the parts of a setting are called in the title."""


def by_axis(models: Sequence[ModelResults], metric: str = "sr") -> Table | None:
    """The table of runs that differ in robot, scene mode, split or clock; None if these are none.

    Rows are categories, dimensions and the whole, over all variants that every run has results of.
    """
    axes = [part for part in FREE if len({getattr(m.setting, part) for m in models}) > 1]
    if len(models) < 2 or not axes or not one_policy(models):
        return None
    samples = [model.samples(metric) for model in models]
    shared = [v for v in samples[0] if all(v in other for other in samples[1:])]
    if not shared:
        return None
    names = [" ".join(value for part in axes for value in getattr(m.setting, part)) for m in models]
    pairs = [
        {pair.variant: pair for pair in paired_variants(model, models[0], metric)[0]}
        for model in models[1:]
    ]
    category = {name: c for model in models for name, c in model.categories.items()}
    rows = []
    for label, kind, chosen in collections(category):
        variants = [v for v in shared if category[v[0]] in chosen]
        if variants:
            weights = weights_of(variants, category)
            own = [interval_of([s[v] for v in variants], weights) for s in samples]
            gaps = [_gap([found[v] for v in variants], weights) for found in pairs]
            cells = (*map(_cell, own), *(_cell(gap, signed=True) for gap in gaps))
            rows.append(TableRow(label, cells, "row" if kind == "category" else "average"))
    paired = all(pair.gap is not None for found in pairs for pair in found.values())
    return Table(
        f"{metric}-by-{'-'.join(axes)}",
        f"{metric.upper()} by {' and '.join(AXES[part] for part in axes)}",
        "",
        (*names, *(f"{name} minus {names[0]}" for name in names[1:])),
        tuple(rows),
        notes=(_note(shared, paired),),
    )


def _gap(pairs: Sequence[VariantPair], weights: Sequence[float]) -> Estimate:
    """The weighted difference: of pairs of trials, or of unrelated samples."""
    gaps = [pair.gap for pair in pairs if pair.gap is not None]
    if len(gaps) == len(pairs):
        return paired_mean(gaps, weights)
    first, second = ([getattr(pair, side) for pair in pairs] for side in ("first", "second"))
    return difference(interval_of(first, weights), interval_of(second, weights))


def _cell(estimate: Estimate, signed: bool = False) -> TableCell:
    value, low, high = (100.0 * v for v in (estimate.value, estimate.low, estimate.high))
    style = "+.1f" if signed else ".1f"
    text = f"{value:{style}} [{low:{style}}, {high:{style}}]"
    return TableCell(text, value, low, high)


def _note(shared: Sequence[Variant], paired: bool) -> str:
    how = "paired by seed" if paired else "not paired: some variants share no seed"
    return (
        f"In percent, over the {len(shared)} variants that all have results of, with 95 % "
        f"intervals; differences in percentage points, {how}."
    )
