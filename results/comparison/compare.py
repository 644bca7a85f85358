"""Two runs, or a run and published numbers, side by side: differences with intervals and tests.

Runs on equal seeds are paired: a trial of one is held against the same scene of the other, which
tells differences apart with far fewer trials. Published numbers and runs on other seeds are
compared as unrelated. Variants that only one side has are left out and counted; nothing is averaged
over them silently. Every difference has an interval, a p, and a q corrected for how many there are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from robospa.results.comparison.groups import collections
from robospa.results.comparison.notes import banner_of, notes, worst_and_best
from robospa.results.comparison.pairs import VariantPair, discordant, paired_variants
from robospa.results.scoring.model_results import ModelResults, categories_of
from robospa.results.scoring.setting import IncomparableError
from robospa.results.scoring.weights import Variant, weights_of
from robospa.results.statistics.intervals import (
    METHODS,
    Estimate,
    difference,
    interval_of,
    over_tasks,
    paired_mean,
)
from robospa.results.statistics.significance import (
    benjamini_hochberg,
    boschloo,
    mcnemar_mid_p,
    p_of_interval,
)
from robospa.trial import METRIC_NAMES

if TYPE_CHECKING:
    from robospa.results.tables import Table


@dataclass(frozen=True)
class Difference:
    """First minus second: of a variant, or the mean over `variants` of the `listed` variants.

    `level` 0 is the mean over levels. `only_first` and `only_second` count the pairs that one
    alone won, None where nothing is paired. `q` is p corrected for all of its kind. `over_tasks`
    is how the difference would move with other tasks, where there are several at one level.
    """

    label: str
    kind: str
    level: int
    variants: int
    listed: int
    trials: int
    first: float
    second: float
    estimate: Estimate
    p: float
    only_first: int | None = None
    only_second: int | None = None
    q: float = 1.0
    over_tasks: Estimate | None = None


@dataclass(frozen=True)
class Comparison:
    """All differences of two sides; `notes` is what a reader has to know before using them, and
    `banner` is not empty where the two are of different suites."""

    first: str
    second: str
    metric: str
    paired: bool
    cells: tuple[Difference, ...]
    groups: tuple[Difference, ...]
    notes: tuple[str, ...]
    banner: str = ""

    def table(self, variants: bool = False) -> Table:
        """The averages, or all `variants`, as a table: `print` shows it as text, a notebook as
        HTML."""
        from robospa.results.comparison.table import difference_table

        title = f"{METRIC_NAMES[self.metric]} of {self.first} minus {self.second}, points"
        return difference_table(self, self.cells if variants else self.groups, title)

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        from html import escape

        said = "<br>".join(escape(text) for text in (self.banner, *self.notes) if text)
        return f"<p>{said}</p>\n{self.table()._repr_html_()}"


def compare(
    first: ModelResults, second: ModelResults, metric: str = "sr", method: str = "wilson"
) -> Comparison:
    """All differences `first - second`; IncomparableError if they are of different things."""
    pairs, paired = paired_variants(first, second, metric)
    if not pairs:
        raise IncomparableError(f"{first.name} and {second.name} have no variant in common")
    category = {**second.categories, **first.categories}
    listed = {
        v for v in {**first.listed, **second.listed} if category[v[0]] in categories_of(metric)
    }
    rows = [_variant_row(pair, method) for pair in pairs]
    groups = _groups(pairs, listed, category, method)
    return Comparison(
        first.name,
        second.name,
        metric,
        paired,
        _corrected(rows),
        _corrected([g for g in groups if g.kind == "category"])
        + tuple(replace(g, q=g.p) for g in groups if g.kind != "category"),
        tuple(notes(first, second, [pair.variant for pair in pairs], listed, paired))
        + (tuple(worst_and_best(first, second, metric)) if metric != "onta" else ()),
        banner_of(first, second),
    )


def over_levels(
    first: ModelResults, second: ModelResults, metric: str = "sr", method: str = "wilson"
) -> tuple[Difference, ...]:
    """The differences of single tasks, each the mean over the levels that both have."""
    category = {**second.categories, **first.categories}
    by_task: dict[str, list[VariantPair]] = {}
    for pair in paired_variants(first, second, metric)[0]:
        by_task.setdefault(pair.variant[0], []).append(pair)
    return _corrected(
        [
            _group_row(task, "task", 0, own, len(own), category, method)
            for task, own in by_task.items()
        ]
    )


def _estimate(pairs: Sequence[VariantPair], weights: Sequence[float], method: str) -> Estimate:
    """Interval of the weighted difference: of the pairs, or of two unrelated sums."""
    gaps = [c.gap for c in pairs if c.gap is not None]
    if len(gaps) < len(pairs):
        a = interval_of([c.first for c in pairs], weights, method)
        return difference(a, interval_of([c.second for c in pairs], weights, method, seed=1))
    if method == "bootstrap":
        return interval_of(gaps, weights, method)
    return paired_mean(gaps, weights)


def _tested(method: str) -> str:
    """The intervals that p-values come from: the bootstrap's can be points."""
    return METHODS[0] if method == "bootstrap" else method


def _variant_row(pair: VariantPair, method: str) -> Difference:
    task, level = pair.variant
    estimate, honest = (_estimate([pair], [1.0], m) for m in (method, _tested(method)))
    rates = pair.first.binary and pair.second.binary
    trials = pair.first.trials if pair.gap else pair.first.trials + pair.second.trials
    row = Difference(
        task, "variant", level, 1, 1, trials, pair.first.value, pair.second.value, estimate, 1.0
    )
    if pair.gap is None:
        p = boschloo(pair.first, pair.second) if rates else p_of_interval(honest)
        return replace(row, p=p)
    b, c = discordant([pair])
    p = mcnemar_mid_p(b, c) if rates else p_of_interval(honest)
    return replace(row, p=p, only_first=b, only_second=c)


def _groups(
    pairs: Sequence[VariantPair], listed: set[Variant], category: Mapping[str, str], method: str
) -> list[Difference]:
    levels = sorted({pair.variant[1] for pair in pairs})
    found = []
    for label, kind, chosen in collections(category):
        for level in (*levels, 0):
            keep = _member(category, chosen, level)
            members = [pair for pair in pairs if keep(pair.variant)]
            if members:
                count = sum(keep(v) for v in listed)
                found.append(_group_row(label, kind, level, members, count, category, method))
    return found


def _group_row(
    label: str,
    kind: str,
    level: int,
    pairs: Sequence[VariantPair],
    listed: int,
    category: Mapping[str, str],
    method: str,
) -> Difference:
    weights = weights_of([c.variant for c in pairs], category)
    first = sum(w * c.first.value for w, c in zip(weights, pairs, strict=True))
    second = sum(w * c.second.value for w, c in zip(weights, pairs, strict=True))
    estimate, honest = (_estimate(pairs, weights, m) for m in (method, _tested(method)))
    paired = pairs[0].gap is not None
    trials = sum(c.first.trials + (0 if paired else c.second.trials) for c in pairs)
    row = (label, kind, level, len(pairs), listed, trials, first, second, estimate)
    other = _over_tasks(pairs, category, honest) if level and len(pairs) > 1 else None
    if not paired:
        return Difference(*row, p_of_interval(honest), over_tasks=other)
    b, c = discordant(pairs)
    # One weight for every trial holds inside a category; above it only the interval is fair.
    pooled = kind in ("task", "category") and all(x.first.binary for x in pairs)
    p = mcnemar_mid_p(b, c) if pooled else p_of_interval(honest)
    return Difference(*row, p, b, c, over_tasks=other)


def _over_tasks(
    pairs: Sequence[VariantPair], category: Mapping[str, str], at_least: Estimate
) -> Estimate:
    """The same difference if tasks were drawn anew from what they were drawn from."""
    groups: dict[str, list[VariantPair]] = {}
    for pair in pairs:
        groups.setdefault(category[pair.variant[0]], []).append(pair)
    gaps = [[c.gap for c in group if c.gap is not None] for group in groups.values()]
    if all(gaps):
        return over_tasks(gaps, at_least=at_least)
    return over_tasks(
        [[c.first for c in group] for group in groups.values()],
        against=[[c.second for c in group] for group in groups.values()],
        at_least=at_least,
    )


def _member(
    category: Mapping[str, str], chosen: Sequence[str], level: int
) -> Callable[[Variant], bool]:
    return lambda v: category.get(v[0]) in chosen and level in (0, v[1])


def _corrected(rows: Sequence[Difference]) -> tuple[Difference, ...]:
    qs = benjamini_hochberg([row.p for row in rows])
    return tuple(replace(row, q=q) for row, q in zip(rows, qs, strict=True))
