"""`robospa leaderboard`: keep a verified bundle as a submission, build the site.

What these commands do lies in `robospa.leaderboard`, which is reached by name: the harness is
below it and imports nothing of it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from robospa.harness.cli.options import AsJson, aside, print_json

SUBMISSIONS = Path("leaderboard/submissions")
MOST = 16 * 1024 * 1024
leaderboard = typer.Typer(
    help="Keep a verified bundle as a submission, build the site.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
Home = Annotated[Path, typer.Option(help="folder of the submissions")]
Hidden = Annotated[str | None, typer.Option(hidden=True)]


def _load(path: str) -> Callable[..., Any]:
    from robospa.harness.factory import load_function

    return load_function(f"robospa.leaderboard.{path}")


@leaderboard.command()
def build(
    submissions: Home = SUBMISSIONS,
    out: Annotated[Path, typer.Option("--out", "-o", help="folder of the site")] = Path("site"),
    as_json: AsJson = False,
) -> None:
    """Write the leaderboard as static pages."""
    note = aside if as_json else print
    if not submissions.is_dir():
        note(f"There is no folder {submissions}: the site has the published models only.")
    index = _load("site:build")(submissions, out, note)
    if as_json:
        print_json({"index": index})
    else:
        print(f"Leaderboard: {index}")


@leaderboard.command()
def add(
    bundle: Annotated[Path, typer.Argument(help="the bundle")],
    evidence: Annotated[
        list[Path] | None, typer.Option(help="files that verify and reproduce wrote")
    ] = None,
    address: Annotated[
        str, typer.Option(help="https address of the bundle, unless the folder has a bundle.txt")
    ] = "",
    name: Annotated[str, typer.Option(help="the folder; else made from the model's name")] = "",
    submissions: Home = SUBMISSIONS,
    as_json: AsJson = False,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Verify a bundle and keep what the leaderboard needs of it in the submission's folder."""
    valid = _load("verify:verify")(bundle, _load("rules:shipped")(world, parts))
    found = []
    for path in evidence or []:
        if path.stat().st_size > MOST:
            raise ValueError(f"{path} is larger than evidence can be")
        found.append(_load("untrusted:parse_map")(path.read_bytes(), str(path)))
    folder = _load("submission:add")(valid, found, submissions, name, address)
    if as_json:
        print_json({"submission": folder, "evidence": valid.evidence})
    else:
        print(f"Submission: {folder}")
