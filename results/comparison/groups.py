"""Groups of variants that differences are averaged over."""

from __future__ import annotations

from collections.abc import Mapping

from robospa.trial import BASIC, CATEGORIES, DIMENSIONS


def collections(category: Mapping[str, str]) -> list[tuple[str, str, tuple[str, ...]]]:
    """(label, kind, categories) of all that is averaged, present or not."""
    present = [c for c in CATEGORIES + BASIC if c in category.values()]
    found: list[tuple[str, str, tuple[str, ...]]] = [(c, "category", (c,)) for c in present]
    found += [(name, "dimension", members) for name, members in DIMENSIONS.items()]
    return [*found, ("overall", "overall", CATEGORIES)]
