"""`robospa demo`: two policy servers on loopback, evaluated over the wire in ten tasks of the 56.

Shows the whole way in a minute or two: server, handshake, seeded trials, records, tables, films, a
report. First a policy that makes the mistakes of the paper's analysis, then the expert in the same
scenes, and one page of both.
"""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.options import PROCESSES, TRIALS

if TYPE_CHECKING:
    from robospa.harness.settings import Selection
    from robospa.results.records.runs import Run
    from robospa.trial import TrialKey

SAMPLE = (
    "Pick_Blocks_Size", "Pick_Mixed_Objects_Distance_B", "Pick_Mixed_Objects_Canonical_A",
    "Pick_Soaps_Relational", "Pick_Mixed_Objects_Multi_View_A", "Press_Stapler_Repeat",
    "Put_Bottles_Dustbin", "Stack_Blocks_Color_Order", "Click_Can_Place_Items",
    "Remember_Color_Cover",
)  # fmt: skip
"""One task of each category."""


def demo(
    out: Annotated[Path | None, typer.Option(help="folder; default runs/demo-<time>")] = None,
    tasks: Annotated[
        str, typer.Option(help="as in `robospa eval`; `sample` is one of each category")
    ] = "sample",
    levels: Annotated[str, typer.Option(help="such as 1,3-5")] = "1,3",
    trials: Annotated[int, typer.Option(callback=TRIALS, help="trials per variant")] = 1,
    workers: Annotated[
        int, typer.Option(callback=PROCESSES, help="worker processes; 0 for one per core")
    ] = 0,
    films: Annotated[
        int,
        typer.Option(min=0, help="mistakes to film, of different types, each beside the expert"),
    ] = 3,
) -> None:
    """Evaluate two policies over the wire; write a report of both, with videos."""
    from robospa.harness.running.request import new_folder
    from robospa.harness.selection import parse_levels, parse_tasks
    from robospa.results.records.runs import read_run
    from robospa.results.report.page import write_report
    from robospa.results.report.report import make_report

    started = time.monotonic()
    folder = out or new_folder("demo")
    names = parse_tasks(",".join(SAMPLE) if tasks == "sample" else tasks)
    parse_levels(levels)
    chosen = _select(names, levels, trials)
    folders = {"mistakes": folder / "mistakes", "oracle": folder / "oracle"}
    _evaluate("mistakes", {"kind": "all"}, chosen, folders["mistakes"], workers)
    _evaluate("oracle", {}, chosen, folders["oracle"], workers)
    _film([read_run(each) for each in folders.values()], films)
    report = make_report([read_run(each) for each in folders.values()])
    page = write_report(report, folder / "report") / "report.html"
    print(f"\nDone in {time.monotonic() - started:.0f} s. Both runs are on one page:")
    print(f"    python3 -m webbrowser {page.resolve().as_uri()}")
    if shutil.which("robospa") is None:
        print(f"    source {Path(sys.prefix) / 'bin' / 'activate'}   # then `robospa` is a command")


def _select(names: Sequence[str], levels: str, trials: int) -> Selection:
    from robospa.harness.selection import list_trials
    from robospa.harness.settings import Selection, SettingsError

    shipped = Selection(tasks=",".join(names), levels=levels, trials=trials)
    try:
        list_trials(shipped)
    except SettingsError:
        return replace(shipped, seeds=f"100000-{99999 + trials}")
    return shipped


def _film(runs: Sequence[Run], most: int) -> None:
    """Film `most` failures of the first of `runs`, each of another type, and what the others did
    in the same scenes."""
    from robospa.harness.progress import Progress
    from robospa.harness.running.films import Films, finish_films, replay_config
    from robospa.results.failures.labels import label

    kinds: dict[str, TrialKey] = {}
    for key, record in sorted(runs[0].records.items()):
        if failure := label(record):
            kinds.setdefault(failure.kind, key)
    keys = list(kinds.values())[:most]
    for run in runs:
        films = Films(replay_config(run), nice=0)
        films.add(run.records[key] for key in keys)
        for line in finish_films(films, Progress(len(run.keys), len(run.keys))):
            print(line)


def _evaluate(
    policy: str, options: dict[str, object], chosen: Selection, folder: Path, workers: int
) -> None:
    """Serve `policy`, evaluate it over the wire, print its table."""
    from robospa.harness.cli.eval import run_and_show
    from robospa.harness.cli.serve import hosted
    from robospa.harness.factory import policy_factory
    from robospa.harness.running.request import make_request
    from robospa.harness.settings import Compute, Connection, EvaluationSettings, Simulation
    from robospa.protocol.server import ServerThread

    with ServerThread(**hosted(policy, policy_factory(policy), options)) as server:
        print(f"\n`robospa serve {policy}` listens at {server.url}; it is evaluated:", flush=True)
        settings = EvaluationSettings(
            policy=(server.url,),
            out=folder,
            selection=chosen,
            simulation=Simulation(run_seed="demo"),  # the same mistakes for everybody
            connection=Connection(timeout=60.0, first_timeout=60.0, wait=10.0, patience=10.0),
            compute=Compute(workers=workers),
        )
        run_and_show(make_request(settings, arguments={"command": "demo"}))
