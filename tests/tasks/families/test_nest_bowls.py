"""Bowls to be nested on a plate."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import pytest

from robospa.tasks.catalog import build_scene
from robospa.tasks.scene import Scene

LEVELS = range(1, 6)
SEEDS = range(500_000, 500_100)
each_level = pytest.mark.parametrize("level", LEVELS)


def scenes(name: str, level: int, count: int = len(SEEDS)) -> Iterator[Scene]:
    return (build_scene(name, level, seed) for seed in SEEDS[:count])


def places(scene: Scene, names: list[str]) -> list[tuple[float, float]]:
    return [scene.object(name).pose.position[:2] for name in names]


@each_level
def test_equal_bowls_stand_apart_off_the_middle(level: int) -> None:
    for scene in scenes("Place_Bowls_Plates", level, 50):
        points = places(scene, scene.facts["bowls"])
        (plate,) = places(scene, [scene.facts["plate"]])
        assert 0.09 <= abs(plate[0]) <= 0.15 and -0.15 <= plate[1] <= -0.10
        assert all(0.08 <= abs(x) <= 0.28 and -0.05 <= y <= 0.20 for x, y in points)
        assert all(math.dist(a, b) >= 0.13 for a, b in itertools.combinations(points, 2))
        looks = {scene.object(n).params["look"] for n in scene.facts["bowls"]}
        assert len(points) == level and len(looks) == 1
