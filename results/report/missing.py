"""Sentences on the missing trials of a run, with the reasons."""

from __future__ import annotations

from robospa.results.records.reasons import grouped
from robospa.results.records.run_io import Run
from robospa.results.scoring.scores import Scores


def missing_lines(scores: Scores) -> list[str]:
    """One sentence for every variant that lacks trials."""
    return [
        f"{cell.task} L{cell.level}: {cell.missing} of {cell.listed} trials are missing; if all "
        f"had failed SR would be {100 * cell.worst:.1f}, if all had succeeded {100 * cell.best:.1f}"
        for cell in scores.cells.values()
        if cell.missing
    ]


def loss_lines(run: Run, most: int = 5) -> list[str]:
    """The reasons for missing trials, one sentence a reason, the most frequent first."""
    records = [run.records.get(key) for key in run.missing]
    reasons = ["not run yet" if r is None else r.message for r in records]
    return [f"missing {count}: {reason}" for count, reason in grouped(reasons, most)]
