"""docs/official-world.md says of every task what is official of it, as the code has it."""

from __future__ import annotations

import re
from fnmatch import fnmatch
from pathlib import Path

import pytest
from official_table import HEAD, PAGE, RULES, SEED, Rule, goal_and_frames, pieces

from robospa.harness.official.switches import SWITCHES
from robospa.tasks.catalog import build_scene
from robospa.tasks.official import needs

TEXT = PAGE.read_text("utf-8")
FIDELITY = (Path(PAGE).parent / "fidelity.md").read_text("utf-8")
LAYOUTS = (
    "| Pick_Blocks_Distance | level 1 alone has another spread test",
    "| Pick_Pill_Bottles_Distance | levels 1-3 without twins",
    "| Pick_Mixed_Objects_Distance_A | level 4 unknown",
    "| Pick_Mixed_Objects_Distance_B | level 2 unknown",
    "| Pick_Mixed_Objects_Distance_B | french fries do not turn",
    "| Move_Playing_Cards_Away | levels 1 and 5 unknown",
    "| Observe_Blocks_Move_Memory | texts do not say where the strip is",
)
"""Departures of the classes of rules that are about scenes or sentences."""


def rows() -> dict[str, tuple[str, ...]]:
    """The cells of the table by their task."""
    cells = [line.strip("| ").split(" | ") for line in TEXT.splitlines()]
    return {row[0]: tuple(row[1:]) for row in cells if len(row) == len(HEAD) and row[0] in needs()}


@pytest.mark.parametrize("task", [*needs()])
def test_a_row_says_what_the_code_has(task: str) -> None:
    found = pieces(task)
    assert rows()[task] == found.cells()
    assert found.archive == tuple(sorted(needs()[task]))


def test_a_goal_and_an_expert_say_which_frames_they_take() -> None:
    parts, frames = goal_and_frames(build_scene("Hang_Mug_Stack_Blocks", 1, SEED))
    assert frames == {("mug", "handle"), ("mug_rack", "hang")}
    assert len(parts) > 3


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_a_rule_is_explained_and_is_a_departure(rule: Rule) -> None:
    assert f"\n| `{rule.name}` | " in TEXT
    assert [row for row in rule.rows if f"\n{row}" not in FIDELITY] == []
    for row in rule.rows:
        for pattern in re.findall(r"[A-Z][a-z]+_[\w*]+", row.split(" | ")[0]):
            of = [task for task in needs() if fnmatch(task, pattern)]
            assert of and all(rule.name in rows()[task][3].split(", ") for task in of), row


def test_every_departure_of_a_rule_is_one_of_the_table() -> None:
    text = FIDELITY[FIDELITY.index("## Spatial tasks") : FIDELITY.index("## The official world")]
    mended = [line for line in text.splitlines() if re.search(r"\| (\d / )?[23]( / \d)? \|$", line)]
    known = (*LAYOUTS, *(row for rule in RULES for row in rule.rows))
    assert len(mended) > 15
    assert [line[:80] for line in mended if not line.startswith(known)] == []


def test_every_switch_is_explained() -> None:
    assert [s.name for s in SWITCHES if f"| `{s.name}` |" not in TEXT] == []
