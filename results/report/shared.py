"""Like with like: several models over the variants that all of them have results of."""

from __future__ import annotations

from collections.abc import Sequence

from robospa.results.scoring.model_results import ModelResults, restricted
from robospa.results.scoring.weights import Variant
from robospa.trial import BASIC


def shared_variants(models: Sequence[ModelResults]) -> set[Variant]:
    """The variants that all `models` have results of; published ones do not restrict the basic
    grounding tasks, of which the paper prints no model's results."""
    basic = {v for m in models for v, cell in m.scores.cells.items() if cell.category in BASIC}
    found = [with_results(m) | (basic if m.published else set()) for m in models]
    return set.intersection(*found) if found else set()


def with_results(model: ModelResults) -> set[Variant]:
    """The variants that `model` has any result of."""
    return {variant for variant, cell in model.scores.cells.items() if cell.trials}


def over_shared(models: Sequence[ModelResults]) -> list[ModelResults]:
    """`models` as if each had run the shared variants only; as they are if there is one alone, or
    if they share nothing. Runs in progress have only what they have results of."""
    begun = [restricted(m, with_results(m)) if m.to_run else m for m in models]
    shared = shared_variants(models) if len(models) > 1 else set()
    return [restricted(model, shared) for model in begun] if shared else begun


def beside_runs(published: ModelResults, runs: Sequence[ModelResults]) -> ModelResults:
    """`published` over the variants that any of `runs` has results of."""
    return restricted(published, set().union(*map(with_results, runs)))
