"""`robospa lint`: what looks wrong in runs, or in the paper's tables."""

from __future__ import annotations

from typing import Annotated

import typer

PAPER = "paper"


def lint(
    runs: Annotated[list[str], typer.Argument(help='folders of runs, or "paper"')],
) -> None:
    """Check runs for results that cannot be; several runs also for fitting into one table."""
    from pathlib import Path

    from robospa.results.records.lint import lint_published, lint_run, lint_runs
    from robospa.results.records.run_io import read_run
    from robospa.tasks.catalog import tasks

    known = {(name, level) for name in tasks() for level in range(1, 6)}
    found = lint_published() if PAPER in runs else []
    read = [read_run(Path(name)) for name in runs if name != PAPER]
    for run in read:
        found += lint_run(run, known)
    if len(read) > 1:
        found += lint_runs(read)
    for finding in sorted(found, key=lambda f: f.severity):
        print(finding)
    errors = sum(f.severity == "error" for f in found)
    print(f"{errors} errors, {len(found) - errors} warnings")
    if errors:
        raise typer.Exit(1)
