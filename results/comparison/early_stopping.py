"""Early stopping: a test of two unfinished runs that is valid at any time."""

from __future__ import annotations

from robospa.results.comparison.pairs import check_comparable, common_seeds
from robospa.results.scoring.model_results import ModelResults
from robospa.results.scoring.setting import IncomparableError
from robospa.results.statistics.sequential import Verdict, decide


def stop_early(first: ModelResults, second: ModelResults) -> Verdict:
    """The verdict of the paired e-value over all variants.

    Pairs are taken in an order fixed by the list of trials: one of each variant, then the next of
    each, so that no category decides alone before the others.
    """
    check_comparable(first, second)
    pairs = []
    for variant, records in first.trials.items():
        for turn, seed in enumerate(sorted(common_seeds(first, second, variant))):
            pair = (records[seed].success, second.trials[variant][seed].success)
            pairs.append((turn, pair))
    if not pairs:
        raise IncomparableError(f"{first.name} and {second.name} share no seed: nothing is paired")
    return decide(pair for _, pair in sorted(pairs, key=lambda found: found[0]))
