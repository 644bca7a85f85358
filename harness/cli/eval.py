"""`robospa eval`: evaluate the policy behind a URL, on a fixed list of trials; or in real time at
several latencies."""

from __future__ import annotations

import shlex
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.options import AsJson, Token, aside, given_flags, print_json, with_flags
from robospa.harness.running.evaluate import Request
from robospa.harness.running.evaluate import evaluate as run_request
from robospa.harness.running.executor import RunAborted
from robospa.harness.running.films import FilmsInterrupted
from robospa.harness.settings import (
    GROUPS,
    EvaluationSettings,
    SettingsError,
    read_settings,
    updated,
)

if TYPE_CHECKING:
    from robospa.results.records.runs import Run

CURVE = "success-latency"
"""Name of the files of a curve, beside its runs."""
FIRST = ("out", "tasks", "levels", "trials", "split", "embodiment", "mode", "workers", "video")
"""Settings that stand in the help."""


@with_flags([EvaluationSettings, *GROUPS.values()], without=["policy"], first=FIRST)
def evaluate(
    context: typer.Context,
    policy: Annotated[
        str | None,
        typer.Argument(
            help="a server's URL, such as ws://host:port, or, without a server, a local policy's "
            "name or module:Class"
        ),
    ] = None,
    more: Annotated[
        list[str] | None,
        typer.Option(
            "--policy", metavar="URL", help="another server of the same policy; may be repeated"
        ),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(help="file of settings, such as RUN/settings.toml; flags win over it"),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on with the run in --out")] = False,
    auto_resume: Annotated[
        bool, typer.Option("--auto-resume", help="start, or go on if --out holds a run already")
    ] = False,
    token: Token = None,
    latency: Annotated[
        str | None,
        typer.Option(
            metavar="MS,MS,...",
            help="in real time: a run for each of these latencies, in --out, and their curve",
        ),
    ] = None,
    as_json: AsJson = False,
    **given: object,
) -> None:
    """Evaluate a policy on a fixed list of seeded trials; afterwards, see `robospa report`.

    A trial that cannot be run is retried and, if that does not help, reported as missing: it never
    counts as a failure. After Ctrl-C, the same command with --resume continues.
    """
    from robospa.harness.running.request import goes_on, interrupted, make_request

    settings = EvaluationSettings() if config is None else read_settings(config)
    changes = {name: value for name, value in given_flags(context).items() if name in given}
    servers = ([] if policy is None else [policy]) + list(more or ())
    if servers:
        changes |= {"policy": servers, "policy_map": given["policy_map"]}
    elif "policy_map" in changes:
        changes["policy"] = ()
    settings = updated(settings, changes)
    resume = goes_on("auto" if auto_resume else resume, settings.out)
    if latency is not None:
        _curve(settings, _milliseconds(latency), token, resume or auto_resume, as_json)
        return
    if not resume and interrupted(settings):
        aside(f"going on with the run in {settings.out}, which was begun with the same command")
        resume = True
    run_and_show(make_request(settings, token=token, resume=resume), as_json=as_json)


def run_and_show(request: Request, *, as_json: bool = False) -> None:
    """Evaluate, print the scores, and end with 1 if trials are missing or at least half of them
    ended in a policy error, with 130 on Ctrl-C: with the scores if only films were missing.

    Scores are a table, or as JSON one object on standard output.
    """
    from robospa.results.comparison.profile import profile_of
    from robospa.results.records.runs import by_setting, read_run
    from robospa.results.report.run_card import print_scores
    from robospa.results.scoring.models import results_of_run
    from robospa.results.scoring.repeats import many_policy_errors

    folder = request.config.folder
    written = shlex.quote(str(folder))  # as a shell takes it
    again = f"the same command with --out {written} --resume goes on from here"
    unfilmed = ""

    def show() -> bool:
        run = replace(read_run(folder), in_progress=False)
        if as_json:
            print_json({"folder": folder, **run_data(run)})
        elif run.manifest.settings.profile:
            print(profile_of(run))
        else:
            for part in by_setting(run):
                print_scores(part, results_of_run(part), beside=False)
        sys.stdout.flush()
        return True

    try:
        with resumable("the run", again):
            run_request(replace(request, after_trials=show))
    except FilmsInterrupted as error:
        unfilmed = f"robospa: interrupted after the last trial; {error}"
    run = read_run(folder)
    if run.missing:
        aside(
            f"robospa: {len(run.missing)} of {len(run.keys)} trials could not be run and are "
            f"missing from these numbers; {again}"
        )
        raise typer.Exit(1)
    if text := many_policy_errors(run):
        hint = f"look at the reasons above, or at `robospa report {written} --failures`"
        aside(f"robospa: {text}; {hint}")
        raise typer.Exit(1)
    if unfilmed:
        aside(unfilmed)
        raise typer.Exit(130)
    if not as_json:
        print(f"Run: {folder}   Report: robospa report {written}")


def run_data(run: Run) -> dict[str, object]:
    """Counts of a run's trials by end, and its scores, as JSON values; rates are fractions.

    Of several robots or scene modes there are `parts` instead, by their names.
    """
    from robospa.results.comparison.profile import profile_of
    from robospa.results.records.action_problems import problem_data
    from robospa.results.records.runs import by_setting, setting_name
    from robospa.results.report.run_card import ends
    from robospa.results.scoring.scores import score_run, to_json

    if run.manifest.settings.profile:
        return {"profile": profile_of(run).to_json()}
    if len(parts := by_setting(run)) > 1:
        return {"parts": {setting_name(part): run_data(part) for part in parts}}
    counts = {"trials": len(run.keys), "missing": len(run.missing), "ends": ends(run)}
    problems = {"problems": problem_data(run.records.values())}
    return {**counts, **problems, **to_json(score_run(run))}


@contextmanager
def resumable(
    what: str, again: str, errors: tuple[type[Exception], ...] = (RunAborted,)
) -> Iterator[None]:
    """Treat SIGTERM like Ctrl-C while `what` is going on, which ends the program with 130; after
    one of `errors` it "stopped", a RunAborted. `again` says how to go on."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    except FilmsInterrupted:
        raise
    except KeyboardInterrupt:
        aside(f"robospa: interrupted; {again}")
        raise typer.Exit(130) from None
    except errors as error:
        raise RunAborted(f"{what} stopped: {error}; {again}") from error
    finally:
        signal.signal(signal.SIGTERM, before)


# -- success against latency --------------------------------------------------------------------


def _milliseconds(text: str) -> list[float]:
    try:
        found = [float(word) for word in text.split(",")]
    except ValueError:
        found = []
    if len(found) < 2 or found != sorted(set(found)) or found[0] < 0:
        raise SettingsError(
            f"latencies {text!r} are not two or more growing numbers [ms], such as 0,100,200"
        )
    return found


def _curve(
    settings: EvaluationSettings,
    latencies: list[float],
    token: str | None,
    resume: bool,
    as_json: bool,
) -> None:
    from robospa.harness.running.request import make_request
    from robospa.results.comparison.latency_curve import curve_table, latency_curve
    from robospa.results.figures.charts import draw_latency_curves
    from robospa.results.figures.series import save, styled
    from robospa.results.records.runs import read_run
    from robospa.results.scoring.models import results_of_run
    from robospa.results.tables import show, to_markdown

    if settings.out is None:
        raise SettingsError("a curve is several runs: name a folder for them with --out")
    times = [f"{latency:g}ms" for latency in latencies]
    timings = [replace(settings.timing, clock=f"real:{text}") for text in times]
    results = []
    for text, timing in zip(times, timings, strict=True):
        folder = settings.out / text
        asked = replace(settings, out=folder, timing=timing)
        going = resume and (folder / "run.json").exists()
        _run_one(make_request(asked, token=token, resume=going), text.replace("ms", " ms"))
        results.append(results_of_run(read_run(folder)))
    curve = latency_curve(results)
    import json

    (settings.out / f"{CURVE}.json").write_text(json.dumps(curve.to_json(), indent=1))
    (settings.out / f"{CURVE}.md").write_text(to_markdown(curve_table(curve)))
    with styled():
        save(draw_latency_curves([curve]), settings.out, CURVE)
    if as_json:
        print_json(curve.to_json())
        return
    show(curve_table(curve))
    print(f"Runs and figure: {settings.out}")


def _run_one(request: Request, what: str) -> None:
    """Evaluate one of several runs, called `what`; its scores are shown later.

    Ends with 130 on Ctrl-C; raises RunAborted, also if trials are missing.
    """
    from robospa.results.records.runs import read_run

    again = "the same command with --resume goes on from here"
    aside(f"{what}:")
    try:
        with resumable(f"the run at {what}", again):
            run_request(request)
    except FilmsInterrupted as error:
        aside(f"robospa: interrupted after the last trial of {what}; {error}; {again}")
        raise typer.Exit(130) from None
    run = read_run(request.config.folder)
    if run.missing:
        raise RunAborted(f"{len(run.missing)} trials at {what} could not be run; {again}")
