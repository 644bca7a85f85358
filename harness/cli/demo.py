"""`robospa demo`: an oracle server on loopback, evaluated over the wire, ten tasks of the 56.

Shows the whole way in a minute or two: server, handshake, seeded trials, records, table, report
with videos. The learned reference follows, if torch is installed and time is left, and shows how it
fails; without torch arms that move at random, on some of the same trials.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.options import PROCESSES, SECONDS, TRIALS

if TYPE_CHECKING:
    from robospa.harness.settings import Selection

START_SECONDS = 60.0
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
    levels: Annotated[str, typer.Option(help="such as 1,3-5")] = "1,3,5",
    trials: Annotated[int, typer.Option(callback=TRIALS, help="trials per variant")] = 1,
    workers: Annotated[
        int, typer.Option(callback=PROCESSES, help="worker processes; 0 for one per core")
    ] = 0,
    video: Annotated[str, typer.Option(help="as in `robospa eval`")] = "first",
    contrast: Annotated[bool, typer.Option(help="also evaluate the learned policy")] = True,
    seconds: Annotated[
        float, typer.Option(callback=SECONDS, help="leave the contrast out after that time")
    ] = 75.0,
) -> None:
    """See a policy server evaluated: trials of each category, a table, a report with videos."""
    from robospa.harness.running.request import new_folder
    from robospa.harness.selection import parse_levels, parse_tasks

    started = time.monotonic()
    folder = out or new_folder("demo")
    names = parse_tasks(",".join(SAMPLE) if tasks == "sample" else tasks)
    page = _evaluate("oracle", _select(names, levels, trials), folder / "oracle", workers, video)
    # At random the tasks with the shortest trials: one pick each.
    learned = find_spec("torch") is not None
    short = names if learned else [name for name in names if name in parse_tasks("spatial")]
    if contrast and short and time.monotonic() - started < seconds:
        chosen = _select(short, str(max(parse_levels(levels))), trials)
        policy, what = (
            ("learned", "the learned reference") if learned else ("random", "random motion")
        )
        print(f"\nFor contrast, some of the same trials with {what}:")
        _evaluate(policy, chosen, folder / policy, workers, video if learned else "none")
    print(f"\nDone in {time.monotonic() - started:.0f} s. Open {page} in a browser.")


def _select(names: Sequence[str], levels: str, trials: int) -> Selection:
    from robospa.harness.selection import list_trials
    from robospa.harness.settings import Selection, SettingsError

    shipped = Selection(tasks=",".join(names), levels=levels, trials=trials)
    try:
        list_trials(shipped)
    except SettingsError:
        return replace(shipped, seeds=f"100000-{99999 + trials}")
    return shipped


def _evaluate(policy: str, chosen: Selection, folder: Path, workers: int, video: str) -> Path:
    """Serve `policy`, evaluate it over the wire, print its table; returns the report's page."""
    from robospa.harness.cli.eval import run_and_show
    from robospa.harness.running.request import make_request
    from robospa.harness.settings import Compute, Connection, EvaluationSettings, Recording
    from robospa.results.records.runs import read_run
    from robospa.results.report.page import write_report
    from robospa.results.report.report import make_report

    with server(policy) as url:
        print(f"`robospa serve {policy}` listens at {url}; evaluating it over the wire", flush=True)
        settings = EvaluationSettings(
            policy=(url,),
            out=folder,
            selection=chosen,
            connection=Connection(timeout=60.0, first_timeout=60.0, wait=10.0, patience=10.0),
            compute=Compute(workers=workers),
            recording=Recording(video=video),
        )
        run_and_show(make_request(settings, arguments={"command": "demo"}))
    return write_report(make_report(read_run(folder)), folder / "report") / "report.html"


@contextmanager
def server(policy: str) -> Iterator[str]:
    """`robospa serve POLICY` in a process of its own on a free port of loopback; yields the URL."""
    words = [sys.executable, "-m", "robospa.harness.cli.main", "serve", policy, "--port", "0"]
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(words, stdout=output, stderr=subprocess.STDOUT)
        try:
            yield _url(process, output)
        finally:
            process.terminate()
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _url(process: subprocess.Popen[bytes], output: IO[str]) -> str:
    until = time.monotonic() + START_SECONDS
    while time.monotonic() < until:
        output.seek(0)
        text = output.read()
        found = [word for word in text.split() if word.startswith("ws://")]
        if found and text.endswith("\n"):
            return str(found[0])
        if process.poll() is not None:
            raise ServerFailed(f"the policy server ended before it was ready: {text.strip()}")
        time.sleep(0.05)
    raise ServerFailed(f"the policy server was not ready after {START_SECONDS:g} s")


class ServerFailed(Exception):
    """The demo's policy server did not start."""
