"""Differences between the levels of one model."""

from __future__ import annotations

from itertools import pairwise

from robospa.results.comparison.compare import Difference
from robospa.results.comparison.groups import collections
from robospa.results.scoring.model_results import ModelResults
from robospa.results.scoring.weights import weights_of
from robospa.results.statistics.intervals import difference, interval_of
from robospa.results.statistics.significance import p_of_interval


def drops(results: ModelResults, metric: str = "sr") -> list[Difference]:
    """The loss of each category, dimension and the whole between levels, and from first to last.

    Only tasks that both levels have count. Scenes of different levels are unrelated.
    """
    samples, category = results.samples(metric), results.categories
    levels = sorted({level for _, level in samples})
    steps = [*pairwise(levels)]
    if len(levels) > 2:
        steps.append((levels[0], levels[-1]))
    found = []
    for low, high in steps:
        both = [t for t, n in samples if n == low and (t, high) in samples]
        all_tasks = {t for t, n in results.listed if n in (low, high)}
        for label, kind, chosen in collections(category):
            tasks = [t for t in both if category.get(t) in chosen]
            if not tasks:
                continue
            shares = weights_of([(t, low) for t in tasks], category)
            easy, hard = (interval_of([samples[t, n] for t in tasks], shares) for n in (low, high))
            gap = difference(easy, hard)
            count = sum(category.get(t) in chosen for t in all_tasks)
            trials = sum(samples[t, n].trials for t in tasks for n in (low, high))
            name = f"{label} L{low}-L{high}"
            row = (len(tasks), count, trials, easy.value, hard.value, gap, p_of_interval(gap))
            found.append(Difference(name, kind, high, *row))
    return found
