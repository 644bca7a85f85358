"""Covers over colours to remember."""

from __future__ import annotations

from collections import Counter

import pytest
from teleport import Teleport

from robospa.tasks.catalog import build_scene, task
from robospa.tasks.events import outcome
from robospa.tasks.scene import Scene

LEVELS = range(1, 6)
SEEDS = range(100_000, 100_200)


def scenes(name: str, level: int, seeds: range = SEEDS) -> list[Scene]:
    return [build_scene(name, level, seed) for seed in seeds]


@pytest.mark.parametrize("level", LEVELS)
def test_covers_lie_over_their_blocks_and_come_later(level: int) -> None:
    for scene in scenes("Remember_Color_Cover", level):
        blocks = [scene.object(name) for name in scene.facts["blocks"]]
        covers = [scene.object(name) for name in scene.facts["covers"]]
        assert len(set(scene.facts["colors"])) == level
        assert all(b.fixed and b.appears_at is None for b in blocks)
        assert all(not c.fixed and c.appears_at == 2.0 for c in covers)
        for block, cover in zip(blocks, covers, strict=True):
            assert block.pose.position[:2] == cover.pose.position[:2]


def test_orders_to_remember_are_uniform_and_colours_too() -> None:
    seeds = range(100_000, 103_000)
    orders: Counter[tuple[int, ...]] = Counter()
    colors: Counter[str] = Counter()
    for scene in scenes("Remember_Color_Cover", 3, seeds):
        x = [scene.object(name).pose.position[0] for name in scene.facts["blocks"]]
        orders[tuple(sorted(range(3), key=x.__getitem__))] += 1
        colors.update(scene.facts["colors"])
    expected = len(seeds) / 6
    assert len(orders) == 6
    assert sum((n - expected) ** 2 / expected for n in orders.values()) < 20.5  # p = 0.001, 5 df
    expected = 3 * len(seeds) / 10
    assert sum((n - expected) ** 2 / expected for n in colors.values()) < 27.9  # p = 0.001, 9 df


def test_opening_covers_from_left_to_right_fails_when_that_is_not_the_order() -> None:
    found = task("Remember_Color_Cover")
    for scene in scenes("Remember_Color_Cover", 3, SEEDS[:30]):
        facts = scene.facts
        x = {c: scene.object(c).pose.position[0] for c in facts["covers"]}
        wanted, swapped = list(facts["covers"]), sorted(facts["covers"], key=x.__getitem__)
        blocks = dict(zip(facts["covers"], facts["blocks"], strict=True))
        other = {**facts, "covers": swapped, "blocks": [blocks[c] for c in swapped]}
        guess = Scene(**{**vars(scene), "facts": other})
        trial = Teleport(scene, found.goal(scene)).run(found.plan(guess))
        assert outcome(trial.events, 3).success is (swapped == wanted)
        assert outcome(trial.events, 3).failed is (swapped != wanted)
