"""The five procedural tasks: draws over thousands of seeds, and plans that meet their goals."""

from __future__ import annotations

import itertools
import math
from collections import Counter

import numpy as np
import pytest
from teleport import Teleport

from robospa.geometry import rotate
from robospa.tasks.catalog import build_scene, task
from robospa.tasks.events import outcome
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene, SceneObject
from robospa.workcell import TABLE_TOP, workcell

CELL = workcell("aloha-agilex")

TASKS = (
    "Press_Stapler_Repeat",
    "Put_Bottles_Dustbin",
    "Stack_Blocks_Color_Order",
    "Click_Can_Place_Items",
    "Remember_Color_Cover",
)
LEVELS = range(1, 6)
VARIANTS = list(itertools.product(TASKS, LEVELS))
SEEDS = range(100_000, 100_200)


def scenes(name: str, level: int, seeds: range = SEEDS) -> list[Scene]:
    return [build_scene(name, level, seed) for seed in seeds]


def on_table(scene: Scene) -> list[SceneObject]:
    """What stands on the table from the start, except flat pads."""
    return [
        o
        for o in scene.objects
        if o.appears_at is None and o.asset != "dustbin" and o.params.get("half", [1])[-1] > 0.001
    ]


@pytest.mark.parametrize(("name", "level"), VARIANTS)
def test_scenes_are_values(name: str, level: int) -> None:
    for scene in scenes(name, level, SEEDS[:25]):
        again = build_scene(name, level, scene.seed)
        assert again == scene
        assert Scene.from_json(scene.to_json()) == scene
        assert Scene.from_json(scene.to_json()).digest == scene.digest


@pytest.mark.parametrize(("name", "level"), VARIANTS)
def test_names_are_neutral_and_numbered(name: str, level: int) -> None:
    for scene in scenes(name, level, SEEDS[:25]):
        assert [o.name for o in scene.objects] == [f"object_{i}" for i in range(len(scene.objects))]


@pytest.mark.parametrize(("name", "level"), VARIANTS)
def test_footprints_do_not_overlap_and_rest_on_the_table(name: str, level: int) -> None:
    for scene in scenes(name, level):
        things = on_table(scene)
        for thing in things:
            bottom = object_model(thing.asset, thing.params).bottom
            assert thing.pose.position[2] + bottom == pytest.approx(TABLE_TOP, abs=1e-9)
        for a, b in itertools.combinations(things, 2):
            distance = math.dist(a.pose.position[:2], b.pose.position[:2])
            radii = [object_model(o.asset, o.params).radius for o in (a, b)]
            assert distance > sum(radii)


@pytest.mark.parametrize(("name", "level"), VARIANTS)
def test_plan_meets_goal(name: str, level: int) -> None:
    found = task(name)
    for scene in scenes(name, level, SEEDS[:25]):
        trial = Teleport(scene, found.goal(scene)).run(found.plan(scene))
        kinds = [e.kind for e in trial.events]
        assert outcome(trial.events, trial.tracker.total).success, (scene.seed, trial.events)
        assert not {"wrong_order", "wrong_object", "failed", "dropped", "repeated"} & set(kinds)
        assert kinds.count("success") == 1


@pytest.mark.parametrize(("name", "level"), VARIANTS)
def test_half_a_plan_does_not_succeed(name: str, level: int) -> None:
    found = task(name)
    for scene in scenes(name, level, SEEDS[:10]):
        plan = [s for s in found.plan(scene) if type(s).__name__ not in ("Home", "Wait")]
        trial = Teleport(scene, found.goal(scene)).run(plan[: (len(plan) - 1) // 2])
        assert not outcome(trial.events, trial.tracker.total).success


@pytest.mark.parametrize(("name", "level"), VARIANTS)
def test_idling_earns_only_what_is_given(name: str, level: int) -> None:
    scene = build_scene(name, level, 100_000)
    trial = Teleport(scene, task(name).goal(scene))
    trial.tick(200)
    free = 1 if name == "Stack_Blocks_Color_Order" and level > 1 else 0
    assert outcome(trial.events, trial.tracker.total).done == free
    diagnostics = trial.tracker.diagnostics()  # type: ignore[attr-defined]
    assert diagnostics["idle_progress"] == pytest.approx(free / level)


@pytest.mark.parametrize(("name", "level"), VARIANTS)
def test_levels_are_those_of_the_benchmark(name: str, level: int) -> None:
    limits = {
        "Put_Bottles_Dustbin": 400 * level,
        "Remember_Color_Cover": 50 + 200 * level,
    }
    data = task(name).levels[level]
    assert data.steps == limits.get(name, 200 * level)
    assert data.subtasks == level
    scene = build_scene(name, level, 100_000)
    assert task(name).goal(scene).total == level


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


@pytest.mark.parametrize("level", LEVELS)
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
    first = Counter(s.facts["order"][0] for s in scenes("Stack_Blocks_Color_Order", 5))
    assert len(first) == 5 and min(first.values()) > len(SEEDS) / 10


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


@pytest.mark.parametrize(("name", "level"), VARIANTS)
def test_slots_are_filled_for_both_splits(name: str, level: int) -> None:
    scene = build_scene(name, level, 100_000)
    for slot, (train, held_out) in task(name).slots(scene).items():
        assert train and held_out, slot


@pytest.mark.parametrize(("name", "level"), VARIANTS)
def test_the_head_camera_sees_every_centre_and_an_arm_reaches_it(name: str, level: int) -> None:
    for scene in scenes(name, level, SEEDS[:100]):
        spots = [o.pose.position for o in scene.objects if o.asset != "dustbin"]
        x, y = (np.array([spot[i] for spot in spots]) for i in (0, 1))
        assert CELL.in_view(x, y, margin=(0.0, 0.0)).all(), scene.seed
        assert CELL.in_reach(x, y).all(), scene.seed
