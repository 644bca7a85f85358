"""Objects named by row and column."""

from __future__ import annotations

from functools import cache

import pytest
from drawn_scenes import assert_near_uniform, index_of, kept, places

from robospa.tasks.catalog import build_scene, task
from robospa.tasks.families.canonical_index.task import LINES
from robospa.tasks.families.picking import pick_name
from robospa.tasks.scene import Scene

CANONICAL = "Pick_Mixed_Objects_Canonical_A"
LEVELS = range(1, 6)
SEEDS = range(200_000, 200_160)
each_level = pytest.mark.parametrize("level", LEVELS)


@cache
def scenes(name: str, level: int) -> tuple[Scene, ...]:
    return tuple(build_scene(name, level, seed) for seed in SEEDS)


@pytest.mark.parametrize("kind", [line.kind for line in LINES])
def test_basic_ordinal_tasks_count_one_way_only(kind: str) -> None:
    for level in LEVELS:
        for scene in kept(f"Basic_Ordinal_{kind}", level, 24):
            assert scene.facts["column_direction"] == "left_to_right"
            assert scene.facts.get("row_direction", "far_to_near") == "far_to_near"
            assert task(scene.task).levels == task(pick_name(kind, "Canonical")).levels


@pytest.mark.parametrize(
    "name", ["Pick_Blocks_Canonical", "Pick_Cups_Canonical", "Pick_Cans_Relational"]
)
def test_objects_of_one_kind_look_the_same(name: str) -> None:
    for level in LEVELS:
        for scene in kept(name, level, 24):
            assert len({(o.asset, str(o.params)) for o in scene.objects}) == 1


@each_level
def test_grid_position_is_counted_right(level: int) -> None:
    rows, columns = {1: (1, 3), 2: (2, 3), 3: (2, 4), 4: (3, 3), 5: (3, 4)}[level]
    cells = []
    for scene in scenes(CANONICAL, level):
        x, y = places(scene)[index_of(scene)]
        column = int((places(scene)[:, 0] < x - 0.07).sum()) // rows
        row = int((places(scene)[:, 1] < y - 0.05).sum()) // columns
        cells.append((row, column))
        facts = scene.facts
        left = facts["column_direction"] == "left_to_right"
        assert facts["column"] == (column + 1 if left else columns - column)
        if rows > 1:
            near = facts["row_direction"] == "near_to_far"
            assert facts["row"] == (row + 1 if near else rows - row)
        else:
            assert "row" not in facts
    assert_near_uniform(cells, rows * columns)
