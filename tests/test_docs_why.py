"""What `docs/why.md` points to exists: pages with their sections, tests, commands with options."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest
import typer.main

from robospa.harness.cli.main import COMMANDS, NAMES

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "docs" / "why.md", ROOT / "docs" / "faults.md"]
WHY = PAGES[0].read_text()


def section(title: str) -> str:
    """The anchor of a heading."""
    return re.sub(r"[^a-z0-9 -]", "", title.lower()).replace(" ", "-")


def options_of(command: str) -> set[str]:
    module = importlib.import_module(f"robospa.harness.cli.{command}")
    found = getattr(module, NAMES.get(command, command))
    if isinstance(found, typer.Typer):
        app = found
    else:
        app = typer.Typer()
        app.command()(found)
    return {name for p in typer.main.get_command(app).params for name in p.opts}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_its_tests_exist(page: Path) -> None:
    named = set(re.findall(r"`(tests/[\w/]+\.py)`", page.read_text()))
    assert named
    assert [name for name in sorted(named) if not (ROOT / name).is_file()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_its_links_lead_to_sections(page: Path) -> None:
    for target, anchor in re.findall(r"\]\(([\w.-]+\.md)(?:#([\w-]+))?\)", page.read_text()):
        text = (ROOT / "docs" / target).read_text()
        heads = {section(head) for head in re.findall(r"^#+ (.+)$", text, re.MULTILINE)}
        heads |= set(re.findall(r'<a id="([\w-]+)">', text))
        assert not anchor or anchor in heads, f"{target}#{anchor}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_its_commands_and_options_exist(page: Path) -> None:
    text = page.read_text()
    for command, rest in re.findall(r"`robospa (\w+)([^`]*)`", text):
        assert command in COMMANDS
        wanted = set(re.findall(r"--[\w-]+", rest))
        assert wanted <= options_of(command), f"robospa {command}: {wanted}"
    every = set().union(*(options_of(name) for name in ("eval", "compare")))
    assert set(re.findall(r"`(--[\w-]+)", text)) <= every


def test_every_pain_has_an_answer() -> None:
    rows = re.findall(r"^\| (\d+) \|[^|]+\| ([\w ]+) \|", WHY, re.MULTILINE)
    assert [int(number) for number, _ in rows] == list(range(1, 25))
    assert {verdict for _, verdict in rows} <= {"solved", "partly", "not yet"}
