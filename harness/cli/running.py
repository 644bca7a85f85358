"""What `eval` and `demo` share: run a request to its end and show its table."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from robospa.harness.running.evaluate import Request, RunAborted, evaluate


def run_and_show(request: Request) -> None:
    """Evaluate, print the table, and end with 1 if trials are missing, 130 on Ctrl-C."""
    from robospa.results.records.run_io import read_run
    from robospa.results.report.score_table import print_scores
    from robospa.results.scoring.scores import score_run

    folder = request.config.folder
    again = f"the same command with --out {folder} --resume goes on from here"
    try:
        with _terminable():
            evaluate(request)
    except KeyboardInterrupt:
        print(f"robospa: interrupted; {again}", file=sys.stderr)
        raise typer.Exit(130) from None
    except RunAborted as error:
        raise RunAborted(f"the run stopped: {error}; {again}") from error
    run = read_run(folder)
    print_scores(run, score_run(run))
    if run.missing:
        print(
            f"robospa: {len(run.missing)} of {len(run.keys)} trials could not be run and are "
            f"missing from these numbers; {again}",
            file=sys.stderr,
        )
        raise typer.Exit(1)
    print(f"Run: {folder}   Report: robospa report {folder}")


@contextmanager
def _terminable() -> Iterator[None]:
    """Treat SIGTERM like Ctrl-C while a run is going on."""

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
