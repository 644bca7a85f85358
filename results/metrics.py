"""Success rate, ONTA and progress score of a run: per variant, level, category, dimension, overall.

As in the paper: ONTA for the five spatial categories, progress for the five procedural ones; a
category is the mean of its tasks, a dimension or the overall value the mean of its categories.
Missing trials are never averaged away: a cell knows how many it lacks and between which values its
rate must lie, and every average says how many trials are missing below it.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robospa.results.intervals import Estimate, bootstrap_mean, chance_corrected, mean, wilson
from robospa.results.reading import Run, finished
from robospa.results.records import TrialKey, TrialRecord

SPATIAL = ("GAC", "SDE", "CPI", "RRR", "CVR")
PROCEDURAL = ("RPF", "OFE", "OCE", "CAC", "MIP")
CATEGORIES = SPATIAL + PROCEDURAL
CATEGORY_NAMES = {
    "GAC": "Geometric Attribute Cognition",
    "SDE": "Spatial Distance Estimation",
    "CPI": "Canonical Position Indexing",
    "RRR": "Referential Relational Reasoning",
    "CVR": "Cross-View Reasoning",
    "RPF": "Repetitive Procedure Following",
    "OFE": "Order-Free Execution",
    "OCE": "Order-Constrained Execution",
    "CAC": "Composite Action Coordination",
    "MIP": "Memory-Intensive Planning",
}
DIMENSIONS = {"spatial": SPATIAL, "procedural": PROCEDURAL}
METRICS = ("sr", "onta", "ps")
METRIC_NAMES = {"sr": "SR", "onta": "ONTA", "ps": "PS"}


@dataclass(frozen=True)
class Cell:
    """One variant: `listed` trials, of which `trials` have a result and `successes` succeeded.

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

    @property
    def missing(self) -> int:
        """Listed trials without a result."""
        return self.listed - self.trials

    @property
    def worst(self) -> float:
        """Success rate if every missing trial were a failure."""
        return self.successes / self.listed if self.listed else 0.0

    @property
    def best(self) -> float:
        """Success rate if every missing trial were a success."""
        return (self.successes + self.missing) / self.listed if self.listed else 1.0


@dataclass(frozen=True)
class Average:
    """A mean over tasks or categories, by metric; None where something below has no value.

    `worst` and `best` bound the mean success rate over all that the missing trials could be.
    """

    trials: int
    missing: int
    values: Mapping[str, Estimate | None]
    worst: float
    best: float


@dataclass(frozen=True)
class Scores:
    """Everything that a run's tables show. Level 0, like `tasks`, is the mean over levels."""

    cells: Mapping[tuple[str, int], Cell]
    levels: tuple[int, ...]
    tasks: Mapping[str, Average]
    categories: Mapping[tuple[str, int], Average]
    dimensions: Mapping[tuple[str, int], Average]
    overall: Mapping[int, Average]


def _seed(task: str, level: int) -> int:
    """A bootstrap seed of the variant's own, so that no cell depends on which others exist."""
    return zlib.crc32(f"{task}/{level}".encode())


def score_cell(
    task: str, level: int, category: str, listed: int, records: Sequence[TrialRecord]
) -> Cell:
    """The cell of one variant from its results (`records` without lost ones)."""
    count = len(records)
    successes = sum(r.success for r in records)
    sr = wilson(successes, count) if count else None
    values: dict[str, Estimate | None] = {"sr": sr}
    candidates = 0
    if category in SPATIAL:
        found = {r.candidates for r in records}
        candidates = found.pop() if len(found) == 1 else 0
        values["onta"] = chance_corrected(sr, candidates) if sr and candidates > 1 else None
    elif category in PROCEDURAL:
        shares = np.array([r.done / r.total if r.total else float(r.success) for r in records])
        values["ps"] = bootstrap_mean(shares, _seed(task, level)) if count else None
    return Cell(task, level, category, listed, count, successes, values, candidates)


def _join(parts: Sequence[Cell | Average]) -> Average:
    """Mean of cells, or of averages, that all count the same.

    A metric has a mean only if every part that it applies to has a value: one variant without a
    single result leaves all averages above it open.
    """
    values: dict[str, Estimate | None] = {}
    for metric in METRICS:
        below = [p.values[metric] for p in parts if metric in p.values]
        known = [e for e in below if e is not None]
        if below:
            values[metric] = mean(known) if len(known) == len(below) else None
    return Average(
        trials=sum(p.trials for p in parts),
        missing=sum(p.missing for p in parts),
        values=values,
        worst=float(np.mean([p.worst for p in parts])),
        best=float(np.mean([p.best for p in parts])),
    )


def _by_level(
    groups: Mapping[str, Sequence[str]],
    levels: Sequence[int],
    find: Callable[[str, int], Cell | Average | None],
) -> dict[tuple[str, int], Average]:
    """Average of each group's members at every level, and at level 0 of what `find` gives there."""
    made: dict[tuple[str, int], Average] = {}
    for name, members in groups.items():
        for level in (*levels, 0):
            parts = [p for m in members if (p := find(m, level)) is not None]
            if parts:
                made[name, level] = _join(parts)
    return made


def score(
    keys: Iterable[TrialKey],
    records: Mapping[TrialKey, TrialRecord],
    category_of: Mapping[str, str] | None = None,
) -> Scores:
    """All scores of the trials `keys` from their `records`.

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
    return combine(cells)


def combine(cells: Mapping[tuple[str, int], Cell]) -> Scores:
    """All averages above `cells`."""
    levels = tuple(sorted({level for _, level in cells}))
    category = {task: cell.category for (task, _), cell in cells.items()}
    names = list(category)
    tasks = {t: _join([cells[t, n] for n in levels if (t, n) in cells]) for t in names}

    def cell_or_mean(task: str, level: int) -> Cell | Average | None:
        return cells.get((task, level)) if level else tasks[task]

    members_of = {c: [t for t in names if category.get(t) == c] for c in CATEGORIES}
    categories = _by_level(members_of, levels, cell_or_mean)
    dimensions = _by_level(DIMENSIONS, levels, lambda c, n: categories.get((c, n)))
    everything = _by_level({"": CATEGORIES}, levels, lambda c, n: categories.get((c, n)))
    overall = {level: average for (_, level), average in everything.items()}
    return Scores(cells, levels, tasks, categories, dimensions, overall)


def score_run(run: Run) -> Scores:
    """All scores of `run`."""
    return score(run.keys, run.records, run.manifest.get("categories"))
