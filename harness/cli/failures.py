"""`robospa failures`: why the failed trials of a run failed."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from robospa.results.records.run_io import Run


def failures(
    run: Annotated[Path, typer.Argument(help="folder of a run")],
    by: Annotated[str, typer.Option(help="count by task, category or variant")] = "task",
    trials: Annotated[
        bool, typer.Option("--trials", help="list every failed trial with its evidence")
    ] = False,
    film: Annotated[
        bool, typer.Option("--film", help="first make the videos that failed trials lack")
    ] = False,
    layout: Annotated[str, typer.Option("--format", help="markdown, csv or json")] = "markdown",
    as_json: Annotated[bool, typer.Option("--json", help="the same as --format json")] = False,
) -> None:
    """Print the types of failure in a run; docs/failures.md says how they are decided."""
    from robospa.results.failures.labels import OURS, counts_table, label, trials_table
    from robospa.results.records.action_problems import problem_lines
    from robospa.results.records.run_io import read_run

    layout = "json" if as_json else layout
    found = read_run(run)
    if film:
        make_films(found)
        found = read_run(run)
    records = list(found.records.values())
    if trials:
        print(trials_table(records, layout))
        return
    print(counts_table(records, by, layout))
    if layout == "markdown":
        types = [failure for record in records if (failure := label(record)) is not None]
        print(f"\n{len(types)} failed trials of {len(found.keys)}, {len(found.missing)} missing")
        if any(failure.kind in OURS for failure in types):
            print("* not one of the paper's types")
        for line in problem_lines(records):
            print(line)


def make_films(run: Run) -> None:
    """Make the films that `run` lacks; ends the program with 130 on Ctrl-C."""
    from robospa.harness.running.films import FilmsInterrupted, film_now

    try:
        for text in film_now(run):
            print(text, file=sys.stderr, flush=True)
    except FilmsInterrupted as error:
        print(f"robospa: interrupted; {error}", file=sys.stderr)
        raise typer.Exit(130) from None
