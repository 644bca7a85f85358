"""The canonical, relational and multi-view tasks and their basic versions, variant by variant."""

from __future__ import annotations

import itertools
import math
from functools import cache

import numpy as np
import pytest
from teleport import Teleport

from robospa.tasks.catalog import build_scene, task, tasks
from robospa.tasks.events import outcome
from robospa.tasks.families.canonical_index.task import LINES
from robospa.tasks.families.cross_view.scenes import LEADS, VIEWS, leaders
from robospa.tasks.families.cross_view.task import SPREADS
from robospa.tasks.families.picking import pick_name
from robospa.tasks.families.relational import scenes as relational
from robospa.tasks.families.relational.task import CROWDS
from robospa.tasks.objects import look_count, object_model
from robospa.tasks.plan import Pick
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Contact
from robospa.workcell import workcell

CELL = workcell("aloha-agilex")

COUNTS = {
    **dict.fromkeys(("CPI", "SOI"), (3, 6, 8, 9, 12)),
    "RRR": (2, 3, 4, 6, 9),
    **dict.fromkeys(("CVR", "EPG"), (3, 4, 5, 6, 7)),
}
NAMES = [t.name for t in tasks().values() if t.category in COUNTS]
GRID = {1: (1, 3), 2: (2, 3), 3: (2, 4), 4: (3, 3), 5: (3, 4)}
SEEDS = range(200_000, 200_024)
each_variant = pytest.mark.parametrize(
    ("name", "level"), list(itertools.product(NAMES, range(1, 6)))
)


@cache
def scenes(name: str, level: int) -> tuple[Scene, ...]:
    return tuple(build_scene(name, level, seed) for seed in SEEDS)


def places(scene: Scene) -> np.ndarray:
    """(count, 2) origins [m]."""
    return np.array([o.pose.position[:2] for o in scene.objects])


def corners(scene: Scene, i: int) -> np.ndarray:
    """The corners of the footprint of object `i`, (4, 2) [m], in order."""
    item = scene.objects[i]
    x, y = np.array(object_model(item.asset, item.params).size[:2]) / 2
    cos, sin = item.pose.rotation[0], item.pose.rotation[3]
    turn = np.array(
        [[cos**2 - sin**2, -2 * sin * cos], [2 * sin * cos, cos**2 - sin**2]]
    )  # of twice the half angle
    return np.array([(x, y), (-x, y), (-x, -y), (x, -y)]) @ turn.T + places(scene)[i]


def separate(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether a side of one rectangle has the other one wholly beyond it."""
    for axis in (*(a[1:3] - a[:2]), *(b[1:3] - b[:2])):
        one, other = a @ axis, b @ axis
        if one.max() < other.min() or other.max() < one.min():
            return True
    return False


@each_variant
def test_counts_and_limits(name: str, level: int) -> None:
    found = task(name)
    count = COUNTS[found.category][level - 1]
    asked = min(count, 4) if found.category in ("CVR", "EPG") else count
    assert {len(s.objects) for s in scenes(name, level)} == {count}
    facts = found.levels[level]
    assert (facts.candidates, facts.subtasks, facts.steps) == (asked, 1, 150)


@each_variant
def test_objects_are_seen_reached_and_apart(name: str, level: int) -> None:
    for scene in scenes(name, level):
        models = [object_model(o.asset, o.params) for o in scene.objects]
        x, y = places(scene).T
        radius = np.array([m.radius for m in models])
        assert CELL.in_view(x, y, radius).all(), scene.seed
        assert CELL.in_view(x, y, 0.0, np.array([m.size[2] for m in models])).all(), scene.seed
        assert CELL.in_reach(x, y).all(), scene.seed
        for i, j in itertools.combinations(range(len(models)), 2):
            circles = math.hypot(x[i] - x[j], y[i] - y[j]) > radius[i] + radius[j]
            assert circles or separate(corners(scene, i), corners(scene, j)), (scene.seed, i, j)


@each_variant
def test_only_the_asked_place_holds_the_target(name: str, level: int) -> None:
    for scene in scenes(name, level):
        target = [o.name for o in scene.objects].index(scene.facts["target"])
        if "column" in scene.facts:
            assert counted(scene) == target, scene.seed
        elif "relation" in scene.facts:
            assert beside(scene) == target, scene.seed
        else:
            x, y = places(scene).T
            along = {"leftmost": -x, "rightmost": x, "frontmost": y, "backmost": -y}
            lead = along[scene.facts["extreme"]]
            assert lead.argmax() == target, scene.seed
            first, leads = leaders(places(scene))
            assert len(set(first.tolist())) == min(len(scene.objects), 4), scene.seed
            assert leads.min() >= LEADS[level] - 1e-9, scene.seed


def counted(scene: Scene) -> int:
    """The object on the row and column that are asked for."""
    rows, columns = GRID[scene.level]
    facts = scene.facts
    lines = np.argsort(places(scene)[:, 1]).reshape(rows, columns)
    lines = lines[:: 1 if facts.get("row_direction") == "near_to_far" else -1]
    line = lines[facts.get("row", 1) - 1]
    line = line[np.argsort(places(scene)[line, 0])]
    line = line[:: 1 if facts["column_direction"] == "left_to_right" else -1]
    return int(line[facts["column"] - 1])


def beside(scene: Scene) -> int:
    """The nearest object that lies in the asked direction of the reference."""
    reference = [o.name for o in scene.objects].index(scene.facts["reference"])
    delta = places(scene) - places(scene)[reference]
    step = np.where(np.abs(delta) < 0.03, 0, np.sign(delta))
    wanted = relational.DIRECTIONS[scene.facts["relation"]]
    there = [i for i in range(len(step)) if tuple(step[i]) == wanted]
    return min(there, key=lambda i: float(np.hypot(*delta[i])))


@each_variant
def test_plan_meets_the_goal_and_a_wrong_pick_does_not(name: str, level: int) -> None:
    found, scene = task(name), scenes(name, level)[0]
    target = scene.facts["target"]
    wrong = next(o.name for o in scene.objects if o.name != target)
    for picked in (target, wrong):
        trial = Teleport(scene, found.goal(scene))
        trial.run((Pick(picked),))
        trial.tick(1, [Contact(picked, "left_gripper", (0.0, 0.0, 0.0))])
        assert outcome(trial.events, 1).success == (picked == target)
        assert any(e.kind == "wrong_object" for e in trial.events) == (picked == wrong)


@each_variant
def test_holding_still_scores_nothing(name: str, level: int) -> None:
    scene = scenes(name, level)[0]
    trial = Teleport(scene, task(name).goal(scene))
    trial.tick(20)
    assert not any(e.kind in ("subtask_done", "success") for e in trial.events)


@pytest.mark.parametrize("kind", [line.kind for line in LINES])
def test_basic_ordinal_tasks_count_one_way_only(kind: str) -> None:
    for level in range(1, 6):
        for scene in scenes(f"Basic_Ordinal_{kind}", level):
            assert scene.facts["column_direction"] == "left_to_right"
            assert scene.facts.get("row_direction", "far_to_near") == "far_to_near"
            assert task(scene.task).levels == task(pick_name(kind, "Canonical")).levels


@pytest.mark.parametrize("kind", [spread.kind for spread in SPREADS])
def test_basic_position_tasks_are_seen_by_the_robot(kind: str) -> None:
    for level in range(1, 6):
        for scene in scenes(f"Basic_Position_{kind}", level):
            assert scene.facts["viewpoint"] == "robot"
            assert scene.facts["position"] == scene.facts["extreme"]
    found = {s.facts["viewpoint"] for s in scenes(pick_name(kind, "Multi_View"), 1)}
    assert found == set(VIEWS)


def test_bounds_hold_for_all_looks() -> None:
    for crowd in CROWDS:
        for family in crowd.families:
            if family.asset != "block":
                for k in range(look_count(family.asset)):
                    model = object_model(family.asset, {"look": k})
                    assert model.radius <= crowd.radius
                    # of soaps, which are flat, only the footprint is kept in view
                    assert model.size[2] <= crowd.tall or family.asset == "soap"


@pytest.mark.parametrize(
    "name", ["Pick_Blocks_Canonical", "Pick_Cups_Canonical", "Pick_Cans_Relational"]
)
def test_objects_of_one_kind_look_the_same(name: str) -> None:
    for level in range(1, 6):
        for scene in scenes(name, level):
            assert len({(o.asset, str(o.params)) for o in scene.objects}) == 1
