"""A published model's results, computed from the paper's per-task tables as if it had been run."""

from __future__ import annotations

from dataclasses import replace

from robospa.results.paper import rounding
from robospa.results.paper.published import LEVELS, Published, find_model, load, title
from robospa.results.scoring.model_results import ModelResults
from robospa.results.scoring.scores import VariantScore, combine
from robospa.results.scoring.setting import Setting
from robospa.results.statistics.bootstrap import rate
from robospa.results.statistics.intervals import (
    METHODS,
    Estimate,
    bounded_mean,
    chance_corrected,
    wilson,
)
from robospa.trial import SPATIAL


def published_cell(published: Published, model: str, task: str, level: int) -> VariantScore:
    """A published variant as if it had been run: counts from SR, progress as a bare mean."""
    about = published.tasks[task]
    trials, count = published.trials, about.counts[level - 1]
    sr = published.value(model, "sr", task, level)
    assert sr is not None, f"no SR of {task}"
    successes = round(sr * trials / 100)
    found = wilson(successes, trials)
    values: dict[str, Estimate | None] = {"sr": found}
    samples = {"sr": rate(successes, trials)}
    if about.category in SPATIAL:
        values["onta"] = chance_corrected(found, count)
        samples["onta"] = rate(successes, trials, count)
        return VariantScore(
            task, level, about.category, trials, trials, successes, values, count, samples
        )
    printed = published.value(model, "ps", task, level)
    assert printed is not None, f"no PS of {task}"
    progress = rounding.exact_progress(printed, count, trials)
    values["ps"] = bounded_mean(progress / 100, trials)
    return VariantScore(
        task, level, about.category, trials, trials, successes, values, samples=samples
    )


def results_beside_runs(model: str, ci: str = METHODS[0]) -> ModelResults:
    """A published model whose name says that its numbers are the paper's."""
    found = published_results(model, ci)
    return replace(found, name=f"{found.name} (paper)")


def published_results(model: str, ci: str = METHODS[0]) -> ModelResults:
    """A published model, computed from its per-task tables."""
    data, model = load(), find_model(model)
    cells = {
        (task, level): published_cell(data, model, task, level)
        for task in data.tasks
        for level in LEVELS
    }
    setting = Setting((data.embodiment,), (data.mode,), (data.split,), (data.suite,))
    return ModelResults(title(model), combine(cells, ci), setting, published=model)
