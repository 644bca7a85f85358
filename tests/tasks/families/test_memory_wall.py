"""Tasks that show something before a wall comes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest
from teleport import Teleport

from robospa.geometry import rotate
from robospa.tasks.catalog import build_scene, task
from robospa.tasks.scene import Scene
from robospa.workcell import TABLE_TOP

WALLED = (
    "Observe_Blocks_Move_Memory",
    "Observe_Objects_Click_Memory",
    "Remember_Orientation_Restore",
)
LEVELS = range(1, 6)
SEEDS = range(500_000, 500_200)
each_level = pytest.mark.parametrize("level", LEVELS)


def scenes(name: str, level: int, count: int = 100) -> Iterator[Scene]:
    return (build_scene(name, level, seed) for seed in SEEDS[:count])


def at(scene: Scene, name: str) -> tuple[float, float, float]:
    return scene.object(name).pose.position


@pytest.mark.parametrize("name", WALLED)
@each_level
def test_moving_before_the_wall_comes_fails_for_good(name: str, level: int) -> None:
    found = task(name)
    for scene in scenes(name, level, 3):
        trial = Teleport(scene, found.goal(scene)).run(found.plan(scene)[1:])
        assert [e.kind for e in trial.events][-1] == "failed"


@pytest.mark.parametrize("name", WALLED)
@each_level
def test_the_wall_stands_between_the_table_and_what_is_shown(name: str, level: int) -> None:
    for scene in scenes(name, level, 20):
        wall = scene.object(scene.facts["wall"])
        half = wall.params["half"]
        assert wall.fixed and wall.appears_at == 2.0
        assert wall.pose.position[2] - half[2] == pytest.approx(TABLE_TOP)
        behind = [o for o in scene.objects if o.pose.position[1] > wall.pose.position[1]]
        low = [o for o in behind if o.asset != "block" or o.params["half"][0] < 0.1]
        assert len(low) == level
        for item in behind:
            assert abs(item.pose.position[0]) + 0.03 < half[0]


@each_level
def test_colours_shown_are_uniform_and_every_one_has_its_block(level: int) -> None:
    shown: Counter[str] = Counter()
    for scene in scenes("Observe_Blocks_Move_Memory", level, 200):
        facts = scene.facts
        shown.update(facts["colors"])
        colors = {tuple(scene.object(n).params["color"]) for n in facts["targets"]}
        others = {tuple(scene.object(n).params["color"]) for n in facts["others"]}
        on_stand = {
            tuple(o.params["color"])
            for o in scene.objects
            if o.asset == "block" and o.pose.position[2] == pytest.approx(0.845)
        }
        assert on_stand == colors and not colors & others and len(others) == level
        assert all(at(scene, n)[1] > -0.11 for n in (*facts["targets"], *facts["others"]))
    expected = 200 * level / 12
    assert len(shown) == 12
    assert sum((n - expected) ** 2 / expected for n in shown.values()) < 31.3  # p = 0.001, 11 df


def test_targets_and_others_lie_alike() -> None:
    y = {"targets": [], "others": []}  # type: dict[str, list[float]]
    for scene in scenes("Observe_Blocks_Move_Memory", 5, 200):
        for role, found in y.items():
            found += [at(scene, n)[1] for n in scene.facts[role]]
    assert abs(np.mean(y["targets"]) - np.mean(y["others"])) < 0.01


@each_level
def test_shown_objects_stand_in_clicking_order(level: int) -> None:
    for scene in scenes("Observe_Objects_Click_Memory", level):
        shown = sorted(
            (o for o in scene.objects if o.asset != "block" and o.pose.position[2] > 0.8),
            key=lambda o: o.pose.position[0],
        )
        order = [scene.object(n) for n in scene.facts["order"]]
        assert [(o.asset, o.params) for o in shown] == [(o.asset, o.params) for o in order]


@each_level
def test_partners_lie_differently_and_directions_are_uniform(level: int) -> None:
    shown: Counter[int] = Counter()
    for scene in scenes("Remember_Orientation_Restore", level, 200):
        facts = scene.facts
        for near, far in zip(facts["near"], facts["far"], strict=True):
            one, other = (
                rotate(scene.object(n).pose.rotation, (0.0, 1.0, 0.0)) for n in (near, far)
            )
            assert math.dist(one, other) > 1
        assert len({scene.object(n).params["kind"] for n in facts["near"]}) == 1
        shown.update(facts["turns"])
    expected = 200 * level / 4
    assert sum((n - expected) ** 2 / expected for n in shown.values()) < 16.3  # p = 0.001, 3 df
