"""`robospa learn`: train a policy of our own; look at how it went."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

learn = typer.Typer(
    help="Train a policy of our own on data sets of robospa collect.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@learn.command(no_args_is_help=True)
def train(
    learner: Annotated[
        str, typer.Argument(help="what is trained: act, maps, or another installed one")
    ],
    data: Annotated[
        list[Path] | None, typer.Argument(help="folders of data sets of robospa collect")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="folder of the checkpoint")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="go on from the checkpoint in --out")
    ] = False,
    option: Annotated[
        list[str] | None, typer.Option("--option", help="NAME=VALUE of the learner; repeatable")
    ] = None,
    show_options: Annotated[
        bool, typer.Option("--show-options", help="list the learner's options and stop")
    ] = False,
) -> None:
    """Train a policy; robospa serve learned CKPT serves it, also while training goes on.

    It is saved now and then: after Ctrl-C, or whatever else, the same command with --resume goes on
    from there.
    """
    from robospa.harness.cli.serve import option_pairs, print_options
    from robospa.harness.settings import SettingsError
    from robospa.protocol.options import option_table, read_options
    from robospa.registry import LEARNERS, find

    found = find(LEARNERS, learner, "learner")
    if show_options:
        return print_options(option_table(found.options))
    if not data:
        raise SettingsError("name the folders of one or more data sets of robospa collect")
    if out is None:
        raise SettingsError("name a folder for the checkpoint with --out")
    options = read_options(found.options, option_pairs(option or []))
    again = f"the same command with --resume goes on from the last checkpoint in {out}"
    try:
        found.train(data, out, resume, options)
    except KeyboardInterrupt:
        print(f"robospa: interrupted; {again}", file=sys.stderr)
        raise typer.Exit(130) from None
    print(f"{out}: trained; robospa serve learned {out} serves it")


@learn.command(no_args_is_help=True)
def curve(
    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="COUNT=RUN...", help="demonstrations a variant, and the run of what they taught"
        ),
    ],
    out: Annotated[Path, typer.Option(help="the figure: a name that ends in svg, png or pdf")],
    metric: Annotated[str, typer.Option(help="sr, onta or ps")] = "sr",
) -> None:
    """Draw success against the number of demonstrations, and against the level, with intervals.

    robospa learn curve 50=runs/act-50 250=runs/act-250 1000=runs/act-1000 --out curve.png
    """
    from robospa.harness.settings import SettingsError
    from robospa.results.figures.curves import CurvePoint, draw_learning_curve
    from robospa.results.figures.series import FORMATS, save, styled
    from robospa.results.records.runs import read_run
    from robospa.results.scoring.scores import score_run

    ending = out.suffix.removeprefix(".")
    if ending not in FORMATS:
        raise SettingsError(f"{out} does not end in one of {', '.join(FORMATS)}")
    points = []
    for word in runs:
        count, equals, folder = word.partition("=")
        if not equals or not count.isdecimal() or int(count) < 1:
            raise SettingsError(f"{word!r} is not COUNT=RUN, such as 250=runs/act-250")
        points.append(CurvePoint(int(count), score_run(read_run(Path(folder)))))
    if len({point.demonstrations for point in points}) < len(points):
        raise SettingsError("two runs have the same number of demonstrations: name one of them")
    with styled():
        figure = draw_learning_curve(points, metric)
        save(figure, out.parent, out.stem, (ending,))
    print(out)
