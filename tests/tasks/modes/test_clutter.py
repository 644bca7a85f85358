"""Clutter lies where it is in no one's way, and is nothing that a task could mean."""

from __future__ import annotations

import itertools
import math
from functools import cache

import numpy as np
import pytest

from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.modes import clutter
from robospa.tasks.objects import assets, object_model, variant_count
from robospa.tasks.plan import Place
from robospa.tasks.scene import Scene, SceneObject

NAMES = sorted(tasks())
SEEDS = (1, 2)


@cache
def scene_of(name: str, seed: int, level: int = 1) -> Scene:
    return build_scene(name, level, seed, mode="randomized:height,clutter")


def radius(item: SceneObject) -> float:
    return object_model(item.asset, item.params).radius


def apart(a: SceneObject, b: SceneObject) -> float:
    return math.dist(a.pose.position[:2], b.pose.position[:2])


@pytest.mark.parametrize("name", NAMES)
def test_clutter_keeps_the_official_distances(name: str) -> None:
    for seed in SEEDS:
        scene = scene_of(name, seed)
        assert len(scene.clutter) <= 10
        for a, b in itertools.combinations(scene.clutter, 2):
            assert apart(a, b) >= radius(a) + radius(b) + 0.01
        for item in scene.clutter:
            model = object_model(item.asset, item.params)
            x, y, z = item.pose.position
            assert abs(x - scene.table_shift[0]) + model.radius <= clutter.EDGE[0] + 1e-9
            assert abs(y) + model.radius <= clutter.EDGE[1] + 1e-9
            assert z + model.bottom == pytest.approx(scene.table_top)
            assert model.size[2] <= clutter.TALL or y >= model.radius


@pytest.mark.parametrize("name", NAMES)
def test_clutter_leaves_room_for_what_a_task_needs(name: str) -> None:
    """No circle of clutter meets the circle inside a task object's footprint, or round the places
    to which the plan carries things."""
    for seed in SEEDS:
        scene = scene_of(name, seed)
        for item in scene.clutter:
            for other in scene.objects:
                size = object_model(other.asset, other.params).size
                assert apart(item, other) >= radius(item) + min(size[:2]) / 2 + 0.019
            for skill in tasks()[name].plan(scene):
                if isinstance(skill, Place) and skill.on is None:
                    moved = radius(scene.object(skill.object))
                    far = math.dist(item.pose.position[:2], skill.position[:2])
                    assert far >= radius(item) + moved + 0.019


def test_nothing_on_the_table_can_be_taken_for_an_object_of_the_task() -> None:
    for name in NAMES:
        for level in (1, 5) if tasks()[name].dimension == "procedural" else (1,):
            scene = scene_of(name, 1, level)
            there = {item.asset for item in scene.objects}
            found = {item.asset for item in scene.clutter}
            assert not found & (there | clutter.FURNITURE)
            assert not any(group & there and group & found for group in clutter.LOOK_ALIKES)


def test_where_colours_are_asked_for_no_clutter_has_them() -> None:
    asked = 0
    for name in (
        "Basic_Color_Mixed_Objects_A",
        "Hit_Blocks_Hammer_Order",
        "Stack_Blocks_Color_Order",
    ):
        for seed in range(5):
            scene = scene_of(name, seed)
            colors = clutter.colors_asked(scene)
            asked += len(colors)
            for item in scene.clutter:
                phrases = object_model(item.asset, item.params).phrases
                assert not clutter.color_words(" ".join(phrases)) & colors
    assert asked > 15
    assert not clutter.colors_asked(scene_of("Pick_Cups_Canonical", 1))


def test_there_is_enough_to_choose_from() -> None:
    """Officially 124 categories with 415 models, of which a scene's look-alikes are left out."""
    known = set(assets())
    assert known >= clutter.FURNITURE and set().union(*clutter.LOOK_ALIKES) <= known
    kinds = known - clutter.FURNITURE
    assert len(kinds) >= 30 and sum(map(variant_count, kinds)) >= 150
    for name in NAMES:
        assert len(clutter.candidates(scene_of(name, 1))) >= 10  # fewer where many kinds are mixed


def test_ten_things_nearly_always_find_a_place_and_sometimes_none_is_wanted() -> None:
    counts = [len(scene_of("Pick_Blocks_Area", seed, 2).clutter) for seed in range(100)]
    assert 0 < counts.count(0) <= 9 and np.median(counts) == 10
