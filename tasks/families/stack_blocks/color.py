"""Stack_Blocks_Color_Order: build a tower of coloured blocks, colours in a fixed order.

Draw: k equal cubes scattered in front of the robot, coloured red, green, blue, yellow, purple
(the first k). Success: each block rests on the one before it in that order, both grippers open.
Level 1 has one block, to be brought to the middle of the near edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robospa.tasks.colors import NAMED
from robospa.tasks.families.colors import first_colors
from robospa.tasks.families.stack_blocks.towers import (
    TowerFacts,
    building_place,
    tower_goal,
    tower_plan,
)
from robospa.tasks.families.tabletop import Item, middle_in_view, named, standing
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import COMMON, NUMBERS, TaskText, by_count, color_orders
from robospa.tasks.sampling.places import Point, apart, scatter_points
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneSample, Task
from robospa.text import listed
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "color.toml")

COLORS = {**first_colors(4), "purple": NAMED["purple"]}
"""Bottom to top."""

HALF = 0.018
X, Y, DISTANCE, YAW = (-0.28, 0.28), (-0.08, 0.05), 0.10, 0.75
LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(TowerFacts):
    """A tower and its colours from bottom to top."""

    colors: tuple[str, ...]


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Scattered cubes; at level 1 the only one starts away from the place it must go to."""

    def away(point: Point) -> bool:
        return abs(point[0]) >= 0.05 and apart(point, [(0.0, -0.10)], 0.10)

    def allowed(point: Point) -> bool:
        return (level > 1 or away(point)) and middle_in_view(workcell, point, HALF)

    points = scatter_points(rng, level, X, Y, DISTANCE, allowed, near_middle=True)
    items = [
        Item(
            color,
            "block",
            standing(point, float(rng.uniform(-YAW, YAW)), HALF),
            {"half": [HALF, HALF, HALF], "color": list(rgb)},
        )
        for (color, rgb), point in zip(COLORS.items(), points, strict=False)
    ]
    place = building_place(level, rng, points)
    scene_objects, names = named(rng, items)
    order = tuple(names[item.role] for item in items)
    facts = Facts(order, place, tuple(item.role for item in items))
    return SceneSample(scene_objects, facts)


def slots(scene: Scene) -> Slots:
    """Phrasings for the order of the colours."""
    colors, count = Facts.of(scene).colors, len(Facts.of(scene).colors)
    if count == 1:
        middle = COMMON.phrasings("middle.near")
        return TEXT.slots("block", color=colors[0]) | {"middle": middle}
    onto = list(zip(colors[1:], colors[:-1], strict=True))
    number = f"number.{by_count(count)}"
    return TEXT.slots(number, count=count, word=NUMBERS[count]) | {
        "order": color_orders(colors),
        "pairs": (
            (
                listed([f"{a} on {b}" for a, b in onto]),
                listed([f"{a} onto {b}" for a, b in onto], ", then "),
            ),
            (
                listed([f"{a} over {b}" for a, b in onto]),
                listed([f"{a} on top of {b}" for a, b in onto]),
                listed([f"{a} above {b}" for a, b in onto]),
            ),
        ),
        "bottom": TEXT.phrasings("end", color=colors[0]),
        "top": TEXT.phrasings("end", color=colors[-1]),
        "middle": COMMON.phrasings("middle.table"),
    }


TASK = Task(
    name="Stack_Blocks_Color_Order",
    category="OCE",
    levels=LEVELS,
    draw=draw,
    goal=tower_goal,
    plan=tower_plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Stack the blocks in the given order of colours.",
    success=(
        "Every block rests straight on the one before it, in the order red, green, blue, yellow, "
        "purple from the bottom, and both grippers are open. Level 1: the block lies near the "
        "robot in the middle."
    ),
)
