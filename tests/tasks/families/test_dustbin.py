"""Bottles for the dustbin."""

from __future__ import annotations

import itertools
import math

import pytest

from robospa.tasks.catalog import build_scene
from robospa.tasks.scene import Scene

LEVELS = range(1, 6)
SEEDS = range(100_000, 100_200)


def scenes(name: str, level: int, seeds: range = SEEDS) -> list[Scene]:
    return [build_scene(name, level, seed) for seed in seeds]


@pytest.mark.parametrize("level", LEVELS)
def test_bottles_keep_their_distance_and_the_middle_free(level: int) -> None:
    for scene in scenes("Put_Bottles_Dustbin", level):
        bottles = [scene.object(name) for name in scene.facts["bottles"]]
        points = [b.pose.position[:2] for b in bottles]
        assert all(abs(x) >= 0.05 and -0.25 <= x <= 0.3 and 0.03 <= y <= 0.23 for x, y in points)
        assert all(math.dist(a, b) >= 0.13 for a, b in itertools.combinations(points, 2))
        assert scene.table_shift == (0.3, 0.0)
        dustbin = scene.object(scene.facts["dustbin"])
        assert dustbin.fixed and dustbin.pose.position == (-0.45, 0.0, 0.0)
        if level <= 3:
            assert len({b.params["look"] for b in bottles}) == level
