"""`robospa official`: the official assets, sentences and simulator, from the user's own copies."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.options import TRIALS, AsJson, aside, print_json
from robospa.text import plain_console
from robospa.trial import REFERENCE

if TYPE_CHECKING:
    from robospa.harness.official.checkout_world import CheckoutWorld
    from robospa.harness.packs.index import Index
    from robospa.trial import TrialKey

MOST_FAULTS = 20
"""Sentences about models that are printed; --json has all."""
MARKS = {True: "ok", False: "LOOK", None: "see"}
MOST_SEEDS = 20
"""Seeds tried for each that has to be valid."""

official = typer.Typer(
    help="Use the official assets, sentences or simulator of your own copy.",
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
    from robospa.harness.packs.index import index

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
    many of the test templates stand in training too; ends with 1 if a variant has none that fits.
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


# -- simulator ----------------------------------------------------------------------------------


@official.command()
def checkout(
    folder: Annotated[str, typer.Argument(help="the checkout: DIR or DIR?python=PATH&...")],
    task: Annotated[str, typer.Option(help="the task to look at")] = "Click_Bell_Repeat",
    level: Annotated[int, typer.Option(min=1, max=5, help="its level")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="the first seed to try")] = 100_000,
    embodiment: Annotated[str, typer.Option(help="the robot")] = REFERENCE,
    mode: Annotated[str, typer.Option(help="clean or randomized")] = "clean",
    find: Annotated[
        Path | None, typer.Option(help="write the valid seeds to this file, for eval --seeds")
    ] = None,
    tasks: Annotated[str, typer.Option(help="with --find: tasks, categories, or all")] = "all",
    levels: Annotated[str, typer.Option(help="with --find: such as 1,3-5")] = "1-5",
    trials: Annotated[
        int, typer.Option(callback=TRIALS, help="with --find: valid seeds a variant")
    ] = 100,
    as_json: AsJson = False,
) -> None:
    """Look at what a checkout does before anything is evaluated in it; ends with 1 if it differs.

    With --find, try seeds one after another as the official evaluation does. What is found is on
    disk after every variant, and is not looked for again.
    """
    from robospa.harness.official.checkout import PREFIX, parse_checkout
    from robospa.harness.official.checkout_world import CheckoutWorld, examine
    from robospa.harness.selection import parse_levels, parse_tasks
    from robospa.protocol.options import plain_options
    from robospa.trial import TrialKey

    path, options = parse_checkout(f"{PREFIX}{folder}")
    wanted = [(t, n) for t in parse_tasks(tasks) for n in parse_levels(levels)]
    world = CheckoutWorld(str(path), **plain_options(options))
    try:
        if find is not None:
            like = TrialKey("", 1, seed, embodiment, mode)
            _find(world, find, wanted, like, trials, aside if as_json else print)
            if as_json:
                print(find.read_text())
            return
        findings = []
        for one in examine(world, TrialKey(parse_tasks(task)[0], level, seed, embodiment, mode)):
            findings.append(one)
            if not as_json:
                print(f"{MARKS[one.good]:5}{one.what}: {one.seen}")
    finally:
        world.close()
    if as_json:
        print_json(findings)
    if any(one.good is False for one in findings):
        raise typer.Exit(1)


def _find(
    world: CheckoutWorld,
    file: Path,
    variants: Sequence[tuple[str, int]],
    like: TrialKey,
    count: int,
    say: Callable[[str], None],
) -> None:
    from robospa.harness.official.checkout_world import valid_seeds
    from robospa.harness.running.atomic_file import replace_file
    from robospa.schema import parse_json

    known = parse_json(file.read_text()) if file.exists() else {}
    for task, level in variants:
        if len(known.get(task, {}).get(str(level), ())) >= count:
            continue
        seeds = range(like.seed, like.seed + MOST_SEEDS * count)
        found = valid_seeds(world, replace(like, task=task, level=level), seeds, count, _tell)
        known.setdefault(task, {})[str(level)] = found
        replace_file(file, json.dumps(known, indent=1).encode())
        say(f"{task} level {level}: {len(found)} seeds, {found[-1] - found[0] + 1} tried")


def _tell(seed: int, trouble: str) -> None:
    if trouble:
        aside(f"robospa: {trouble}")
