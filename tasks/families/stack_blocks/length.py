"""Stack_Blocks_Length_Order: build a tower of bars, the longest at the bottom.

Draw: k bars of one random colour and one cross-section, their lengths clearly different, scattered
in front of the robot. Success: each rests on the next longer one, both grippers open. Level 1 has
one short bar, to be brought to the middle of the near edge.
"""

from __future__ import annotations

import math

import numpy as np

from robospa.tasks.families.colors import drawn_color
from robospa.tasks.families.stack_blocks.towers import (
    LENGTH,
    TEXT,
    TowerFacts,
    building_place,
    tower_goal,
    tower_plan,
    tower_slots,
)
from robospa.tasks.families.tabletop import Item, named, standing
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.sampling.places import Area, Ground, Points, scatter_blocks, spread
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneSample, Task
from robospa.workcell import Workcell

HALF_LENGTHS = {
    1: ((0.0240, 0.0250),),
    2: ((0.0440, 0.0450), (0.0240, 0.0250)),
    3: ((0.0440, 0.0450), (0.0240, 0.0250), (0.0120, 0.0130)),
    4: ((0.0440, 0.0450), (0.0330, 0.0340), (0.0240, 0.0250), (0.0120, 0.0130)),
    5: (
        *((0.0440, 0.0450), (0.0330, 0.0340), (0.0240, 0.0250)),
        *((0.0170, 0.0180), (0.0120, 0.0130)),
    ),
}
"""Ranges of the half lengths [m] from bottom to top."""

SECTION = (0.0155, 0.0165)
"""Range of half width and half height [m], the same for all bars of a scene."""

SPANS = {1: (0.0, 0.0), 2: (0.06, 0.0), 3: (0.10, 0.03), 4: (0.15, 0.04), 5: (0.15, 0.04)}
"""Least spread of the bars in x and y [m]."""

GROUNDS = {
    1: Ground(Area((-0.28, 0.28), (-0.08, 0.05), clear_middle=True), 0.05, (0.0, -0.10), 0.10),
    2: Ground(Area((-0.25, 0.25), (-0.15, 0.05), clear_middle=True), 0.02, (0.0, -0.12), 0.1225),
}
"""Level 1, and all others."""

GAP, YAW = 0.045, 0.20

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Scattered bars, away from the middle of the near edge."""
    half_y, half_z = (round(float(v), 5) for v in rng.uniform(*SECTION, 2))
    halves = [(round(float(rng.uniform(*ends)), 5), half_y, half_z) for ends in HALF_LENGTHS[level]]
    reach = [math.hypot(half[0], half_y) for half in halves]
    points = scatter_blocks(
        rng,
        workcell,
        GROUNDS[min(level, 2)],
        halves,
        lambda i, j: reach[i] + reach[j] + GAP,
        lambda found: _wide(level, found),
    )
    color = drawn_color(rng)
    items = []
    for i, half in enumerate(halves):
        pose = standing(points[i], float(rng.uniform(-YAW, YAW)), half_z)
        items.append(Item(f"block {i}", "block", pose, {"half": list(half), "color": color}))
    place = building_place(level, rng, points)
    scene_objects, names = named(rng, items)
    facts = TowerFacts(tuple(names[item.role] for item in items), place)
    return SceneSample(scene_objects, facts)


def _wide(level: int, points: Points) -> bool:
    least_x, least_y = SPANS[level]
    return spread([p[0] for p in points]) >= least_x and spread([p[1] for p in points]) >= least_y


def slots(scene: Scene) -> Slots:
    """Phrasings for the order of the lengths."""
    return tower_slots(LENGTH, len(TowerFacts.of(scene).order))


TASK = Task(
    name="Stack_Blocks_Length_Order",
    category="OCE",
    levels=LEVELS,
    draw=draw,
    goal=tower_goal,
    plan=tower_plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Stack the blocks from the longest at the bottom to the shortest on top.",
    success=(
        "Every block rests straight on the next longer one and both grippers are open. Level 1: "
        "the block lies near the robot in the middle."
    ),
)
