"""One action several times."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

import pytest

from robospa.geometry import rotate
from robospa.tasks.catalog import build_scene, task
from robospa.tasks.scene import Scene

LEVELS = range(1, 6)
SEEDS = range(500_000, 500_200)


def scenes(name: str, level: int, count: int = 200) -> Iterator[Scene]:
    return (build_scene(name, level, seed) for seed in SEEDS[:count])


def test_a_bell_asks_for_the_closed_gripper_on_its_side() -> None:
    for scene in scenes("Click_Bell_Repeat", 2, 20):
        right = scene.objects[0].pose.position[0] > 0
        assert task(scene.task).goal(scene).counter.arm == int(right)  # type: ignore[attr-defined]


@pytest.mark.parametrize("level", LEVELS)
def test_staplers_lie_anywhere_in_their_region(level: int) -> None:
    yaws: Counter[int] = Counter()
    for scene in scenes("Press_Stapler_Repeat", level):
        (stapler,) = scene.objects
        x, y, _ = stapler.pose.position
        assert -0.2 <= x <= 0.2 and -0.1 <= y <= 0.05 and stapler.fixed
        assert scene.facts["count"] == level
        heading = rotate(stapler.pose.rotation, (1.0, 0.0, 0.0))
        yaws[int(math.atan2(heading[1], heading[0]) // (math.pi / 2))] += 1
    assert min(yaws.values()) > len(SEEDS) / 8 and len(yaws) == 4
