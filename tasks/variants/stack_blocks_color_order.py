"""Stack_Blocks_Color_Order: build a tower of coloured blocks, colours in a fixed order.

Draw: k equal cubes scattered in front of the robot, coloured red, green, blue, yellow, purple
(the first k). Success: each block rests on the one before it in that order, both grippers open.
Level 1 has one block, to be brought to the middle of the near edge.
"""

from __future__ import annotations

import numpy as np

from robospa.tasks.goals.stack import Bring, Stack
from robospa.tasks.instructions import words_procedural
from robospa.tasks.instructions.words import Slots
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.scene import TABLE_TOP, Scene
from robospa.tasks.task import Draft, Level, Task
from robospa.tasks.variants.tabletop import (
    Item,
    Point,
    apart,
    named,
    scatter,
    side,
    standing,
)

COLORS = {
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
    "yellow": (1.0, 1.0, 0.0),
    "purple": (0.6, 0.2, 0.8),
}
"""Bottom to top."""

HALF = 0.018
X, Y, DISTANCE, YAW = (-0.28, 0.28), (-0.08, 0.05), 0.10, 0.75
NEAR_BAND: tuple[Point, Point] = ((-0.05, 0.05), (-1.0, -0.08))
"""Level 1: the block's centre must come here (x, y)."""

CLEARANCE = 0.09
"""The expert's place keeps this far [m] from all blocks where it can: a gripper must fit."""

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


def _place(level: int, rng: np.random.Generator, blocks: tuple[Point, ...]) -> Point:
    """Where the expert builds; not part of the task's rule."""
    x, y = ((-0.01, 0.01), (-0.20, -0.10)) if level == 1 else ((-0.03, 0.03), (-0.15, -0.11))
    for _ in range(100):
        point = (float(rng.uniform(*x)), float(rng.uniform(*y)))
        if apart(point, blocks, CLEARANCE):
            return point
    return (0.0, -0.16)


def draw(level: int, rng: np.random.Generator) -> Draft:
    """Scattered cubes; at level 1 the only one starts away from the place it must go to."""

    def away(point: Point) -> bool:
        return abs(point[0]) >= 0.05 and apart(point, [(0.0, -0.10)], 0.10)

    anywhere = (lambda point: True) if level > 1 else away
    points = scatter(rng, level, X, Y, DISTANCE, anywhere, near_middle=True)
    items = [
        Item(
            color,
            "block",
            standing(point, float(rng.uniform(-YAW, YAW)), HALF),
            {"half": [HALF, HALF, HALF], "color": list(rgb)},
        )
        for (color, rgb), point in zip(COLORS.items(), points, strict=False)
    ]
    place = _place(level, rng, points)
    scene_objects, names = named(rng, items)
    facts = {
        "order": [names[item.role] for item in items],
        "colors": [item.role for item in items],
        "place": list(place),
    }
    return Draft(scene_objects, facts)


def goal(scene: Scene) -> Stack | Bring:
    """A tower, or at level 1 a block in the near band."""
    order = scene.facts["order"]
    return Stack(order, 2 * HALF) if scene.level > 1 else Bring(order[0], *NEAR_BAND)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Bottom block to the drawn place, every further block on top of the one before."""
    order = list(scene.facts["order"])
    x, y = scene.facts["place"]
    skills: list[Skill] = []
    for i, name in enumerate(order):
        arm = side(scene.object(name).pose.position[0])
        skills.append(Pick(name, lift=0.10 + 2 * HALF * i, arm=arm))
        if i == 0:
            skills.append(Place(name, (x, y, TABLE_TOP + HALF), arm=arm))
        else:
            skills.append(Place(name, on=order[i - 1], arm=arm))
    return tuple(skills)


def slots(scene: Scene) -> Slots:
    """How the order of the colours is said."""
    return words_procedural.stack(list(scene.facts["colors"]))


TASK = Task(
    name="Stack_Blocks_Color_Order",
    category="OCE",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    slots=slots,
    summary="Stack the blocks in the given order of colours.",
    success=(
        "Every block rests straight on the one before it, in the order red, green, blue, yellow, "
        "purple from the bottom, and both grippers are open. Level 1: the block lies near the "
        "robot in the middle."
    ),
)
