"""The five spatial tasks: properties of many draws, and plans that meet their goals."""

from __future__ import annotations

import itertools
import json
import math
from collections import Counter
from collections.abc import Iterable
from functools import cache

import numpy as np
import pytest
from teleport import Teleport

from robospa.tasks.catalog import build_scene, task
from robospa.tasks.events import outcome
from robospa.tasks.families.cross_view.scenes import LEADS
from robospa.tasks.families.cross_view.task import SPREADS
from robospa.tasks.families.distance import object_sets
from robospa.tasks.families.relational import scenes as relational
from robospa.tasks.objects import look_count, object_model
from robospa.tasks.plan import Pick
from robospa.tasks.sampling.region import Area
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Contact
from robospa.workcell import TABLE_TOP, workcell

CELL = workcell("aloha-agilex")

BLOCKS, DISTANCE, CANONICAL, SOAPS, VIEWS = TASKS = (
    "Pick_Blocks_Size",
    "Pick_Mixed_Objects_Distance_B",
    "Pick_Mixed_Objects_Canonical_A",
    "Pick_Soaps_Relational",
    "Pick_Mixed_Objects_Multi_View_A",
)
LEVELS = range(1, 6)
VARIANTS = list(itertools.product(TASKS, LEVELS))
SEEDS = range(200_000, 200_160)
each_variant = pytest.mark.parametrize(("name", "level"), VARIANTS)
each_level = pytest.mark.parametrize("level", LEVELS)

OBJECTS = {
    BLOCKS: (2, 3, 4, 5, 6),
    DISTANCE: (3, 4, 5, 6, 7),
    CANONICAL: (3, 6, 8, 9, 12),
    SOAPS: (2, 3, 4, 6, 9),
    VIEWS: (3, 4, 5, 6, 7),
}
REGIONS = {
    BLOCKS: Area((-0.31, 0.31), (-0.15, 0.13)),
    DISTANCE: Area((-0.22, 0.22), (-0.18, 0.08)),
    CANONICAL: Area((-0.30, 0.30), (-0.19, 0.10)),
    SOAPS: Area((-0.228, 0.228), (-0.215, 0.075)),
    VIEWS: Area((-0.24, 0.24), (-0.225, 0.095)),
}


@cache
def scenes(name: str, level: int) -> tuple[Scene, ...]:
    return tuple(build_scene(name, level, seed) for seed in SEEDS)


def places(scene: Scene) -> np.ndarray:
    """(count, 2) origins [m]."""
    return np.array([o.pose.position[:2] for o in scene.objects])


def gaps(scene: Scene) -> np.ndarray:
    """Distances [m] of all pairs of origins."""
    p = places(scene)
    return np.array([math.dist(a, b) for a, b in itertools.combinations(p.tolist(), 2)])


def box(scene: Scene, i: int) -> np.ndarray:
    """Size [m] along the world's x and y of an object that stands straight or sideways."""
    item = scene.objects[i]
    size = object_model(item.asset, item.params).size[:2]
    return np.array(size if abs(item.pose.rotation[3]) < 0.1 else size[::-1])


def index_of(scene: Scene, fact: str = "target") -> int:
    return [o.name for o in scene.objects].index(scene.facts[fact])


def assert_near_uniform(values: Iterable[object], kinds: int) -> None:
    """Every kind occurs, and none is off by more than 4.5 standard deviations."""
    counts = Counter(values)
    total = sum(counts.values())
    assert len(counts) == kinds
    spread = 4.5 * math.sqrt(total / kinds * (1 - 1 / kinds))
    assert all(abs(c - total / kinds) <= spread for c in counts.values()), counts


# Every variant


@each_variant
def test_counts_are_the_official_ones(name: str, level: int) -> None:
    facts = task(name).levels[level]
    objects = OBJECTS[name][level - 1]
    assert {len(s.objects) for s in scenes(name, level)} == {objects}
    assert facts.candidates == (min(objects, 4) if name == VIEWS else objects)
    assert (facts.subtasks, facts.steps) == (1, 150)


@each_variant
def test_scene_is_a_value(name: str, level: int) -> None:
    scene = scenes(name, level)[0]
    again = build_scene(name, level, scene.seed)
    copy = Scene.from_json(json.loads(json.dumps(scene.to_json())))
    assert scene.digest == again.digest == copy.digest
    assert len({s.digest for s in scenes(name, level)}) == len(SEEDS)


@each_variant
def test_names_are_neutral(name: str, level: int) -> None:
    for scene in scenes(name, level):
        names = [o.name for o in scene.objects]
        assert names == [f"object_{i}" for i in range(len(names))]


@each_variant
def test_target_is_any_name(name: str, level: int) -> None:
    found = scenes(name, level)
    assert_near_uniform((index_of(s) for s in found), len(found[0].objects))


@each_variant
def test_objects_stand_on_the_table_within_the_region(name: str, level: int) -> None:
    (left, right), (near, far) = REGIONS[name].x, REGIONS[name].y
    for scene in scenes(name, level):
        for item in scene.objects:
            x, y, z = item.pose.position
            assert left <= x <= right and near <= y <= far
            assert z + object_model(item.asset, item.params).bottom == pytest.approx(TABLE_TOP)


@each_variant
def test_footprints_and_objects_axes_are_in_view_and_in_reach(name: str, level: int) -> None:
    for scene in scenes(name, level):
        models = [object_model(o.asset, o.params) for o in scene.objects]
        x, y = places(scene).T
        radius = np.array([m.radius for m in models])
        height = np.array([m.size[2] for m in models])
        assert CELL.in_view(x, y, radius, 0.0).all()
        assert CELL.in_view(x, y, 0.0, height).all()
        assert CELL.in_reach(x, y).all()


@each_variant
def test_footprints_do_not_overlap(name: str, level: int) -> None:
    for scene in scenes(name, level):
        models = [object_model(o.asset, o.params) for o in scene.objects]
        for i, j in itertools.combinations(range(len(models)), 2):
            a, b = places(scene)[[i, j]]
            straight = name == CANONICAL
            room = (box(scene, i) + box(scene, j)) / 2
            apart_in_box = bool((np.abs(a - b) > room).any())
            circles = math.dist(a, b) > models[i].radius + models[j].radius
            assert circles or (straight and apart_in_box), (scene.seed, i, j)


@each_variant
def test_plan_meets_the_goal(name: str, level: int) -> None:
    for scene in scenes(name, level)[:5]:
        found = task(name)
        assert found.plan(scene) == (Pick(scene.facts["target"]),)
        trial = Teleport(scene, found.goal(scene))
        trial.run(found.plan(scene))
        touching = Contact(scene.facts["target"], "left_gripper", (0.0, 0.0, 0.0))
        trial.tick(1, [touching])
        assert outcome(trial.events, 1).success
        assert [e.kind for e in trial.events if e.kind == "wrong_object"] == []


# Pick Blocks Size


@each_level
def test_size_ranks_are_uniform_true_and_hidden(level: int) -> None:
    found = scenes(BLOCKS, level)
    count = len(found[0].objects)
    assert_near_uniform((s.facts["size_rank"] for s in found), count)
    largest = []
    for scene in found:
        halves = [o.params["half"][0] for o in scene.objects]
        order = sorted(range(count), key=lambda i: -halves[i])
        assert order[scene.facts["size_rank"] - 1] == index_of(scene)
        assert len({tuple(o.params["color"]) for o in scene.objects}) == 1
        largest.append(order[0])
    assert_near_uniform(largest, count)


@each_level
def test_large_blocks_lie_where_small_ones_do(level: int) -> None:
    # Rank and x are independent: the standardised covariance of n pairs stays within 4 / sqrt(n).
    halves = [o.params["half"][0] for s in scenes(BLOCKS, level) for o in s.objects]
    x, y = np.concatenate([places(s) for s in scenes(BLOCKS, level)]).T
    for side in (x, y):
        assert abs(np.corrcoef(halves, side)[0, 1]) < 4 / math.sqrt(len(halves))


@each_level
def test_blocks_keep_the_margin_of_their_level(level: int) -> None:
    margin = {1: 0.055, 2: 0.055, 3: 0.04, 4: 0.08, 5: 0.052}[level]
    for scene in scenes(BLOCKS, level):
        halves = [o.params["half"][0] for o in scene.objects]
        room = [a + b + margin for a, b in itertools.combinations(halves, 2)]
        assert (gaps(scene) >= np.array(room) - 1e-9).all()


# Pick Mixed Objects Distance B


@each_level
def test_distance_ranks_are_uniform_and_clear(level: int) -> None:
    found = scenes(DISTANCE, level)
    count = len(found[0].objects)
    assert_near_uniform((s.facts["distance_rank"] for s in found), count - 1)
    for scene in found:
        reference, points = index_of(scene, "reference"), places(scene).tolist()
        far = [math.dist(p, points[reference]) for p in points]
        rank = scene.facts["distance_rank"]
        assert sorted(range(count), key=lambda i: -far[i])[rank - 1] == index_of(scene)
        others = [d for i, d in enumerate(far) if i not in (reference, index_of(scene))]
        assert min(abs(d - far[index_of(scene)]) for d in others) >= 0.058 - 1e-9


@each_level
def test_distance_layouts_keep_the_official_distance(level: int) -> None:
    least = object_sets.MIXED_B.rules.apart[level - 1]
    assert min(gaps(s).min() for s in scenes(DISTANCE, level)) >= least - 1e-9


@each_level
def test_any_category_may_be_the_reference(level: int) -> None:
    found = scenes(DISTANCE, level)
    assert_near_uniform(
        (s.objects[index_of(s, "reference")].asset for s in found), len(found[0].objects)
    )
    assert_near_uniform((s.objects[index_of(s)].asset for s in found), len(found[0].objects))


# Pick Mixed Objects Canonical A


@each_level
def test_grid_position_is_counted_right(level: int) -> None:
    rows, columns = {1: (1, 3), 2: (2, 3), 3: (2, 4), 4: (3, 3), 5: (3, 4)}[level]
    cells = []
    for scene in scenes(CANONICAL, level):
        x, y = places(scene)[index_of(scene)]
        column = int((places(scene)[:, 0] < x - 0.07).sum()) // rows
        row = int((places(scene)[:, 1] < y - 0.05).sum()) // columns
        cells.append((row, column))
        facts = scene.facts
        left = facts["column_direction"] == "left_to_right"
        assert facts["column"] == (column + 1 if left else columns - column)
        if rows > 1:
            near = facts["row_direction"] == "near_to_far"
            assert facts["row"] == (row + 1 if near else rows - row)
        else:
            assert "row" not in facts
    assert_near_uniform(cells, rows * columns)


# Pick Soaps Relational


@each_level
def test_directions_and_target_slots_are_both_uniform(level: int) -> None:
    table = relational.weights(level)
    assert table.sum() == pytest.approx(1.0)
    assert table.sum(axis=1) == pytest.approx(1 / 8, rel=1e-4)
    assert table.sum(axis=0) == pytest.approx(1 / table.shape[1], rel=1e-4)
    assert_near_uniform((s.facts["relation"] for s in scenes(SOAPS, level)), 8)


@each_level
def test_target_is_the_nearest_soap_in_its_direction(level: int) -> None:
    for scene in scenes(SOAPS, level):
        step = np.sign(places(scene) - places(scene)[index_of(scene, "reference")])
        delta = places(scene) - places(scene)[index_of(scene, "reference")]
        step = np.where(np.abs(delta) < 0.03, 0, step)
        wanted = relational.DIRECTIONS[scene.facts["relation"]]
        there = [i for i in range(len(step)) if tuple(step[i]) == wanted]
        nearest = min(there, key=lambda i: float(np.hypot(*delta[i])))
        assert nearest == index_of(scene)


@each_level
def test_soaps_of_a_scene_look_the_same(level: int) -> None:
    assert all(len({str(o.params) for o in s.objects}) == 1 for s in scenes(SOAPS, level))
    assert len({str(s.objects[0].params) for s in scenes(SOAPS, level)}) == look_count("soap")


# Pick Mixed Objects Multi View A

TURN = {"robot": 0, "right": 1, "opposite": 2, "left": 3}
"""Quarter turns from the viewer's right to the robot's right."""


@each_level
def test_extreme_is_what_the_viewer_would_call_it(level: int) -> None:
    for scene in scenes(VIEWS, level):
        x, y = places(scene).T
        for _ in range(TURN[scene.facts["viewpoint"]]):
            x, y = y, -x
        value = {"leftmost": -x, "rightmost": x, "frontmost": y, "backmost": -y}
        along = value[scene.facts["position"]]
        first, second = np.sort(along)[::-1][:2]
        assert along.argmax() == index_of(scene) and first - second > LEADS[level] - 1e-9


@each_level
def test_extremes_views_and_families_are_uniform(level: int) -> None:
    found = scenes(VIEWS, level)
    assert_near_uniform((s.facts["extreme"] for s in found), 4)
    assert_near_uniform((s.facts["viewpoint"] for s in found), 4)
    assert_near_uniform((s.facts["position"] for s in found), 4)
    assert_near_uniform((s.objects[index_of(s)].asset for s in found), 7)


def test_layout_pools_have_the_bounds_of_the_assets() -> None:
    for spread in SPREADS:
        for asset in set(spread.assets) - {"block"}:
            for look in range(look_count(asset)):
                model = object_model(asset, {"look": look})
                assert model.radius <= spread.radius and model.size[2] <= spread.tall
    for asset in object_sets.ASSETS_B:
        assert object_model(asset, {"look": 0}).radius <= object_sets.MIXED_B.rules.radius
