"""`robospa paper`: the paper's tables recomputed, with the printed values that do not follow."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robospa.harness.cli.options import AsJson, print_json


def paper(
    out: Annotated[Path, typer.Option(help="folder to write to")] = Path("paper"),
    format: Annotated[str, typer.Option(help="md, tex, html, csv or all")] = "all",
    table: Annotated[
        list[str] | None, typer.Option(help="only this table (may be repeated); default all")
    ] = None,
    run: Annotated[
        list[Path] | None,
        typer.Option(help="folder of a run to show beside them (may be repeated)"),
    ] = None,
    figures: Annotated[bool, typer.Option(help="draw the figures too; takes a while")] = True,
    mark: Annotated[
        str, typer.Option(help="bold: tied (all not told from the best), highest or none")
    ] = "tied",
    as_json: AsJson = False,
) -> None:
    """Write every table and figure of the paper, made from its per-task results.

    Prints the first of them (the main one) and all printed values that cannot be reproduced.
    """
    from robospa.results.paper.check import checks, errata
    from robospa.results.paper.columns import (
        Column,
        published_results,
        results_beside_runs,
        run_column,
    )
    from robospa.results.paper.origin import banner
    from robospa.results.paper.published import load
    from robospa.results.paper.tables import FORMATS, like_paper, make_tables, write_tables
    from robospa.results.records.runs import by_setting, read_run
    from robospa.results.tables import show

    endings = list(FORMATS) if format == "all" else [format]
    if format != "all" and format not in FORMATS:
        raise ValueError(f"no format is called {format!r}; there are {', '.join(FORMATS)} and all")
    runs = [part for folder in run or [] for part in by_setting(read_run(folder))]
    added = [run_column(one) for one in runs]
    of_model = results_beside_runs if runs else published_results
    published = [Column(of_model(model)) for model in load().models]
    tables = make_tables([*published, *added], table or None, mark)
    written = write_tables(tables, out, endings)
    if not as_json:
        if runs:
            print(banner([c.title for c in published], [c.results for c in added]))
        show(tables[0])
        walked, wrong = len(checks()), errata()
        print(f"\n{walked} printed cells checked; {len(wrong)} do not follow from the others:")
        for number, check in enumerate(wrong, 1):
            print(f"{number:3} {check}")
        print(f"\n{len(written)} files of tables in {out}")
    drawn = []
    if figures and not table:
        from robospa.results.report.report import draw_figures

        (out / "figures").mkdir(exist_ok=True)
        alike = like_paper([*added, *published])
        beside = [one for one, column in zip(runs, added, strict=True) if column in alike]
        drawn = [one.name for one in draw_figures(beside, alike, out / "figures")]
        if not as_json:
            print(f"{len(drawn)} figures in {out / 'figures'}")
    if as_json:
        found = {"checked": len(checks()), "errata": errata(), "table": tables[0]}
        print_json({"out": out, "files": written, "figures": drawn, **found})
