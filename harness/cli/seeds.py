"""`robospa seeds`: make the accepted-seed lists, or measure the expert on other seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def seeds(
    tasks: Annotated[str, typer.Argument(help="task names, comma separated, or `all`")] = "all",
    levels: Annotated[str, typer.Option(help="such as 1,3-5")] = "1-5",
    start: Annotated[int, typer.Option(help="first seed to try")] = 100_000,
    count: Annotated[int, typer.Option(help="seeds per variant")] = 100,
    workers: Annotated[int, typer.Option(help="processes")] = 2,
    out: Annotated[Path, typer.Option(help="folder of the seed lists")] = Path("tasks/seeds"),
    check: Annotated[
        bool, typer.Option(help="write nothing; show how many of `count` seeds are solved")
    ] = False,
    fresh: Annotated[bool, typer.Option(help="make lists anew that are already there")] = False,
) -> None:
    """Accept the first `count` seeds from `start` that settle and that the expert solves."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    from robospa.harness import seeds as lists
    from robospa.harness.cli.selection import parse_levels, parse_tasks

    console = Console()
    names, wanted = parse_tasks(tasks), parse_levels(levels)
    variants = [(n, k) for n in names for k in wanted]
    if not check and not fresh:
        variants = [(n, k) for n, k in variants if k not in lists.stored_levels(out, n)]
    bar = Progress("{task.description}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    failed = 0
    with bar, lists.Sweep(workers) as sweep:
        for name, level in variants:
            row = bar.add_task(f"{name} L{level}", total=count)

            def advance(n: int, row: object = row) -> None:
                bar.advance(row, n)  # type: ignore[arg-type]

            if check:
                tried = sweep.try_seeds(name, level, list(range(start, start + count)), advance)
                refused = [a for a in tried if not a.accepted]
                text = f"{name} L{level}: {count - len(refused)} of {count} solved"
            else:
                try:
                    found, refused = sweep.first_accepted(name, level, start, count, advance)
                except RuntimeError as trouble:
                    console.print(f"[red]{trouble}")
                    failed += 1
                    continue
                lists.save(out, name, level, found)
                text = f"{name} L{level}: {count} of {count + len(refused)} accepted"
            bar.remove_task(row)
            console.print(text)
            for item in refused:
                console.print(f"  seed {item.seed}: {item.why}")
    if failed:
        raise typer.Exit(1)
