"""Two runs, or a run and published numbers, side by side: differences with intervals and tests.

Runs on equal seeds are paired: a trial of one is held against the same scene of the other, which
tells differences apart with far fewer trials. Published numbers and runs on other seeds are
compared as unrelated. Variants that only one side has are left out and counted; nothing is averaged
over them silently. Every difference has an interval, a p, and a q corrected for how many there are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from robospa.categories import CATEGORIES
from robospa.results.comparison.operands import (
    COMPARED,
    CompareError,
    Side,
    Variant,
    check_settings,
    collections,
    common_seeds,
    extremes,
    sample_of,
    weights_of,
)
from robospa.results.records.trial_record import TrialRecord
from robospa.results.statistics.bootstrap import Sample
from robospa.results.statistics.intervals import (
    METHODS,
    Estimate,
    difference,
    interval_of,
    mover,
    over_tasks,
    paired_sample_difference,
)
from robospa.results.statistics.sequential import Verdict, decide
from robospa.results.statistics.significance import (
    benjamini_hochberg,
    boschloo,
    mcnemar_mid_p,
    p_of_interval,
)


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
    """All differences of two sides; `notes` is what a reader has to know before using them."""

    first: str
    second: str
    metric: str
    paired: bool
    cells: tuple[Difference, ...]
    groups: tuple[Difference, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Cell:
    """A variant of both sides; `gap` is the sample of paired differences, if any."""

    variant: Variant
    first: Sample
    second: Sample
    gap: Sample | None


def compare(first: Side, second: Side, metric: str = "sr", method: str = "wilson") -> Comparison:
    """All differences `first - second`; raises CompareError if they are of different things."""
    check_settings(first, second)
    common = [v for v in first.samples if v in second.samples]
    if not common:
        raise CompareError(f"{first.name} and {second.name} have no variant in common")
    paired = all(common_seeds(first, second, v) for v in common)
    cells = [_cell(first, second, v, metric, paired) for v in common]
    category = {**second.category, **first.category}
    wanted = {
        v for v in {**first.listed, **second.listed} if category.get(v[0]) in COMPARED[metric]
    }
    rows = [_variant_row(cell, method) for cell in cells]
    groups = _groups(cells, wanted, category, method)
    return Comparison(
        first.name,
        second.name,
        metric,
        paired,
        _corrected(rows),
        _corrected([g for g in groups if g.kind == "category"])
        + tuple(replace(g, q=g.p) for g in groups if g.kind != "category"),
        tuple(_notes(first, second, common, wanted, paired))
        + (tuple(_worst_and_best(first, second, category)) if metric != "onta" else ()),
    )


def over_levels(
    first: Side, second: Side, metric: str = "sr", method: str = "wilson"
) -> tuple[Difference, ...]:
    """The differences of single tasks, each the mean over the levels that both sides have."""
    check_settings(first, second)
    common = [v for v in first.samples if v in second.samples]
    paired = all(common_seeds(first, second, v) for v in common)
    category = {**second.category, **first.category}
    cells: dict[str, list[_Cell]] = {}
    for variant in common:
        cell = _cell(first, second, variant, metric, paired)
        cells.setdefault(variant[0], []).append(cell)
    return _corrected(
        [
            _group_row(task, "task", 0, own, len(own), category, method)
            for task, own in cells.items()
        ]
    )


def stop_early(first: Side, second: Side) -> Verdict:
    """Who wins by the paired e-value over all variants.

    Pairs are taken in an order fixed by the list of trials: one of each variant, then the next of
    each, so that no category is heard alone before the others.
    """
    check_settings(first, second)
    pairs = []
    for variant, records in first.trials.items():
        for turn, seed in enumerate(sorted(common_seeds(first, second, variant))):
            pair = (records[seed].success, second.trials[variant][seed].success)
            pairs.append((turn, pair))
    if not pairs:
        raise CompareError(f"{first.name} and {second.name} share no seed: nothing is paired")
    return decide(pair for _, pair in sorted(pairs, key=lambda found: found[0]))


def drops(side: Side) -> list[Difference]:
    """What each category, dimension and the whole lose from level to level and from first to last.

    Only tasks that both levels have count. Scenes of different levels are unrelated.
    """
    levels = sorted({level for _, level in side.samples})
    steps = [*pairwise(levels)]
    if len(levels) > 2:
        steps.append((levels[0], levels[-1]))
    found = []
    for low, high in steps:
        both = [t for t, n in side.samples if n == low and (t, high) in side.samples]
        all_tasks = {t for t, n in side.listed if n in (low, high)}
        for label, kind, chosen in collections(side.category):
            tasks = [t for t in both if side.category.get(t) in chosen]
            if not tasks:
                continue
            shares = weights_of([(t, low) for t in tasks], side.category)
            easy, hard = (
                interval_of([side.samples[t, n] for t in tasks], shares) for n in (low, high)
            )
            gap = difference(easy, hard)
            count = sum(side.category.get(t) in chosen for t in all_tasks)
            trials = sum(side.samples[t, n].trials for t in tasks for n in (low, high))
            name = f"{label} L{low}-L{high}"
            row = (len(tasks), count, trials, easy.value, hard.value, gap, p_of_interval(gap))
            found.append(Difference(name, kind, high, *row))
    return found


def _cell(first: Side, second: Side, variant: Variant, metric: str, paired: bool) -> _Cell:
    if not paired:
        return _Cell(variant, first.samples[variant], second.samples[variant], None)
    a, b = first.trials[variant], second.trials[variant]
    seeds = common_seeds(first, second, variant)
    for seed in seeds:
        if a[seed].scene_digest != b[seed].scene_digest:
            raise CompareError(
                f"seed {seed} of {variant[0]} L{variant[1]} is another scene in {second.name} than "
                f"in {first.name}: they were made by versions with different scenes"
            )
    where = f"{variant[0]} L{variant[1]}"
    one = sample_of([a[s] for s in seeds], metric, where)
    two = sample_of([b[s] for s in seeds], metric, where)
    return _Cell(variant, one, two, _gap([(a[s], b[s]) for s in seeds], metric, one))


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


def _discordant(cells: Iterable[_Cell]) -> tuple[int, int]:
    """How many pairs the first and the second side did better in."""
    better = worse = 0
    for cell in cells:
        if cell.gap is not None:
            middle = len(cell.gap.counts) // 2
            worse += sum(cell.gap.counts[:middle])
            better += sum(cell.gap.counts[middle + 1 :])
    return better, worse


def _estimate(cells: Sequence[_Cell], weights: Sequence[float], method: str) -> Estimate:
    """Interval of the weighted difference: of the pairs, or of two unrelated sums."""
    gaps = [c.gap for c in cells if c.gap is not None]
    if len(gaps) < len(cells):
        a = interval_of([c.first for c in cells], weights, method)
        return difference(a, interval_of([c.second for c in cells], weights, method, seed=1))
    if method == "bootstrap":
        return interval_of(gaps, weights, method)
    return mover([paired_sample_difference(g) for g in gaps], weights)


def _tested(method: str) -> str:
    """The intervals that p-values come from: the bootstrap's can be points."""
    return METHODS[0] if method == "bootstrap" else method


def _variant_row(cell: _Cell, method: str) -> Difference:
    task, level = cell.variant
    estimate, honest = (_estimate([cell], [1.0], m) for m in (method, _tested(method)))
    rates = cell.first.binary and cell.second.binary
    trials = cell.first.trials if cell.gap else cell.first.trials + cell.second.trials
    row = Difference(
        task, "variant", level, 1, 1, trials, cell.first.value, cell.second.value, estimate, 1.0
    )
    if cell.gap is None:
        p = boschloo(cell.first, cell.second) if rates else p_of_interval(honest)
        return replace(row, p=p)
    b, c = _discordant([cell])
    p = mcnemar_mid_p(b, c) if rates else p_of_interval(honest)
    return replace(row, p=p, only_first=b, only_second=c)


def _groups(
    cells: Sequence[_Cell], wanted: set[Variant], category: Mapping[str, str], method: str
) -> list[Difference]:
    levels = sorted({cell.variant[1] for cell in cells})
    found = []
    for label, kind, chosen in collections(category):
        for level in (*levels, 0):
            keep = _member(category, chosen, level)
            members = [cell for cell in cells if keep(cell.variant)]
            if members:
                count = sum(keep(v) for v in wanted)
                found.append(_group_row(label, kind, level, members, count, category, method))
    return found


def _group_row(
    label: str,
    kind: str,
    level: int,
    cells: Sequence[_Cell],
    listed: int,
    category: Mapping[str, str],
    method: str,
) -> Difference:
    weights = weights_of([c.variant for c in cells], category)
    first = sum(w * c.first.value for w, c in zip(weights, cells, strict=True))
    second = sum(w * c.second.value for w, c in zip(weights, cells, strict=True))
    estimate, honest = (_estimate(cells, weights, m) for m in (method, _tested(method)))
    paired = cells[0].gap is not None
    trials = sum(c.first.trials + (0 if paired else c.second.trials) for c in cells)
    row = (label, kind, level, len(cells), listed, trials, first, second, estimate)
    other = _over_tasks(cells, category, honest) if level and len(cells) > 1 else None
    if not paired:
        return Difference(*row, p_of_interval(honest), over_tasks=other)
    b, c = _discordant(cells)
    # One weight for every trial holds inside a category; above it only the interval is fair.
    pooled = kind in ("task", "category") and all(x.first.binary for x in cells)
    p = mcnemar_mid_p(b, c) if pooled else p_of_interval(honest)
    return Difference(*row, p, b, c, over_tasks=other)


def _over_tasks(
    cells: Sequence[_Cell], category: Mapping[str, str], at_least: Estimate
) -> Estimate:
    """The same difference if tasks were drawn anew from what they were drawn from."""
    groups: dict[str, list[_Cell]] = {}
    for cell in cells:
        groups.setdefault(category[cell.variant[0]], []).append(cell)
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


def _worst_and_best(first: Side, second: Side, category: Mapping[str, str]) -> list[str]:
    """What missing trials could make of the mean over all variants that both list."""
    both = [v for v in first.listed if v in second.listed and category.get(v[0]) in CATEGORIES]
    lacking = [
        sum(side.listed[v] for v in both)
        - sum(side.samples[v].trials for v in both if v in side.samples)
        for side in (first, second)
    ]
    if not both or not any(lacking):
        return []
    names = replace(first, category=category), replace(second, category=category)
    (low, high), (other_low, other_high) = (extremes(side, both) for side in names)
    counts = " and ".join(
        f"{side.name} lacks {n}" for side, n in zip((first, second), lacking, strict=True) if n
    )
    return [
        f"{counts} of the trials that both list: over these the difference is "
        f"{100 * (low - other_high):+.1f} in the worst and {100 * (high - other_low):+.1f} in the "
        f"best case for {first.name}."
    ]


def _notes(
    first: Side, second: Side, common: Sequence[Variant], wanted: set[Variant], paired: bool
) -> list[str]:
    """What limits the comparison, in sentences."""
    found = []
    if paired:
        found.append("Paired: trials on the same seeds are held against each other.")
        pairs = {v: len(common_seeds(first, second, v)) for v in common}
        alone = sum(max(first.listed[v], second.listed[v]) - pairs[v] for v in common)
        if alone:
            found.append(f"{alone} listed trials have no result on one of the sides: left out.")
        blind = [side.name for side in (first, second) if not side.seeded]
        if blind:
            found.append(
                f"{' and '.join(blind)} ignores the policy seed: another run may differ, so the "
                "pairs tell less than the intervals say."
            )
    else:
        found.append("Unpaired: the sides share no seeds, so every difference needs more trials.")
    if len(common) < len(wanted):
        found.append(
            f"Only {len(common)} of {len(wanted)} variants are in both: means are of those."
        )
    names = first.versions.keys() & second.versions.keys()
    if changed := sorted(n for n in names if first.versions[n] != second.versions[n]):
        found.append(f"Made by different versions of {', '.join(changed)}.")
    return found
