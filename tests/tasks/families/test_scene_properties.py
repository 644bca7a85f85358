"""What holds for the scenes of every variant: bounded draws, no overlap, everything in view.

A few scenes of each by default; `ROBOSPA_SCENES=10000` looks at that many.
"""

from __future__ import annotations

import ast
import itertools
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from scene_checks import misplaced, named, overlaps, sunk, unreachable, unseen

from robospa.geometry import Pose
from robospa.tasks import catalog
from robospa.tasks.scene import Scene

SCENES = int(os.environ.get("ROBOSPA_SCENES", "5"))
FIRST_SEED = 510_000
FEW = 25
"""Scenes that are kept; of more than these only one is in memory at a time."""
VARIANTS = [(name, level) for name in catalog.tasks() for level in catalog.LEVELS]
ROOT = Path(__file__).resolve().parents[3]
each_variant = pytest.mark.parametrize(("name", "level"), VARIANTS)


@cache
def _kept(name: str, level: int) -> tuple[Scene, ...]:
    return tuple(catalog.build_scene(name, level, FIRST_SEED + k) for k in range(min(SCENES, FEW)))


def scenes(name: str, level: int) -> itertools.chain[Scene]:
    more = (catalog.build_scene(name, level, FIRST_SEED + k) for k in range(FEW, SCENES))
    return itertools.chain(_kept(name, level), more)


COUNTED = {"while len(drawn) < count - 1"}
"""Loops that grow what they test, whatever is drawn."""


@pytest.mark.parametrize(
    "path",
    sorted((ROOT / "tasks/families").rglob("*.py")),
    ids=lambda p: f"{p.parent.name}.{p.stem}",
)
def test_no_draw_is_repeated_without_a_bound(path: Path) -> None:
    loops = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.While)]
    open_ended = [n for n in loops if f"while {ast.unparse(n.test)}" not in COUNTED]
    assert not open_ended, f"{path.name} line {open_ended[0].lineno}: use a loop with a bound"


@each_variant
def test_movable_objects_do_not_overlap(name: str, level: int) -> None:
    assert_nothing(overlaps, name, level)


@each_variant
def test_movable_objects_are_seen_by_the_head_camera(name: str, level: int) -> None:
    assert_nothing(unseen, name, level)


@each_variant
def test_nothing_starts_below_the_table(name: str, level: int) -> None:
    assert_nothing(sunk, name, level)


@each_variant
def test_names_tell_nothing(name: str, level: int) -> None:
    assert_nothing(named, name, level)


@each_variant
def test_everything_picked_is_in_reach(name: str, level: int) -> None:
    for scene in itertools.islice(scenes(name, level), 1 if SCENES < FEW else None):
        assert list(unreachable(scene)) == [], scene.seed


@each_variant
def test_the_facts_single_out_the_target(name: str, level: int) -> None:
    assert_nothing(misplaced, name, level)


def assert_nothing(rule: Callable[[Scene], Iterator[str]], name: str, level: int) -> None:
    for scene in scenes(name, level):
        assert list(rule(scene)) == [], scene.seed


def test_blocks_in_each_other_are_found() -> None:
    scene = catalog.build_scene("Pick_Blocks_Size", 3, FIRST_SEED)
    first, second, *others = scene.objects
    x, y, _ = first.pose.position
    z = second.pose.position[2]
    moved = replace(second, pose=Pose((x + 0.01, y, z), first.pose.rotation))
    wrong = replace(scene, objects=(first, moved, *others))
    assert len(list(overlaps(wrong))) == 1
    assert list(overlaps(scene)) == []


def test_a_block_far_away_is_out_of_view_and_of_reach() -> None:
    scene = catalog.build_scene("Pick_Blocks_Size", 3, FIRST_SEED)
    target = scene.object(str(scene.facts["target"]))
    away = replace(target, pose=Pose((0.0, 0.9, target.pose.position[2]), target.pose.rotation))
    wrong = replace(scene, objects=tuple(away if o is target else o for o in scene.objects))
    assert len(list(unseen(wrong))) == len(list(unreachable(wrong))) == 1


def test_another_rank_is_another_answer() -> None:
    scene = catalog.build_scene("Pick_Blocks_Size", 3, FIRST_SEED)
    rank = int(scene.facts["size_rank"])
    wrong = replace(scene, facts={**scene.facts, "size_rank": rank + 1 if rank < 4 else 1})
    assert len(list(misplaced(wrong))) == 1
