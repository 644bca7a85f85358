"""Scores as JSON values: `report.json`, and the scores of a bundle."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from robospa.results.scoring.scores import AverageScore, Scores, VariantScore


def level_name(level: int) -> str:
    """Column title."""
    return f"L{level}" if level else "mean"


def to_json(scores: Scores) -> dict[str, Any]:
    """All scores as JSON values; rates are fractions."""

    def part(item: VariantScore | AverageScore) -> dict[str, Any]:
        data: dict[str, Any] = {"trials": item.trials, "missing": item.missing}
        if isinstance(item, VariantScore):
            data["successes"] = item.successes
        for metric, found in item.values.items():
            data[metric] = None if found is None else [found.value, found.low, found.high]
            if item.missing and (ends := item.bounds(metric)) is not None:
                data[f"{metric}_bounds"] = list(ends)
        return data

    def table(
        pairs: Iterable[tuple[tuple[str, int], VariantScore | AverageScore]],
    ) -> dict[str, Any]:
        made: dict[str, Any] = {}
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
