"""Where the spatial tasks' objects may stand."""

from __future__ import annotations

import itertools
from functools import cache

import pytest
from drawn_scenes import assert_near_uniform, index_of

from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.objects import object_model
from robospa.tasks.sampling.places import Area
from robospa.tasks.scene import Scene
from robospa.workcell import TABLE_TOP

BLOCKS, DISTANCE, CANONICAL, SOAPS, VIEWS = TASKS = (
    "Pick_Blocks_Size",
    "Pick_Mixed_Objects_Distance_B",
    "Pick_Mixed_Objects_Canonical_A",
    "Pick_Soaps_Relational",
    "Pick_Mixed_Objects_Multi_View_A",
)
LEVELS = range(1, 6)
VARIANTS = list(itertools.product(TASKS, LEVELS))
SEEDS = range(200_000, 200_160)
each_variant = pytest.mark.parametrize(("name", "level"), VARIANTS)
REGIONS = {
    BLOCKS: Area((-0.31, 0.31), (-0.15, 0.13)),
    DISTANCE: Area((-0.22, 0.22), (-0.18, 0.08)),
    CANONICAL: Area((-0.30, 0.30), (-0.19, 0.10)),
    SOAPS: Area((-0.228, 0.228), (-0.215, 0.075)),
    VIEWS: Area((-0.24, 0.24), (-0.225, 0.095)),
}


@cache
def scenes(name: str, level: int) -> tuple[Scene, ...]:
    return tuple(build_scene(name, level, seed) for seed in SEEDS)


@each_variant
def test_target_is_any_name(name: str, level: int) -> None:
    found = scenes(name, level)
    assert_near_uniform((index_of(s) for s in found), len(found[0].objects))


OTHERS = [
    t.name
    for t in tasks().values()
    if t.category in ("GAC", "SDE", "CBG") and t.name not in (BLOCKS, DISTANCE)
]


@pytest.mark.parametrize("name", OTHERS)
def test_no_place_in_the_list_is_that_of_the_target(name: str) -> None:
    for level in LEVELS:
        found = [build_scene(name, level, seed) for seed in range(700_000, 700_060)]
        assert_near_uniform((index_of(s) for s in found), len(found[0].objects))


@each_variant
def test_objects_stand_on_the_table_within_the_region(name: str, level: int) -> None:
    (left, right), (near, far) = REGIONS[name].x, REGIONS[name].y
    for scene in scenes(name, level):
        for item in scene.objects:
            x, y, z = item.pose.position
            assert left <= x <= right and near <= y <= far
            assert z + object_model(item.asset, item.params).bottom == pytest.approx(TABLE_TOP)
