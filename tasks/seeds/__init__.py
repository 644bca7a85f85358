"""The accepted seeds of every variant: scenes that settle and that the expert solves.

Shipped as data so that a run never needs the expert. `robospa seeds` makes them anew.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib.resources import files

from robospa.tasks.catalog import task

FIRST_SEED = 100_000
"""Where the official evaluation starts (infrastructure facts, section 8)."""
PER_VARIANT = 100


@cache
def _lists(name: str) -> dict[int, tuple[int, ...]]:
    path = files("robospa.tasks.seeds").joinpath(f"{name}.json")
    if not path.is_file():
        return {}
    data = json.loads(path.read_text())
    return {int(level): tuple(seeds) for level, seeds in data.items()}


def accepted(name: str, level: int) -> tuple[int, ...]:
    """Accepted seeds of a variant, ascending; LookupError if none are shipped."""
    found = task(name)
    seeds = _lists(found.name).get(level)
    if not seeds:
        raise LookupError(
            f"no accepted seeds are shipped for {found.name} level {level}; "
            f"make them with `robospa seeds {found.name} --levels {level}`"
        )
    return seeds


def seed_list_hash(variants: list[tuple[str, int]]) -> str:
    """Hash over the seed lists of these variants, for a run's manifest."""
    lists = {f"{name}/{level}": accepted(name, level) for name, level in sorted(variants)}
    return hashlib.sha256(json.dumps(lists, sort_keys=True).encode()).hexdigest()[:16]
