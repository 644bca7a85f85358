"""`robospa.compare`: two runs, or a run and published numbers, in one call."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from robospa.results.comparison.compare import Comparison
from robospa.results.comparison.compare import compare as differences
from robospa.results.records.manifest import RunError
from robospa.results.records.run_io import Run
from robospa.results.records.settings_of_run import MARK, by_setting, read_part, setting_name
from robospa.results.scoring.model_results import ModelResults, results_of_run

Side = Run | str | Path
"""A run, its folder (`FOLDER@ROBOT` for a part of it), or the name of a published model."""


def compare(first: Side, second: Side, metric: str = "sr", ci: str = "wilson") -> Comparison:
    """All differences `first - second`, with intervals and tests; paired where seeds are equal.

        found = robospa.compare("runs/mine", "runs/before")
        print(found.table())

    Args:
        first: A run, its folder, `FOLDER@ROBOT` for one robot of it, or a published model's name.
        second: What it is compared with.
        metric: "sr", "onta" or "ps".
        ci: How intervals of single rates are made: "wilson", "exact", "jeffreys" or "bootstrap".

    Raises:
        RunError: A folder holds no run, or one of several robots.
        ValueError: Nothing goes by a name; IncomparableError if the sides are of different things.
    """
    return differences(*both_sides(first, second), metric, ci)


def both_sides(first: Side, second: Side) -> tuple[ModelResults, ModelResults]:
    """The results of both sides, under different names; raises what `compare` raises."""
    one, two = results_of(first), results_of(second)
    if one.name == two.name:
        one, two = replace(one, name=_name(first)), replace(two, name=_name(second))
    return one, two


def _name(side: Side) -> str:
    return str(side.folder) if isinstance(side, Run) else str(side)


def results_of(side: Side) -> ModelResults:
    """The results of one side; raises what `compare` raises."""
    from robospa.results.paper.published_results import published_results

    if isinstance(side, Run):
        parts = by_setting(side)
        if len(parts) > 1:
            names = "; ".join(map(setting_name, parts))
            raise RunError(f"{side.folder} holds trials of {names}: name one as FOLDER{MARK}ROBOT")
        return results_of_run(side)
    name = str(side)
    if Path(name).exists() or Path(name.rpartition(MARK)[0] or name).is_dir():
        return results_of_run(read_part(name), name.rpartition("/")[2] if MARK in name else "")
    try:
        return published_results(name)
    except ValueError as error:
        raise ValueError(f"there is no folder {name}, and {error}") from None
