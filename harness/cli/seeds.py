"""`robospa seeds`: make lists of accepted seeds, or measure the expert on other seeds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.options import PROCESSES, SEED, TRIALS
from robospa.text import plain_console
from robospa.trial import REFERENCE

if TYPE_CHECKING:
    from robospa.tasks.seeds import ListKey


def seeds(
    tasks: Annotated[str, typer.Argument(help="task names, comma separated, or `all`")],
    levels: Annotated[str, typer.Option(help="such as 1,3-5")] = "1-5",
    embodiment: Annotated[str, typer.Option(help="robots, comma separated, or `all`")] = REFERENCE,
    mode: Annotated[str, typer.Option(help="scene mode")] = "clean",
    start: Annotated[int, typer.Option(callback=SEED, help="first seed to try")] = 100_000,
    count: Annotated[int, typer.Option(callback=TRIALS, help="seeds per variant")] = 100,
    workers: Annotated[
        int, typer.Option(callback=PROCESSES, help="processes; 0 for as many as cores")
    ] = 0,
    out: Annotated[
        Path | None, typer.Option(help="folder of the lists; default: this user's own")
    ] = None,
    check: Annotated[
        bool, typer.Option(help="write no list; show how many of `count` seeds are solved")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="print the lists as JSON, not as sentences")
    ] = False,
) -> None:
    """List the first `count` seeds from `start` whose scene settles and that the expert solves.

    `robospa eval` finds the lists. Each finished trial is kept: the same command continues where
    it was stopped.
    """
    from robospa.harness.running.status import cores
    from robospa.harness.seeds.attempt import Evidence, searches, sweep_with_bar
    from robospa.harness.seeds.lists import local_file, local_folder, save
    from robospa.harness.selection import (
        canonical_mode,
        parse_embodiments,
        parse_levels,
        parse_tasks,
    )
    from robospa.tasks.modes import tangible
    from robospa.tasks.seeds import FIRST_SEED, ListKey

    if start != FIRST_SEED and not check and out is None:
        raise typer.BadParameter(
            f"lists that evaluations find start at {FIRST_SEED}: give --check or --out as well"
        )
    scenes = tangible(canonical_mode(mode))
    keys = [
        ListKey(name, level, robot, scenes)
        for robot in parse_embodiments(embodiment)
        for name in parse_tasks(tasks)
        for level in parse_levels(levels)
    ]
    if not check:
        missing = [key for key in keys if not _is_there(key, count, out)]
        if len(missing) < len(keys) and not as_json:
            print(f"{len(keys) - len(missing)} of {len(keys)} lists are there already")
        keys = missing
    console, solved = plain_console(quiet=as_json), True
    rows: list[dict[str, object]] = []
    evidence = Evidence(local_folder() / "attempts")
    wanted = searches(keys, start, count, evidence, measure=check)
    for search in sweep_with_bar(wanted, workers or cores(), evidence):
        key, found = search.key, search.accepted
        text = f"{key}: {len(found)} of {len(search.row())} seeds accepted"
        if not check and search.given_up:
            solved = False
            text += "; the expert does not solve it, so there is no list"
        elif not check:
            save(local_file(key) if out is None else out / key.file, key.level, found)
        console.print(text)
        for item in search.refused:
            console.print(f"  seed {item.seed}: {item.reason}")
        refused = [{"seed": item.seed, "reason": item.reason} for item in search.refused]
        rows.append({**key._asdict(), "accepted": list(found), "refused": refused})
    if as_json:
        print(json.dumps(rows, indent=1))
    if not solved:
        raise typer.Exit(1)


def _is_there(key: ListKey, count: int, folder: Path | None) -> bool:
    from robospa.harness.seeds.lists import SHIPPED, find_list, read_levels
    from robospa.tasks.seeds import NoSeedList

    if folder is not None:
        return len(read_levels(folder / key.file).get(key.level, ())) >= count
    try:
        found = find_list(key)
    except NoSeedList:
        return False
    if found.origin == SHIPPED and len(found.seeds) < count:
        raise typer.BadParameter(
            f"{key} has a shipped list of {len(found.seeds)} seeds, and evaluations find no longer "
            "one: give --check or --out as well"
        )
    return len(found.seeds) >= count
