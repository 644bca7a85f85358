"""Groups of variants that differences are averaged over, and the weights of variants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robospa.categories import BASIC, CATEGORIES, DIMENSIONS
from robospa.results.scoring.scores import Variant


def collections(category: Mapping[str, str]) -> list[tuple[str, str, tuple[str, ...]]]:
    """(label, kind, categories) of all that is averaged, present or not."""
    present = [c for c in CATEGORIES + BASIC if c in category.values()]
    found: list[tuple[str, str, tuple[str, ...]]] = [(c, "category", (c,)) for c in present]
    found += [(name, "dimension", members) for name, members in DIMENSIONS.items()]
    return [*found, ("overall", "overall", CATEGORIES)]


def weights_of(variants: Sequence[Variant], category: Mapping[str, str]) -> list[float]:
    """Categories count the same, in them tasks, in them levels."""
    tasks: dict[str, int] = {}
    for task, _ in variants:
        tasks[task] = tasks.get(task, 0) + 1
    sizes: dict[str, int] = {}
    for task in tasks:
        sizes[category[task]] = sizes.get(category[task], 0) + 1
    return [1 / (len(sizes) * sizes[category[t]] * tasks[t]) for t, _ in variants]
