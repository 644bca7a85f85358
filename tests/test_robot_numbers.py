"""The Aloha is one robot of several: only its own modules know its name and its numbers."""

import ast
import re
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

from robospa.harness.robots import embodiments
from robospa.harness.robots.aloha_agilex import ALOHA_AGILEX, CHAIN
from robospa.workcell import WORKCELL

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("tasks", "harness", "results", "clients", "baselines", "protocol", "leaderboard")
OPENPI = ("protocol/openpi.py", "clients/openpi.py")
NAMED = ("robospa/trial.py", "harness/robots/", *OPENPI, "clients/oft.py")
"""Where else the name stands: the default, robots with the same arm, openpi's configurations, and
what OpenVLA-OFT's server looks for in its command line."""


def sources(*folders: str) -> list[Path]:
    """The modules that may not know the Aloha."""
    found = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    return sorted(path for path in found if not path.name.startswith("aloha_agilex"))


def numbers(value: object) -> Iterator[float]:
    """Every float in a value made of dataclasses, mappings and sequences."""
    if isinstance(value, float):
        yield abs(value)
    elif isinstance(value, dict):
        yield from (n for item in value.values() for n in numbers(item))
    elif isinstance(value, (tuple, list)):
        yield from (n for item in value for n in numbers(item))
    elif is_dataclass(value):
        yield from (n for field in fields(value) for n in numbers(getattr(value, field.name)))


def telling(values: Iterable[float], digits: int) -> set[float]:
    """Those that stand for themselves: with so many significant digits (1.0 and 0.5 do not)."""
    return {v for v in values if digits <= len(repr(v).replace(".", "").strip("0")) <= 6}


def uses(path: Path, known: set[float]) -> list[str]:
    """Lines of a module that write one of the `known` numbers."""
    return [
        f"{path.relative_to(ROOT)}:{node.lineno} has {node.value}"
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value in known
    ]


def test_no_other_module_has_its_joints_mounts_or_reach() -> None:
    arms = ALOHA_AGILEX.arms
    fingers = [finger.origin.position for arm in arms for finger in arm.fingers]
    mounts = [arm.base.position for arm in arms]
    sites = [(site.base, site.reach, site.tool_reach) for site in WORKCELL.arms]
    known = telling(numbers([[joint[1] for joint in CHAIN], mounts, fingers]), 3)
    known |= telling(numbers(sites), 2) - {0.25}
    assert {0.417, 0.4195, 0.69, 0.63, 0.26396} <= known
    # sizes of things may happen to be those of a link, and other robots may have the same arm
    modules = [p for p in sources(*FOLDERS) if not {"objects", "robots"} & set(p.parts)]
    modules += [p for p in (ROOT / "robospa").glob("*.py") if p.name != "workcell.py"]
    assert [line for path in modules for line in uses(path, known)] == []


def test_goals_and_skills_have_no_number_of_its_gripper_or_camera() -> None:
    known = telling(numbers([ALOHA_AGILEX.arms[0].gripper, WORKCELL.head.position]), 2)
    known -= {0.012, 0.026, 0.032, 0.12, 0.45}  # too common to be told from other lengths
    assert {0.088, 0.095, 0.155, 1.35} <= known
    modules = sources("tasks/goals", "harness/skills")
    assert [line for path in modules for line in uses(path, known)] == []


@pytest.mark.parametrize("folder", [*FOLDERS, "robospa"])
def test_no_other_module_has_its_name(folder: str) -> None:
    paths = (ROOT / "robospa").glob("*.py") if folder == "robospa" else sources(folder)
    named = [p.relative_to(ROOT).as_posix() for p in paths if "aloha" in p.read_text().lower()]
    assert [name for name in named if not name.startswith(NAMED)] == []


def test_tasks_name_no_robot() -> None:
    # scenes, goals and plans are the same for all of them
    words = {word for name in embodiments() for word in name.lower().split("-")} - {"aloha"}
    words |= {"aloha", "embodiment("}
    files = [p for p in (ROOT / "tasks").rglob("*") if p.suffix in (".py", ".toml", ".md")]
    named = {
        path.relative_to(ROOT).as_posix(): word
        for path in files
        for word in words
        if re.search(rf"(?<![a-z]){re.escape(word)}", path.read_text().lower())
    }
    assert named == {}
