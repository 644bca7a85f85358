"""`--json`: every command that reports has it, and standard output is then one JSON value."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from checkouts import write_checkout
from command_line import robospa
from fake_runs import outcomes, write

from robospa.harness.cli.main import COMMANDS, command_of

TASK = "Pick_Blocks_Size"
SILENT = {
    "demo": "shows how the others look",
    "serve": "runs until it is stopped",
    "view": "opens a browser",
    "learn": "prints the folder",
    "submit template": "prints a TOML file",
}
"""Commands that report nothing to a program, and why."""
HERE = {
    "report": "report {run}",
    "compare": "compare {run} {other}",
    "paper": "paper --out {tmp}/paper --table basic",
    "tasks": "tasks Pick_Blocks_Size",
    "official instructions": "official instructions {tmp}/checkout --levels 2 --tasks {task}",
    "leaderboard build": "leaderboard build --submissions {tmp}/none --out {tmp}/site",
}


def commands() -> Iterator[tuple[str, Any]]:
    """Every command with its name, such as `submit verify`."""
    for name in COMMANDS:
        found = command_of(name)
        app = found if isinstance(found, typer.Typer) else typer.Typer()
        if app is not found:
            app.command(name)(found)
        command: Any = typer.main.get_command(app)
        parts = getattr(command, "commands", {})
        if not parts or command.invoke_without_command:
            yield name, command
        yield from ((f"{name} {part}", one) for part, one in parts.items())


def test_every_command_that_reports_has_json() -> None:
    having = {name for name, one in commands() if any("--json" in p.opts for p in one.params)}
    assert having == {name for name, _ in commands()} - set(SILENT)


@pytest.mark.parametrize("line", HERE.values(), ids=HERE)
def test_standard_output_is_one_json_value(line: str, tmp_path: Path) -> None:
    for name, found in (("one", [1, 1, 0]), ("two", [1, 0, 0])):
        write(tmp_path / name, outcomes("Pick_Blocks_Size", 1, found))
    write_checkout(tmp_path / "checkout")
    words = line.format(
        run=tmp_path / "one", other=tmp_path / "two", tmp=tmp_path, task=TASK
    ).split()
    done = robospa(*words, "--json")
    assert json.loads(done.out) and "Traceback" not in done.err
