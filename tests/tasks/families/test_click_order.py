"""Bells and objects to be clicked in an order."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from robospa.tasks.catalog import build_scene
from robospa.tasks.scene import Scene

LEVELS = range(1, 6)
SEEDS = range(500_000, 500_200)


def scenes(name: str, level: int, count: int = 100) -> Iterator[Scene]:
    return (build_scene(name, level, seed) for seed in SEEDS[:count])


def at(scene: Scene, name: str) -> tuple[float, float, float]:
    return scene.object(name).pose.position


@pytest.mark.parametrize("level", [3, 4, 5])
def test_bells_go_clockwise_from_the_farthest(level: int) -> None:
    for scene in scenes("Click_Bell_Clockwise_Order", level):
        points = np.array([at(scene, n)[:2] for n in scene.facts["order"]])
        assert points[0, 1] > points[1:, 1].max() + 0.01
        dx, dy = (points - points.mean(axis=0)).T
        angles = np.unwrap(np.arctan2(dx, dy))
        assert (np.diff(angles) > 0.1).all() and angles[-1] - angles[0] < 2 * math.pi


def test_the_far_bell_comes_before_the_near_one() -> None:
    for scene in scenes("Click_Bell_Clockwise_Order", 2):
        far, near = (at(scene, n) for n in scene.facts["order"])
        assert far[1] > near[1] + 0.15


def test_objects_to_click_come_in_the_fixed_order() -> None:
    order = ["alarm_clock", "stapler", "can", "playing_cards", "bread"]
    for level in LEVELS:
        for scene in scenes("Click_Objects_Order", level, 20):
            assert [scene.object(n).asset for n in scene.facts["order"]] == order[:level]
