"""`robospa learn`: train the learned reference anew."""

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from robospa.harness.cli.options import aside


def learn(
    out: Annotated[Path, typer.Argument(help="folder of the weights; the same one goes on")] = Path(
        "runs/learned"
    ),
    option: Annotated[
        list[str] | None, typer.Option("--option", help="NAME=VALUE of the training; repeatable")
    ] = None,
    show_options: Annotated[
        bool, typer.Option("--show-options", help="list these options and exit")
    ] = False,
) -> None:
    """Train the policy that `robospa serve learned` serves; robospa serve learned OUT serves it.

    It is saved now and then: after Ctrl-C, or whatever else, the same command goes on from there.
    """
    from robospa.harness.cli.serve import option_pairs, print_options
    from robospa.protocol.options import option_table, read_options
    from robospa.registry import load

    kind = load("robospa.baselines.learned.train:TrainOptions")
    if show_options:
        return print_options(option_table(kind))
    options = read_options(kind, option_pairs(option or []))
    try:
        load("robospa.baselines.learned.train:train")(out, options)
    except KeyboardInterrupt:
        aside(f"robospa: interrupted; the same command goes on in {out}")
        raise typer.Exit(130) from None
    print(f"{out}: trained; robospa serve learned {quote(str(out))} serves it")
