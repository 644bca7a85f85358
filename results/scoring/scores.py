"""Success rate, ONTA and progress score of a run: per variant, level, category, dimension, overall.

As in the paper: ONTA for the five spatial categories, progress for the five procedural ones; a
category is the mean of its tasks, a dimension or the overall value the mean of its categories.
The appendix's basic grounding categories have success rates of their own and enter nothing above.
Missing trials are never averaged away: a cell knows how many it lacks and between which values its
rate must lie, and every average says how many trials are missing below it."""

import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from typing import TypedDict

import numpy as np

from robospa.results.paper.rounding import OVERALL
from robospa.results.records.runs import Run, finished
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.first_choice import first_choice, held_at_start
from robospa.results.statistics.intervals import METHODS, Estimate, interval_of, mean
from robospa.results.statistics.samples import Sample, onta_of_bound, progress, rate
from robospa.trial import (
    BASIC,
    CATEGORIES,
    DIMENSIONS,
    METRICS,
    PROCEDURAL,
    RATES,
    SPATIAL,
    TrialKey,
)

Variant = tuple[str, int]
"""Task and level."""
IDLE = "idle"
"""The progress score of a policy that does nothing: what holds before the first action."""


def weights_of(variants: Sequence[Variant], category: Mapping[str, str]) -> list[float]:
    """Categories count the same, in them tasks, in them levels."""
    tasks = Counter(task for task, _ in variants)
    sizes = Counter(category[task] for task in tasks)
    return [1 / (len(sizes) * sizes[category[t]] * tasks[t]) for t, _ in variants]


Weighted = tuple[tuple[Sample, float], ...]
Range = tuple[float, float]


@dataclass(frozen=True)
class VariantScore:
    """One variant: `listed` trials, of which `trials` have a result, `successes` succeeded and
    `firsts` did by their first choice (`first_choice`; None where that is not known).

    `values` has the metrics that apply to it, None where there is no result to compute them from.
    """

    task: str
    level: int
    category: str
    listed: int
    trials: int
    successes: int
    values: Mapping[str, Estimate | None]
    candidates: int = 0
    """The n of ONTA; 0 where it does not apply or trials disagree on it."""
    samples: Mapping[str, Sample] = field(default_factory=dict)
    """What the metrics' intervals are made from; none of a published mean."""
    firsts: int | None = None

    def count(self, metric: str) -> int | None:
        """The trials that count for `metric`, which is a rate; None where that is not known."""
        return self.successes if RATES[metric] == "sr" else self.firsts

    @property
    def missing(self) -> int:
        """Listed trials without a result."""
        return self.listed - self.trials

    def bounds(self, metric: str) -> Range | None:
        """`metric` if every missing trial had achieved nothing, and if every one all; None where
        it does not apply or cannot be known."""
        if metric not in self.values:
            return None
        known, whole = self.values[metric], max(self.listed, 1)
        if metric in RATES:
            held: float = self.count(metric) or 0
        else:
            held = known.value * self.trials if known is not None else 0.0
        low, high = held / whole, (held + self.missing) / whole
        if RATES.get(metric) in (None, metric):
            return low, high
        if self.candidates < 2:
            return None
        return onta_of_bound(low, self.candidates), onta_of_bound(high, self.candidates)


@dataclass(frozen=True)
class AverageScore:
    """A mean over tasks or categories, by metric; None where something below has no value."""

    trials: int
    missing: int
    values: Mapping[str, Estimate | None]
    samples: Mapping[str, Weighted] = field(default_factory=dict)
    """By metric the samples of all variants below with their weights, where all are known."""
    ranges: Mapping[str, Range] = field(default_factory=dict)
    """By metric between which values the missing trials leave it, where that is known."""

    def bounds(self, metric: str) -> Range | None:
        """`metric` in the worst and the best case; see `VariantScore.bounds`."""
        return self.ranges.get(metric)


@dataclass(frozen=True)
class Scores:
    """The scores of all variants, and the averages above them, computed when first asked for.

    Level 0, like `tasks`, is the mean over levels. Intervals are by the method `ci`
    (`intervals.METHODS`). Under `bootstrap` an average resamples the episodes of all variants below
    it, as the paper does.
    """

    cells: Mapping[Variant, VariantScore]
    ci: str = METHODS[0]

    @cached_property
    def levels(self) -> tuple[int, ...]:
        """All levels, in order."""
        return tuple(sorted({level for _, level in self.cells}))

    @cached_property
    def category_of(self) -> dict[str, str]:
        """The category of every task."""
        return {task: cell.category for (task, _), cell in self.cells.items()}

    @property
    def tasks_by_category(self) -> list[str]:
        """All tasks: of the benchmark's categories, then of basic grounding, then the others."""
        order = (*CATEGORIES, *BASIC, "")
        return [t for c in order for t, category in self.category_of.items() if category == c]

    @cached_property
    def tasks(self) -> Mapping[str, AverageScore]:
        """The mean over levels of every task."""
        cells, levels = self.cells, self.levels
        return {
            task: _join([cells[task, n] for n in levels if (task, n) in cells], self.ci)
            for task in self.category_of
        }

    @cached_property
    def categories(self) -> Mapping[tuple[str, int], AverageScore]:
        """The mean of every category's tasks, by category and level."""
        members = {
            c: [task for task, category in self.category_of.items() if category == c]
            for c in CATEGORIES + BASIC
        }
        return self._by_level(
            members, lambda task, n: self.cells.get((task, n)) if n else self.tasks[task]
        )

    @cached_property
    def dimensions(self) -> Mapping[tuple[str, int], AverageScore]:
        """The mean of every dimension's categories, by dimension and level."""
        return self._by_level(DIMENSIONS, lambda c, n: self.categories.get((c, n)))

    @cached_property
    def overall(self) -> Mapping[int, AverageScore]:
        """The mean of all categories, by level."""
        found = self._by_level({"": CATEGORIES}, lambda c, n: self.categories.get((c, n)))
        return {level: average for (_, level), average in found.items()}

    def part(self, row: str, level: int) -> VariantScore | AverageScore | None:
        """The score of a task, a category, a dimension or OVERALL at a level; None if none is."""
        if row in self.category_of:
            return self.cells.get((row, level)) if level else self.tasks[row]
        if row == OVERALL:
            return self.overall.get(level)
        return self.categories.get((row, level)) or self.dimensions.get((row, level))

    def _by_level(
        self,
        groups: Mapping[str, Sequence[str]],
        find: Callable[[str, int], VariantScore | AverageScore | None],
    ) -> dict[tuple[str, int], AverageScore]:
        """Average of each group's members at every level, and at level 0 of what `find` gives."""
        made: dict[tuple[str, int], AverageScore] = {}
        for name, members in groups.items():
            for level in (*self.levels, 0):
                parts = [p for m in members if (p := find(m, level)) is not None]
                if parts:
                    made[name, level] = _join(parts, self.ci)
        return made


def _seed(task: str, level: int) -> int:
    """A bootstrap seed of the variant's own, so that no cell depends on which others exist."""
    return zlib.crc32(f"{task}/{level}".encode())


def score_cell(
    task: str, level: int, category: str, listed: int, records: Sequence[TrialRecord]
) -> VariantScore:
    """The cell of one variant from its results (`records` without lost ones)."""
    spatial, procedural = category in SPATIAL, category in PROCEDURAL
    metrics = ["sr", "sr1"] + ["onta", "onta1"] * spatial + ["ps", IDLE] * procedural
    samples = {m: found for m in metrics if (found := sample_of(records, m)) is not None}
    values: dict[str, Estimate | None] = dict.fromkeys(metrics)
    values |= {m: interval_of([s], seed=_seed(task, level)) for m, s in samples.items()}
    won, first = (samples[m].total if records else 0 for m in ("sr", "sr1"))
    candidates = candidates_of(records) if spatial else 0
    return VariantScore(
        *(task, level, category, listed, len(records), won, values, candidates, samples),
        firsts=first,
    )


def candidates_of(records: Sequence[TrialRecord]) -> int:
    """The number of candidates in all of `records`; 0 if they differ."""
    found = {r.candidates for r in records}
    return found.pop() if len(found) == 1 else 0


def sample_of(records: Sequence[TrialRecord], metric: str) -> Sample | None:
    """The results of one variant by `metric`, None where it cannot be computed."""
    if not records:
        return None
    if metric in RATES:
        won, count = sum(succeeded(record, metric) for record in records), len(records)
        if metric == RATES[metric]:
            return rate(won, count)
        candidates = candidates_of(records)
        return rate(won, count, candidates) if candidates > 1 else None
    done = held_at_start if metric == IDLE else attrgetter("done")
    return progress((done(r), r.total) if r.total else (int(r.success), 1) for r in records)


def succeeded(record: TrialRecord, metric: str) -> bool:
    """Whether a trial counts for `metric`, which is a rate."""
    return record.success if RATES[metric] == "sr" else first_choice(record)


def with_intervals(cell: VariantScore, ci: str) -> VariantScore:
    """`cell` with the intervals that the method `ci` makes; Wilson's are there already."""
    if ci == METHODS[0]:
        return cell
    made: dict[str, Estimate | None] = dict(cell.values)
    for metric, sample in cell.samples.items():
        known = made[metric]
        if known is not None:
            found = interval_of([sample], method=ci, seed=_seed(cell.task, cell.level))
            made[metric] = replace(found, value=known.value)
    return replace(cell, values=made)


def _join(parts: Sequence[VariantScore | AverageScore], ci: str = METHODS[0]) -> AverageScore:
    """Mean of cells, or of averages, that all count the same.

    A metric has a mean only if every part that it applies to has a value: one variant without a
    single result leaves all averages above it open.
    """
    values: dict[str, Estimate | None] = {}
    samples: dict[str, Weighted] = {}
    ranges: dict[str, Range] = {}
    for metric in (*METRICS, IDLE):
        fit = [p for p in parts if metric in p.values]
        ends = [span for p in fit if (span := p.bounds(metric)) is not None]
        if fit and len(ends) == len(fit):
            low, high = np.mean(ends, axis=0)
            ranges[metric] = (float(low), float(high))
        below = [p.values[metric] for p in fit]
        known = [e for e in below if e is not None]
        if below:
            samples[metric] = _flat(fit, metric)
            joined = mean(known) if len(known) == len(below) else None
            if joined is not None and samples[metric]:
                found, weights = zip(*samples[metric], strict=True)
                if ci == "bootstrap":
                    joined = replace(interval_of(found, weights, ci), value=joined.value)
            values[metric] = joined
    return AverageScore(
        trials=sum(p.trials for p in parts),
        missing=sum(p.missing for p in parts),
        values=values,
        samples=samples,
        ranges=ranges,
    )


def _flat(parts: Sequence[VariantScore | AverageScore], metric: str) -> Weighted:
    """The samples of all variants below `parts`, which count the same; empty if one has none."""
    flat: list[tuple[Sample, float]] = []
    for part in parts:
        if isinstance(part, VariantScore):
            below: Weighted = ((part.samples[metric], 1.0),) if metric in part.samples else ()
        else:
            below = part.samples.get(metric, ())
        if not below:
            return ()
        flat += [(sample, weight / len(parts)) for sample, weight in below]
    return tuple(flat)


def score(
    keys: Iterable[TrialKey],
    records: Mapping[TrialKey, TrialRecord],
    category_of: Mapping[str, str] | None = None,
    ci: str = METHODS[0],
) -> Scores:
    """All scores of the trials `keys` from their `records`, with intervals by the method `ci`.

    `category_of` tells the category of tasks that may have no record yet.
    """
    listed: dict[tuple[str, int], list[TrialKey]] = {}
    for key in keys:
        listed.setdefault(key.variant, []).append(key)
    category = {r.key.task: r.category for r in records.values() if r.category}
    category.update(category_of or {})
    cells = {}
    for (task, level), members in listed.items():
        found = [records[k] for k in members if k in records and finished(records[k])]
        cells[task, level] = score_cell(task, level, category.get(task, ""), len(members), found)
    return combine(cells, ci)


def combine(cells: Mapping[Variant, VariantScore], ci: str = METHODS[0]) -> Scores:
    """The scores of `cells`, whose intervals are made by the method `ci`."""
    return Scores({variant: with_intervals(cell, ci) for variant, cell in cells.items()}, ci)


def score_run(run: Run, ci: str = METHODS[0]) -> Scores:
    """All scores of `run`, of what has been run so far, with intervals by the method `ci`."""
    return score(run.counted, run.records, run.manifest.categories, ci)


ScoreData = dict[str, int | list[float] | None]
"""Counts, and by metric the estimate (value, low, high) and its bounds."""
ByLevel = dict[str, dict[str, ScoreData]]
"""By name and level (`level_name`)."""


class ScoresData(TypedDict):
    """All scores of a model; rates are fractions."""

    estimate: list[str]
    variants: ByLevel
    tasks: dict[str, ScoreData]
    categories: ByLevel
    dimensions: ByLevel
    overall: dict[str, ScoreData]


def level_name(level: int) -> str:
    """Column title."""
    return f"L{level}" if level else "mean"


def to_json(scores: Scores) -> ScoresData:
    """All scores as JSON values; rates are fractions."""

    def part(item: VariantScore | AverageScore) -> ScoreData:
        data: ScoreData = {"trials": item.trials, "missing": item.missing}
        if isinstance(item, VariantScore):
            data["successes"] = item.successes
            if item.firsts is not None:
                data["first_choices"] = item.firsts
        for metric, found in item.values.items():
            data[metric] = None if found is None else [found.value, found.low, found.high]
            if item.missing and (ends := item.bounds(metric)) is not None:
                data[f"{metric}_bounds"] = list(ends)
        return data

    def table(
        pairs: Iterable[tuple[tuple[str, int], VariantScore | AverageScore]],
    ) -> ByLevel:
        made: ByLevel = {}
        for (name, level), item in pairs:
            made.setdefault(name, {})[level_name(level)] = part(item)
        return made

    return {
        "estimate": ["value", "low", "high"],
        "variants": table(scores.cells.items()),
        "tasks": {name: part(item) for name, item in scores.tasks.items()},
        "categories": table(scores.categories.items()),
        "dimensions": table(scores.dimensions.items()),
        "overall": {level_name(n): part(item) for n, item in scores.overall.items()},
    }
