"""Towers of blocks."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest

from robospa.tasks.catalog import build_scene
from robospa.tasks.scene import Scene

STACKS = ("Stack_Blocks_Size_Order", "Stack_Blocks_Length_Order")
LEVELS = range(1, 6)
SEEDS = range(500_000, 500_200)
each_level = pytest.mark.parametrize("level", LEVELS)


def scenes(name: str, level: int, count: int = 100) -> Iterator[Scene]:
    return (build_scene(name, level, seed) for seed in SEEDS[:count])


def at(scene: Scene, name: str) -> tuple[float, float, float]:
    return scene.object(name).pose.position


@pytest.mark.parametrize("name", STACKS)
@each_level
def test_towers_shrink_upwards_and_no_block_has_a_place_in_the_list(name: str, level: int) -> None:
    first: Counter[str] = Counter()
    for scene in scenes(name, level):
        halves = [scene.object(n).params["half"][0] for n in scene.facts["order"]]
        assert all(a > b + 0.003 for a, b in itertools.pairwise(halves))
        assert len({tuple(scene.object(n).params["color"]) for n in scene.facts["order"]}) == 1
        first[scene.facts["order"][0]] += 1
    assert len(first) == level


def test_blocks_of_all_sizes_lie_alike() -> None:
    """The mean place of the largest block is that of the smallest one."""
    places = np.array(
        [
            [at(s, s.facts["order"][i])[:2] for i in (0, 4)]
            for s in scenes("Stack_Blocks_Size_Order", 5, 200)
        ]
    )
    assert np.abs(places[:, 0].mean(axis=0) - places[:, 1].mean(axis=0)).max() < 0.07


@each_level
def test_blocks_to_stack_have_the_right_colours_and_places(level: int) -> None:
    for scene in scenes("Stack_Blocks_Color_Order", level):
        order = [scene.object(name) for name in scene.facts["order"]]
        points = [o.pose.position[:2] for o in order]
        assert scene.facts["colors"] == ["red", "green", "blue", "yellow", "purple"][:level]
        assert len({tuple(o.params["color"]) for o in order}) == level
        assert all(-0.28 <= x <= 0.28 and -0.08 <= y <= 0.05 for x, y in points)
        assert not any(abs(x) < 0.15 and y > 0 for x, y in points)
        assert all(math.dist(a, b) >= 0.10 for a, b in itertools.combinations(points, 2))
        assert min(math.dist(scene.facts["place"], p) for p in points) > 0.06


def test_a_colour_has_no_place_in_the_list_of_objects() -> None:
    first = Counter(s.facts["order"][0] for s in scenes("Stack_Blocks_Color_Order", 5, 200))
    assert len(first) == 5 and min(first.values()) > 200 / 10
