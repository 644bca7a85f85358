"""What `eval` and `demo` share: run a request to its end and show its table."""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

from robospa.harness.running.evaluate import Request, RunAborted, evaluate
from robospa.harness.running.films import FilmsInterrupted

if TYPE_CHECKING:
    from robospa.results.records.run_io import Run


def run_and_show(request: Request, *, as_json: bool = False) -> None:
    """Evaluate, print the scores, and end with 1 if trials are missing or at least half of them
    ended in a policy error, with 130 on Ctrl-C: with the scores if only films were missing.

    Scores are a table, or as JSON one object on standard output.
    """
    from robospa.results.records.run_io import read_run
    from robospa.results.records.settings_of_run import by_setting
    from robospa.results.report.faults import many_policy_errors
    from robospa.results.report.score_table import print_scores
    from robospa.results.scoring.scores import score_run

    folder = request.config.folder
    again = f"the same command with --out {folder} --resume goes on from here"
    unfilmed = ""
    try:
        with terminable():
            evaluate(request)
    except FilmsInterrupted as error:
        unfilmed = f"robospa: interrupted after the last trial; {error}"
    except KeyboardInterrupt:
        print(f"robospa: interrupted; {again}", file=sys.stderr)
        raise typer.Exit(130) from None
    except RunAborted as error:
        raise RunAborted(f"the run stopped: {error}; {again}") from error
    run = read_run(folder)
    if as_json:
        print(json.dumps({"folder": str(folder), **run_data(run)}, indent=1))
    else:
        for part in by_setting(run):
            print_scores(part, score_run(part))
    if run.missing:
        print(
            f"robospa: {len(run.missing)} of {len(run.keys)} trials could not be run and are "
            f"missing from these numbers; {again}",
            file=sys.stderr,
        )
        raise typer.Exit(1)
    if text := many_policy_errors(run):
        print(f"robospa: {text}; look at the reasons above, or at `robospa failures {folder}`",
              file=sys.stderr)  # fmt: skip
        raise typer.Exit(1)
    if unfilmed:
        print(unfilmed, file=sys.stderr)
        raise typer.Exit(130)
    if not as_json:
        print(f"Run: {folder}   Report: robospa report {folder}")


def run_data(run: Run) -> dict[str, object]:
    """Counts of a run's trials by end, and its scores, as JSON values; rates are fractions.

    Of several robots or scene modes there are `parts` instead, by their names.
    """
    from robospa.results.records.action_problems import problem_data
    from robospa.results.records.settings_of_run import by_setting, setting_name
    from robospa.results.report.run_card import ends
    from robospa.results.scoring.score_json import to_json
    from robospa.results.scoring.scores import score_run

    if len(parts := by_setting(run)) > 1:
        return {"parts": {setting_name(part): run_data(part) for part in parts}}
    counts: dict[str, object] = {"trials": len(run.keys), "missing": len(run.missing)}
    counts["ends"] = ends(run)
    problems = {"problems": problem_data(run.records.values())}
    return {**counts, **problems, **to_json(score_run(run))}


def evaluate_quietly(request: Request, what: str) -> None:
    """Evaluate, one of several runs of a command, called `what`; its scores are shown later.

    Ends with 130 on Ctrl-C; raises RunAborted, also if trials are missing.
    """
    from robospa.results.records.run_io import read_run

    again = "the same command with --resume goes on from here"
    print(f"{what}:", file=sys.stderr)
    try:
        with terminable():
            evaluate(request)
    except KeyboardInterrupt as error:
        about = f" after the last trial of {what}; {error}" if str(error) else ""
        print(f"robospa: interrupted{about}; {again}", file=sys.stderr)
        raise typer.Exit(130) from None
    except RunAborted as error:
        raise RunAborted(f"the run at {what} stopped: {error}; {again}") from error
    run = read_run(request.config.folder)
    if run.missing:
        raise RunAborted(f"{len(run.missing)} trials at {what} could not be run; {again}")


@contextmanager
def terminable() -> Iterator[None]:
    """Treat SIGTERM like Ctrl-C while a run is going on."""

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
