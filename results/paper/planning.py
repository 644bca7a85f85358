"""How many trials of every variant an average takes, before any is run.

The published models say what to expect: each has 280 rates p, and a mean over variants with weights
w and n trials each varies by the sum of w^2 p (1 - p) / n.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from robospa.results.paper.published import LEVELS, load
from robospa.results.scoring.weights import Variant, weights_of
from robospa.results.statistics.intervals import Z95


def published_variances(variants: Sequence[Variant]) -> dict[str, float]:
    """By published model the variance of the mean over `variants` with one trial of each; only
    those of the 280 count. Empty if `variants` has none."""
    data = load()
    known = [v for v in variants if v[0] in data.tasks and v[1] in LEVELS]
    if not known:
        return {}
    weights = weights_of(known, {task: about.category for task, about in data.tasks.items()})
    found = {}
    for model in data.models:
        rows = data.per_task[model, "sr"].rows
        rates = [rows[task][level - 1] / 100 for task, level in known]
        found[model] = sum(w * w * p * (1 - p) for w, p in zip(weights, rates, strict=True))
    return found


def half_width(variance: float, trials: int) -> float:
    """Half of the 95 % interval of a mean that varies by `variance` with one trial a variant."""
    return Z95 * math.sqrt(variance / trials)


def trials_for(variance: float, half: float) -> int:
    """Trials of every variant that a `half` width takes."""
    return math.ceil(variance * (Z95 / half) ** 2)
