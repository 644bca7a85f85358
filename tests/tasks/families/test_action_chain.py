"""Tasks in which several kinds of action alternate."""

from __future__ import annotations

import math

import pytest
from teleport import Teleport

from robospa.tasks.catalog import build_scene, task
from robospa.tasks.scene import Scene

FREE = "Hang_Mug_Stack_Blocks"
"""Its red block may lie in the asked area from the start (official)."""


@pytest.mark.parametrize("level", [3, 4, 5])
def test_a_block_in_the_near_left_area_at_the_start_is_rare_and_counted(level: int) -> None:
    free = [
        Teleport(scene, task(FREE).goal(scene)).tracker.diagnostics()["idle_progress"] > 0  # type: ignore[attr-defined]
        for scene in (build_scene(FREE, level, seed) for seed in range(500_000, 500_200))
    ]
    assert 0.1 < sum(free) / len(free) < 0.3


LEVELS = range(1, 6)
SEEDS = range(100_000, 100_200)


def scenes(name: str, level: int, seeds: range = SEEDS) -> list[Scene]:
    return [build_scene(name, level, seed) for seed in seeds]


@pytest.mark.parametrize("level", LEVELS)
def test_click_scenes_hold_what_the_level_asks_for(level: int) -> None:
    assets = {"can"} | ({"bread", "bread_basket"} if level > 1 else set())
    assets |= {"pill_bottle", "block"} if level > 3 else set()
    for scene in scenes("Click_Can_Place_Items", level):
        assert {o.asset for o in scene.objects} == assets
        x, y, _ = scene.object(scene.facts["can"]).pose.position
        assert -0.25 <= x <= -0.05 and -0.2 <= y <= 0.1
        assert all(o.fixed == (o.asset in ("can", "bread_basket", "block")) for o in scene.objects)
        if level > 3:
            pad, can = (scene.object(scene.facts[n]).pose.position[:2] for n in ("pad", "can"))
            bottle = scene.object(scene.facts["pill_bottle"]).pose.position[:2]
            assert math.dist(pad, bottle) >= 0.1 and math.dist(pad, can) >= 0.1
