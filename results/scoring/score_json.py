"""Scores as JSON values: `report.json`, and the scores of a bundle."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypedDict

from robospa.results.scoring.scores import AverageScore, Scores, VariantScore

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
