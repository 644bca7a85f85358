"""Blocks, foods and boxes to be moved to their sides."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator

import pytest

from robospa.geometry import rotate
from robospa.tasks.catalog import build_scene, task
from robospa.tasks.plan import Place
from robospa.tasks.scene import Scene

LEVELS = range(1, 6)
SEEDS = range(500_000, 500_100)
each_level = pytest.mark.parametrize("level", LEVELS)


def scenes(name: str, level: int, count: int = len(SEEDS)) -> Iterator[Scene]:
    return (build_scene(name, level, seed) for seed in SEEDS[:count])


def places(scene: Scene, names: list[str]) -> list[tuple[float, float]]:
    return [scene.object(name).pose.position[:2] for name in names]


@each_level
def test_two_colours_stand_in_a_narrow_column_without_touching(level: int) -> None:
    for scene in scenes("Move_Blocks_Apart", level):
        facts, blocks = scene.facts, scene.objects
        assert len(facts["right"]) + len(facts["left"]) == level
        assert level == 1 or len(facts["right"]) == {2: 1, 3: 1, 4: 2, 5: 2}[level]
        colors = [{tuple(scene.object(n).params["color"]) for n in facts[s]}
                  for s in ("right", "left")]  # fmt: skip
        assert all(len(c) <= 1 for c in colors) and not colors[0] & colors[1]
        assert all(abs(b.pose.position[0]) <= 0.06 for b in blocks)
        assert all(-0.22 <= b.pose.position[1] <= 0.10 for b in blocks)
        for a, b in itertools.combinations(blocks, 2):
            assert math.dist(a.pose.position, b.pose.position) > 0.04
            assert not any(inside(corner, b) for corner in corners(a))
            assert not any(inside(corner, a) for corner in corners(b))


def corners(block) -> list[tuple[float, float, float]]:  # type: ignore[no-untyped-def]
    half = block.params["half"][0] + 0.002
    return [block.pose.apply((sx * half, sy * half, 0.0)) for sx in (-1, 1) for sy in (-1, 1)]


def inside(point: tuple[float, float, float], block) -> bool:  # type: ignore[no-untyped-def]
    x, y, _ = block.pose.inverse().apply(point)
    return max(abs(x), abs(y)) < float(block.params["half"][0])


def test_sides_and_kinds_of_single_objects_are_fair_coins() -> None:
    sides = Counter(bool(s.facts["right"]) for s in scenes("Move_Blocks_Apart", 1))
    ways = Counter(bool(s.facts["forward"]) for s in scenes("Separate_Fries_Bread", 1))
    first = Counter(s.facts["forward_kind"] for s in scenes("Separate_Fries_Bread", 4))
    bells = Counter(s.objects[0].pose.position[0] > 0 for s in scenes("Click_Bell_Repeat", 2))
    assert all(len(c) == 2 and min(c.values()) > 30 for c in (sides, ways, first, bells))


@each_level
def test_foods_stand_in_one_row_between_the_lines(level: int) -> None:
    count = {1: None, 2: 1, 3: 2, 4: 2, 5: 2}[level]
    for scene in scenes("Separate_Fries_Bread", level):
        ys = {o.pose.position[1] for o in scene.objects}
        assert len(ys) == 1 and -0.15 <= ys.pop() <= -0.10
        assert count is None or len(scene.facts["forward"]) == count
        kinds = {"bread": "bread", "french_fries": "fries"}
        for way in ("forward", "backward"):
            said = {kinds[scene.object(n).asset] for n in scene.facts[way]}
            assert said <= {scene.facts[f"{way}_kind"]}


@each_level
def test_card_boxes_lie_apart_near_the_middle_turned_any_way(level: int) -> None:
    headings = []
    for scene in scenes("Move_Playing_Cards_Away", level):
        points = places(scene, scene.facts["boxes"])
        assert all(-0.2 <= x <= 0.2 and -0.2 <= y <= 0.1 for x, y in points)
        assert all(math.dist(a, b) >= 0.15 for a, b in itertools.combinations(points, 2))
        headings += [rotate(o.pose.rotation, (1, 0, 0)) for o in scene.objects]
    assert {(h[0] > 0, h[1] > 0) for h in headings} == set(
        itertools.product((True, False), (True, False))
    )


def test_card_boxes_get_room_at_their_side() -> None:
    for scene in scenes("Move_Playing_Cards_Away", 5):
        goals = [s.position for s in task(scene.task).plan(scene) if isinstance(s, Place)]
        assert all(abs(x) >= 0.25 and -0.30 <= y <= 0.101 for x, y, _ in goals)
        for (ax, ay, _), (bx, by, _) in itertools.combinations(goals, 2):
            assert (ax > 0) != (bx > 0) or abs(ay - by) >= 0.079
