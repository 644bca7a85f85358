"""`robospa latency`: success of one policy against the latency of its answers, in one command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.settings_flags import MoreServers, Token, given_flags, with_flags
from robospa.harness.settings import GROUPS, EvaluationSettings, SettingsError, updated
from robospa.harness.settings_file import read_settings

if TYPE_CHECKING:
    from robospa.results.comparison.latency_curve import LatencyCurve

NAME = "success-latency"
"""Of the files beside the runs."""


@with_flags([EvaluationSettings, *GROUPS.values()], without=["policy", "clock"], hidden=["parts"])
def latency(
    context: typer.Context,
    policy: Annotated[
        str, typer.Argument(help="a server's URL, or a local policy's name or module:Class")
    ],
    latencies: Annotated[
        str, typer.Option(help="milliseconds, the lowest first: a run for each")
    ] = "0,100,200,400,1000",
    more: MoreServers = None,
    config: Annotated[
        Path | None, typer.Option(help="TOML or JSON file of settings; flags win over it")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on with the runs in --out")] = False,
    token: Token = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="print the curve as JSON, not as a table")
    ] = False,
    **given: object,
) -> None:
    """Evaluate a policy in real time at several declared latencies, on the same trials.

    Every latency is a run of its own in --out; beside them are the table and the figure of success
    against latency. After Ctrl-C, the same command with --resume continues.
    """
    from robospa.harness.cli.running import evaluate_quietly
    from robospa.harness.running.request import make_request

    settings = EvaluationSettings() if config is None else read_settings(config)
    changes = {name: value for name, value in given_flags(context).items() if name in given}
    settings = updated(settings, {**changes, "policy": [policy, *(more or ())]})
    if settings.out is None:
        raise SettingsError("a curve is several runs: name a folder for them with --out")
    folders = []
    for milliseconds in _milliseconds(latencies):
        folder = settings.out / f"{milliseconds:g}ms"
        timing = replace(settings.timing, clock=f"real:{milliseconds:g}ms")
        going = resume and (folder / "run.json").exists()
        asked = replace(settings, out=folder, timing=timing)
        evaluate_quietly(make_request(asked, token=token, resume=going), f"{milliseconds:g} ms")
        folders.append(folder)
    _show(curve_of(folders), settings.out, as_json)


def _milliseconds(text: str) -> list[float]:
    """The latencies; SettingsError unless these are two growing numbers or more."""
    try:
        found = [float(word) for word in text.split(",")]
    except ValueError:
        found = []
    if len(found) < 2 or found != sorted(set(found)) or found[0] < 0:
        raise SettingsError(
            f"latencies {text!r} are no growing milliseconds, two or more, such as 0,100,200"
        )
    return found


def curve_of(folders: list[Path]) -> LatencyCurve:
    """The curve of finished runs."""
    from robospa.results.comparison.latency_curve import latency_curve
    from robospa.results.records.run_io import read_run
    from robospa.results.scoring.model_results import results_of_run

    return latency_curve([results_of_run(read_run(folder)) for folder in folders])


def _show(curve: LatencyCurve, out: Path, as_json: bool) -> None:
    """Print the curve; write it beside the runs, as JSON, Markdown and a figure."""
    from robospa.results.comparison.latency_curve import curve_table
    from robospa.results.figures.curves import draw_latency_curves
    from robospa.results.figures.series import save, styled
    from robospa.results.tables import show, to_markdown

    data = json.dumps(curve.to_json(), indent=1)
    (out / f"{NAME}.json").write_text(data)
    (out / f"{NAME}.md").write_text(to_markdown(curve_table(curve)))
    with styled():
        save(draw_latency_curves([curve]), out, NAME)
    if as_json:
        print(data)
        return
    show(curve_table(curve))
    print(f"Runs and figure: {out}")
