"""`robospa report`: runs as tables, figures and a page with every trial and its video; or only
their failures, what is implausible in them, or reasons to doubt them.

What the audit does lies in `robospa.leaderboard`, which is reached by name: the harness is below it
and imports nothing of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.options import AsJson, Token, aside, between, print_json

if TYPE_CHECKING:
    from robospa.results.records.runs import Run

PAPER = "paper"


def report(
    run: Annotated[list[Path], typer.Argument(help="runs, or one folder of runs, side by side")],
    with_published: Annotated[
        bool, typer.Option("--with-published", help="put the four published models beside them")
    ] = False,
    ci: Annotated[str, typer.Option(help="95 % intervals: wilson, exact or bootstrap")] = "wilson",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "--output", help="where to write; default RUN/report; several runs need it"
        ),
    ] = None,
    failures: Annotated[
        bool, typer.Option("--failures", help="only count the types of failure in one run")
    ] = False,
    by: Annotated[
        str, typer.Option(help="with --failures: count by task, category or variant")
    ] = "task",
    trials: Annotated[
        bool, typer.Option("--trials", help="with --failures: list each, with its evidence")
    ] = False,
    safety: Annotated[
        bool,
        typer.Option(
            "--safety", help="only replay the trials and report what they hit, dropped and strained"
        ),
    ] = False,
    film: Annotated[
        bool, typer.Option("--film", help="first make missing videos of failed trials")
    ] = False,
    lint: Annotated[
        bool,
        typer.Option(
            "--lint",
            help='only flag implausible results in the runs, or "paper"; exit code 1 if errors',
        ),
    ] = False,
    audit: Annotated[
        bool,
        typer.Option(
            "--audit", help="only look for signs of cheating in a run or bundle; exit code 1 if any"
        ),
    ] = False,
    reproduction: Annotated[
        Path | None, typer.Option(help="with --audit: the same policy's run on hidden scenes")
    ] = None,
    policy: Annotated[
        str | None,
        typer.Option(help="with --audit: URL of the server, to be queried with swapped sentences"),
    ] = None,
    samples: Annotated[
        int,
        typer.Option(
            callback=between(0, 10_000),
            help="with --audit: trials to hold against the expert's, and to ask --policy for",
        ),
    ] = 10,
    token: Token = None,
    as_json: AsJson = False,
) -> None:
    """Write report.html, report.md, report.json, tables and figures of one or several runs."""
    if lint:
        _lint(run, as_json)
    elif audit:
        _audit(_one(run), reproduction, policy, samples, token, as_json)
    elif safety:
        _safety(_one(run), as_json)
    elif failures or trials:
        _failures(_one(run), by, trials, film, as_json)
    else:
        if film:
            _make_films(_one(run))
        _report(run, with_published, ci, out, as_json)


def _one(runs: Sequence[Path]) -> Path:
    if len(runs) > 1:
        raise ValueError("--failures, --safety, --audit and --film are of one run")
    return runs[0]


def _report(
    folders: Sequence[Path], with_published: bool, ci: str, out: Path | None, as_json: bool
) -> None:
    from robospa.results.paper.published import load
    from robospa.results.records.manifest import MANIFEST
    from robospa.results.records.runs import read_run
    from robospa.results.report.page import write_report
    from robospa.results.report.report import make_report
    from robospa.results.report.run_card import print_scores
    from robospa.results.statistics.intervals import METHODS

    if ci not in METHODS:
        raise ValueError(f"no interval is called {ci!r}; there are {', '.join(METHODS)}")
    if len(folders) == 1 and (inside := sorted(folders[0].glob(f"*/{MANIFEST}"))):
        out, folders = out or folders[0] / "report", [found.parent for found in inside]
    if len(folders) > 1 and out is None:
        raise ValueError("a report of several runs belongs to none of them; say where with --out")
    found = [read_run(folder) for folder in folders]
    published = list(load().models) if with_published else []
    made = make_report(found, published, ci)
    folder = write_report(made, out or folders[0] / "report")
    if as_json:
        from robospa.harness.cli.eval import run_data

        runs = {str(one.folder): run_data(one) for one in found}
        print_json({"report": folder / "report.html", "runs": runs})
        return
    for one, model in zip(made.runs, made.models, strict=False):
        print_scores(one, model)
    print(f"Report: {folder / 'report.html'}")


def _failures(folder: Path, by: str, trials: bool, film: bool, as_json: bool) -> None:
    from robospa.results.failures.labels import (
        counts_table,
        distribution,
        failed_trials,
    )
    from robospa.results.records.action_problems import problem_lines
    from robospa.results.records.runs import read_run
    from robospa.results.tables import show

    found = _make_films(folder) if film else read_run(folder)
    records = list(found.records.values())
    failed, counts = failed_trials(records), distribution(records, by)
    if as_json:
        print_json(failed if trials else counts)
        return
    show(failed.table(len(failed)) if trials else counts_table(counts, by))
    if trials:
        return
    print(f"\n{len(failed)} failed trials of {len(found.keys)}, {len(found.missing)} missing")
    for line in problem_lines(records):
        print(line)


def _safety(folder: Path, as_json: bool) -> None:
    from robospa.harness.safety import measure
    from robospa.results.records.runs import read_run

    made = measure(read_run(folder))
    if as_json:
        print_json({key.slug: one for key, one in made.found.items()})
        return
    print(made)
    print(f"Kept in {folder}: robospa report {quote(str(folder))} shows it beside the scores")


def _make_films(folder: Path) -> Run:
    """The run in `folder`, with the films that it lacked; ends the program with 130 on Ctrl-C."""
    from robospa.harness.running.films import FilmsInterrupted, film_now
    from robospa.results.records.runs import read_run

    try:
        for text in film_now(read_run(folder)):
            aside(text)
    except FilmsInterrupted as error:
        aside(f"robospa: interrupted; {error}")
        raise typer.Exit(130) from None
    return read_run(folder)


def _lint(folders: Sequence[Path], as_json: bool) -> None:
    from robospa.results.lint import SEVERITIES, lint_actions, lint_published, lint_run, lint_runs
    from robospa.results.records.runs import read_run
    from robospa.tasks.catalog import tasks

    known = {(name, level) for name in tasks() for level in range(1, 6)}
    found = lint_published() if Path(PAPER) in folders else []
    read = [read_run(folder) for folder in folders if folder != Path(PAPER)]
    for run in read:
        found += lint_run(run, known) + lint_actions(run)
    if len(read) > 1:
        found += lint_runs(read)
    found.sort(key=lambda f: SEVERITIES.index(f.severity))
    counts = {f"{kind}s": sum(f.severity == kind for f in found) for kind in SEVERITIES}
    if as_json:
        print_json({**counts, "findings": found})
    else:
        shown = {name: n for name, n in counts.items() if n or name != "notes"}
        print(*found, ", ".join(f"{n} {name}" for name, n in shown.items()), sep="\n")
    if counts["errors"]:
        raise typer.Exit(1)


def _audit(
    run: Path,
    reproduction: Path | None,
    policy: str | None,
    samples: int,
    token: str | None,
    as_json: bool,
) -> None:
    from robospa.harness.factory import load_function

    check = load_function("robospa.leaderboard.audit:audit")
    findings = check(run, reproduction, policy, samples, token)
    if as_json:
        print_json(findings)
    for one in [] if as_json else findings:
        print(f"{'SUSPICIOUS' if one.suspicious else 'ok':10} {one.check}: {one.sentence}")
    if any(one.suspicious for one in findings):
        raise typer.Exit(1)
