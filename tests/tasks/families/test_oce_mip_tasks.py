"""Ordered and memory tasks: draws over many seeds, and plans that meet their goals."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator

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

STACKS = ("Stack_Blocks_Size_Order", "Stack_Blocks_Length_Order")
WALLED = (
    "Observe_Blocks_Move_Memory",
    "Observe_Objects_Click_Memory",
    "Remember_Orientation_Restore",
)
TASKS = (
    "Hit_Blocks_Hammer_Order",
    "Click_Objects_Order",
    "Stamp_Seals_Order",
    "Click_Bell_Clockwise_Order",
    *STACKS,
    *WALLED,
    "Press_Stapler_Memory",
)
LEVELS = range(1, 6)
VARIANTS = list(itertools.product(TASKS, LEVELS))
SEEDS = range(500_000, 500_200)
each_variant = pytest.mark.parametrize(("name", "level"), VARIANTS)
each_level = pytest.mark.parametrize("level", LEVELS)


def scenes(name: str, level: int, count: int = 100) -> Iterator[Scene]:
    return (build_scene(name, level, seed) for seed in SEEDS[:count])


def at(scene: Scene, name: str) -> tuple[float, float, float]:
    return scene.object(name).pose.position


def on_table(scene: Scene) -> list[SceneObject]:
    """What stands on the table and can be handled: no wall, no stand and nothing on it."""
    return [o for o in scene.objects if o.pose.position[2] < TABLE_TOP + 0.03]


@each_variant
def test_things_stand_free_on_the_table_wholly_in_view_and_in_reach(name: str, level: int) -> None:
    for scene in scenes(name, level, 40):
        assert [o.name for o in scene.objects] == [f"object_{i}" for i in range(len(scene.objects))]
        things = on_table(scene)
        models = [object_model(o.asset, o.params) for o in things]
        x, y, z = (np.array([o.pose.position[i] for o in things]) for i in range(3))
        assert np.allclose(z + [m.bottom for m in models], TABLE_TOP)
        radii = np.array([m.radius for m in models])
        whole = CELL.in_view(x, y, radii, np.array([m.size[2] for m in models]), (0.0, 0.0))
        assert whole.all(), (scene.seed, [o.asset for o in things], whole)
        assert CELL.in_reach(x, y).all() or name == "Remember_Orientation_Restore", scene.seed
        for i, j in itertools.combinations(range(len(models)), 2):
            kinds = {things[i].asset, things[j].asset}
            if kinds == {"pad"}:
                assert abs(x[i] - x[j]) >= 0.08, scene.seed
            elif "hammer" not in kinds:
                assert math.hypot(x[i] - x[j], y[i] - y[j]) > radii[i] + radii[j], scene.seed


@each_variant
def test_plan_meets_goal(name: str, level: int) -> None:
    found = task(name)
    for scene in scenes(name, level, 10):
        trial = Teleport(scene, found.goal(scene)).run(found.plan(scene))
        assert outcome(trial.events, trial.tracker.total).success, (scene.seed, trial.events)
        kinds = [e.kind for e in trial.events]
        assert not {"wrong_order", "wrong_object", "failed", "dropped", "repeated"} & set(kinds)
        assert kinds.count("success") == 1


@each_variant
def test_half_a_plan_does_not_succeed(name: str, level: int) -> None:
    found = task(name)
    for scene in scenes(name, level, 5):
        plan = [s for s in found.plan(scene) if type(s).__name__ != "Home"]
        trial = Teleport(scene, found.goal(scene)).run(plan[: (len(plan) - 1) // 2])
        assert not outcome(trial.events, trial.tracker.total).success


@each_variant
def test_idling_earns_only_what_is_given(name: str, level: int) -> None:
    scene = build_scene(name, level, SEEDS[0])
    trial = Teleport(scene, task(name).goal(scene))
    trial.tick(200)
    free = 1 if name in STACKS and level > 1 else 0
    assert outcome(trial.events, trial.tracker.total).done == free
    diagnostics = trial.tracker.diagnostics()  # type: ignore[attr-defined]
    assert diagnostics["idle_progress"] == pytest.approx(free / level)


@each_variant
def test_levels_are_those_of_the_benchmark(name: str, level: int) -> None:
    data = task(name).levels[level]
    assert data.steps == 200 * level + (50 if name in WALLED else 0)
    assert data.subtasks == level
    pairs = ("Observe_Blocks_Move_Memory", "Remember_Orientation_Restore")
    assert data.candidates == (2 * level if name in pairs else level)
    scene = build_scene(name, level, SEEDS[0])
    assert task(name).goal(scene).total == level


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


# One task each


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


def test_stapler_counts_are_uniform_and_rows_run_left_to_right() -> None:
    counts: Counter[int] = Counter()
    for scene in scenes("Press_Stapler_Memory", 5, 200):
        x = [at(scene, n)[0] for n in scene.facts["row"]]
        assert x == sorted(x)
        counts.update(scene.facts["counts"])
    assert set(counts) == {1, 2, 3, 4, 5} and min(counts.values()) > 150


@each_level
def test_pads_run_from_right_to_left_in_colours_that_can_be_told_apart(level: int) -> None:
    for scene in scenes("Stamp_Seals_Order", level):
        pads = [scene.object(n) for n in scene.facts["order"]]
        x = [p.pose.position[0] for p in pads]
        assert x == sorted(x, reverse=True)
        phrases = [object_model(p.asset, p.params).phrases[0] for p in pads]
        assert phrases == [f"{c} pad" for c in scene.facts["colors"]]
        twins = [{"teal", "turquoise"}, {"beige", "tan"}, {"gray", "silver"}, {"blue", "navy"}]
        assert not any(pair <= set(scene.facts["colors"]) for pair in twins)


@each_level
def test_blocks_to_hit_leave_the_hammer_free(level: int) -> None:
    for scene in scenes("Hit_Blocks_Hammer_Order", level):
        hammer = scene.object(scene.facts["hammer"])
        size = object_model(hammer.asset, hammer.params).size
        for name in scene.facts["order"]:
            x, y, _ = hammer.pose.inverse().apply(at(scene, name))
            gap = max(abs(x) - size[0] / 2, abs(y) - size[1] / 2)
            assert gap > 0.02, scene.seed


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
