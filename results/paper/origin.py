"""What in this benchmark is official and what is ours: why the paper is a suite of its own."""

from __future__ import annotations

from collections.abc import Sequence

from robospa.results.paper.pieces import pieces, pieces_of, told
from robospa.results.records.manifest import RunSettings
from robospa.results.scoring.model_results import ModelResults, in_official_world
from robospa.text import listed

DIFFERENCES = listed(pieces("", RunSettings()).other)
"""How the paper's suite differs from ours."""
ORIGIN = (
    "Tasks, rules, thresholds, layouts, step limits and the robot are those of the official "
    "benchmark; the object meshes, the renderer, the seeds and the sentences are this project's "
    "own. So numbers of other suites, the paper's among them, stand beside ours and are never "
    "ranked among them."
)
RANKED = (
    "Marks and ranks count the paper's values and these alike; they say which policy is better "
    "only as far as what differs does not matter."
)
"""For runs in the official world beside the paper."""


def origin_of(runs: Sequence[ModelResults]) -> str:
    """What of `runs` is official: one sentence for this benchmark's own suites, one for each run of
    an official world."""
    official = [told(run) for run in runs if in_official_world(run)]
    return " ".join(official) if official else ORIGIN


def table_note(runs: Sequence[ModelResults]) -> str:
    """For a table that holds the paper's models and `runs`."""
    if any(map(in_official_world, runs)):
        return " ".join(["(paper): as published.", *map(told, runs), RANKED])
    return f"(paper): another suite, with {_differences(runs)}; not marked beside runs."


def printed_note(runs: Sequence[ModelResults]) -> str:
    """For a table that has `runs` beside values as printed."""
    if any(map(in_official_world, runs)):
        return " ".join(map(told, runs))
    return f"The printed values are of another suite, with {_differences(runs)}."


def banner(names: Sequence[str], runs: Sequence[ModelResults] = ()) -> str:
    """What to know before `runs` are held against the published models `names`."""
    whose = f"{listed(names)} {'were' if len(names) > 1 else 'was'} measured by the paper's authors"
    if any(map(in_official_world, runs)):
        return " ".join([f"{whose}.", *map(told, runs), RANKED])
    return (
        f"Another suite: {whose}, with {_differences(runs)}. A difference between these numbers "
        "and a run's, whatever its p, does not say which policy is better."
    )


def _differences(runs: Sequence[ModelResults]) -> str:
    """What is other than in any of `runs`, which are of this benchmark's own suites."""
    found = [word for run in runs for word in pieces_of(run).other]
    return listed(tuple(dict.fromkeys(found))) if found else DIFFERENCES
