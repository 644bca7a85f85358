"""Stack_Blocks_Size_Order: build a tower of cubes, the largest at the bottom.

Draw: k cubes of one random colour and fixed sizes, scattered in front of the robot. Success: each
rests on the next larger one, both grippers open. Level 1 has one cube of random size, to be brought
to the middle of the near edge.
"""

from __future__ import annotations

import numpy as np

from robospa.tasks.families.colors import drawn_color
from robospa.tasks.families.stack_blocks.towers import (
    SIZE,
    TEXT,
    TowerFacts,
    building_place,
    tower_goal,
    tower_plan,
    tower_slots,
)
from robospa.tasks.families.tabletop import Item, named, standing
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.sampling.places import Area, Ground, scatter_blocks
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneSample, Task
from robospa.workcell import Workcell

HALVES = {
    2: (0.0165, 0.01275),
    3: (0.0165, 0.01275, 0.009),
    4: (0.02025, 0.0165, 0.01275, 0.009),
    5: (0.024, 0.02025, 0.0165, 0.01275, 0.009),
}
"""Half sizes [m] from bottom to top."""

ONE = (0.015, 0.025)
"""Level 1: range of the only cube's half size [m]."""

AREA, DISTANCE, YAW = Area((-0.28, 0.28), (-0.08, 0.05), clear_middle=True), 0.10, 0.75
MIDDLE = (0.0, -0.10)

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Scattered cubes, away from the middle of the near edge."""
    halves = HALVES.get(level) or (round(float(rng.uniform(*ONE)), 5),)
    cubes = [(half, half, half) for half in halves]
    ground = Ground(AREA, 0.05, MIDDLE, 0.10 if level == 1 else 0.15)
    points = scatter_blocks(rng, workcell, ground, cubes, lambda i, j: DISTANCE)
    color = drawn_color(rng)
    items = [
        Item(
            f"block {i}",
            "block",
            standing(point, float(rng.uniform(-YAW, YAW)), half),
            {"half": [half, half, half], "color": color},
        )
        for i, (half, point) in enumerate(zip(halves, points, strict=True))
    ]
    place = building_place(level, rng, points)
    scene_objects, names = named(rng, items)
    facts = TowerFacts(tuple(names[item.role] for item in items), place)
    return SceneSample(scene_objects, facts)


def slots(scene: Scene) -> Slots:
    """Phrasings for the order of the sizes."""
    return tower_slots(SIZE, len(TowerFacts.of(scene).order))


TASK = Task(
    name="Stack_Blocks_Size_Order",
    category="OCE",
    levels=LEVELS,
    draw=draw,
    goal=tower_goal,
    plan=tower_plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Stack the blocks from the largest at the bottom to the smallest on top.",
    success=(
        "Every block rests straight on the next larger one and both grippers are open. Level 1: "
        "the block lies near the robot in the middle."
    ),
)
