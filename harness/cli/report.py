"""`robospa report`: a run as tables, a figure and a page with its videos."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def report(
    run: Annotated[Path, typer.Argument(help="folder of a run")],
    out: Annotated[Path | None, typer.Option(help="where to write; default RUN/report")] = None,
) -> None:
    """Write report.md, report.json, report.html and the figure of a run."""
    from robospa.results.reading import read_run
    from robospa.results.report import write_report
    from robospa.results.tables import terminal

    found = read_run(run)
    folder = write_report(found, out or run / "report")
    terminal(found)
    print(f"Report: {folder / 'report.html'}")
