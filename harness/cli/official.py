"""`robospa official`: the official assets and sentences, from the user's own copies."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.options import AsJson, print_json
from robospa.text import plain_console

if TYPE_CHECKING:
    from robospa.harness.packs.official import Index

MOST_FAULTS = 20
"""Sentences about models that are printed; --json has all."""

official = typer.Typer(
    help="Use the official assets or sentences of your own copy.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


# -- assets -------------------------------------------------------------------------------------


@official.command()
def assets(
    folder: Annotated[
        Path | None,
        typer.Argument(
            help="where objects, embodiments and background_texture were unpacked; default: "
            "$ROBOSPA_ASSETS, or as added"
        ),
    ] = None,
    add: Annotated[
        bool, typer.Option("--add", help="use FOLDER from now on; nothing is copied")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """List what a folder of official assets holds and which tasks run with it.

    Lengths, counts and sizes of all files are checked; of meshes only what collides of bins,
    baskets, bowls and cups is read, to see whether they are hollow.
    """
    from dataclasses import asdict

    from robospa.harness.packs.archive import note, open_archive
    from robospa.harness.packs.official import index

    archive = open_archive(folder)
    if add:
        note(archive)
    found = index(archive)
    if as_json:
        print_json({**asdict(found), "summary": found.summary()})
    else:
        _print(found)


def _print(found: Index) -> None:
    from rich.table import Table

    from robospa.harness.robots import embodiments
    from robospa.tasks.official import needs

    table = Table("official assets", "found", "of", box=None, pad_edge=False)
    table.columns[1].justify = table.columns[2].justify = "right"
    table.add_row("models of objects", str(found.models - len(found.faults)), str(found.models))
    table.add_row("robots", str(len(found.robots)), str(len(embodiments())))
    for split, count in found.textures.items():
        table.add_row(f"background pictures, {split}", str(count), "")
    table.add_row("kinds of clutter", str(found.clutter), "")
    table.add_row("tasks that can run", str(found.runnable), str(len(needs())))
    console = plain_console()
    console.print(f"{found.root}, digest {found.digest}")
    console.print(table)
    for fault in list(found.faults.values())[:MOST_FAULTS]:
        console.print(fault)
    if len(found.faults) > MOST_FAULTS:
        console.print(f"and {len(found.faults) - MOST_FAULTS} models more; --json lists them")
    if found.filled:
        console.print(found.filled_text())
    console.print(found.summary())


# -- sentences ----------------------------------------------------------------------------------


@official.command()
def instructions(
    checkout: Annotated[Path, typer.Argument(help="folder with description/ of RoboSPA")],
    tasks: Annotated[
        str, typer.Option(help="task names, categories, spatial, procedural, or all")
    ] = "all",
    levels: Annotated[str, typer.Option(help="such as 1,3-5")] = "1-5",
    seed: Annotated[int, typer.Option(min=0, help="scene that the sentences are filled for")] = (
        100_000
    ),
    as_json: AsJson = False,
) -> None:
    """Show, for every variant, an official test sentence, how many templates fit its scene, and how
    many of the test templates also occur in training; exit code 1 if a variant has none that fits.
    """
    from robospa.harness.official.sentences import read_checkout, sentence_of, survey
    from robospa.harness.selection import parse_levels, parse_tasks

    variants = [(task, level) for task in parse_tasks(tasks) for level in parse_levels(levels)]
    sentences = read_checkout(checkout, variants)
    rows = survey(sentences, variants, seed)
    if as_json:
        print_json(rows)
    else:
        for row in rows:
            print(row)
        print(sentence_of(sentences))
    if any(row.trouble for row in rows):
        raise typer.Exit(1)
