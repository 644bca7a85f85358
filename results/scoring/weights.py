"""What every variant counts in an average."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Variant = tuple[str, int]
"""Task and level."""


def weights_of(variants: Sequence[Variant], category: Mapping[str, str]) -> list[float]:
    """Categories count the same, in them tasks, in them levels."""
    tasks: dict[str, int] = {}
    for task, _ in variants:
        tasks[task] = tasks.get(task, 0) + 1
    sizes: dict[str, int] = {}
    for task in tasks:
        sizes[category[task]] = sizes.get(category[task], 0) + 1
    return [1 / (len(sizes) * sizes[category[t]] * tasks[t]) for t, _ in variants]
