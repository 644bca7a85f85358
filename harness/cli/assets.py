"""`robospa assets`: the user's copy of the official assets, and what can run with it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.terminal import plain_console

if TYPE_CHECKING:
    from robospa.harness.packs.archive import Archive
    from robospa.harness.packs.index import Index

MOST_FAULTS = 20
"""Sentences about models that are printed; --json has all."""

assets = typer.Typer(
    help="Name a folder of official assets; list what it holds and which tasks run with it.",
    rich_markup_mode=None,
)
Folder = Annotated[
    Path | None,
    typer.Option("--assets", help="the folder; default: $ROBOSPA_ASSETS, or as added"),
]


@assets.callback(invoke_without_command=True)
def list_assets(
    context: typer.Context,
    folder: Folder = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Name a folder of official assets; list what it holds and which tasks run with it.

    Lengths, counts and sizes of all files are checked; of meshes only what collides of bins,
    baskets, bowls and cups is read, to see whether they are hollow.
    """
    if context.invoked_subcommand is None:
        from robospa.harness.packs.archive import open_archive

        _show(open_archive(folder), as_json)


@assets.command()
def add(
    folder: Annotated[
        Path,
        typer.Argument(help="where objects, embodiments and background_texture were unpacked"),
    ],
) -> None:
    """Use the assets in FOLDER from now on; nothing is copied, and nothing is written there."""
    from robospa.harness.packs.archive import note, open_archive

    archive = open_archive(folder)
    note(archive)
    _show(archive, as_json=False)


def _show(archive: Archive, as_json: bool) -> None:
    from dataclasses import asdict

    from robospa.harness.packs.index import index

    found = index(archive)
    if as_json:
        import json

        print(json.dumps({**asdict(found), "summary": found.summary()}, indent=1))
        return
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
