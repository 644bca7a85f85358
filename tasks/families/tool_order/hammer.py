"""Hit_Blocks_Hammer_Order: hit coloured blocks with a hammer, colours in a fixed order.

Draw: a hammer lies in the middle; k fixed cubes, coloured red, green, blue, yellow, purple (the
first k), stand around it on one side of the table. Success: the hammer's head has hit each of them
in that order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Array
from robospa.tasks import objects
from robospa.tasks.families.stack_blocks.color import COLORS
from robospa.tasks.families.tabletop import Item, draw_look, named, side, standing
from robospa.tasks.goals.tools import HitCounter, UseInOrder
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText, color_orders
from robospa.tasks.plan import Hit, Skill
from robospa.tasks.sampling.places import Area, Mask, Point, scatter, shuffled
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "hammer.toml")

HALF, YAW, DISTANCE, TRIES = 0.025, 0.5, 0.12, 60
HAMMER: Point = (0.0, -0.06)
AREA, MIDDLE = Area((-0.25, 0.25), (-0.25, 0.25)), 0.05
ACROSS = 0.10
"""How far [m] the further blocks may lie beyond the middle, seen from the first one."""

FREE = 0.068
"""Least distance [m] of a block's centre from the hammer's handle and head."""

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The hammer, and the blocks with their colours in the order of the hits."""

    hammer: str
    colors: tuple[str, ...]
    order: tuple[str, ...]


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """The first block on a random side, the others where the same arm gets to."""
    left = bool(rng.random() < 0.5)
    arm = workcell.arms[0 if left else 1]
    nearest, farthest = arm.tool_reach

    def propose(generator: np.random.Generator) -> tuple[Array, Array, Mask]:
        x, y = AREA.draw(generator, (level, TRIES))
        inward = -x if left else x  # the first arm's side is positive
        usable = (np.abs(x) >= MIDDLE) & (inward >= -ACROSS) & _beside_hammer(x, y)
        usable[0] &= inward[0] > 0
        reach = np.hypot(x - arm.base[0], y - arm.base[1])
        usable &= (reach >= nearest) & (reach <= farthest)
        return x, y, usable & workcell.in_view(x, y, HALF * math.sqrt(2), 2 * HALF, (0.0, 0.0))

    found = scatter(rng, propose, DISTANCE)
    first, *others = found
    points = [first, *shuffled(rng, others)]
    items = [
        Item("hammer", "hammer", standing(HAMMER), draw_look(rng, "hammer")),
    ]
    for (color, rgb), point in zip(COLORS.items(), points, strict=False):
        look = {"half": [HALF, HALF, HALF], "color": list(rgb)}
        pose = standing(point, float(rng.uniform(-YAW, YAW)), HALF)
        items.append(Item(color, "block", pose, look, fixed=True))
    scene_objects, names = named(rng, items)
    colors = tuple(COLORS)[:level]
    facts = Facts(names["hammer"], colors, tuple(names[c] for c in colors))
    return SceneSample(scene_objects, facts)


def _beside_hammer(x: Array, y: Array) -> Mask:
    """Whether blocks at these places leave the hammer free."""
    half = objects.object_model("hammer").size[1] / 2
    dx, dy = x - HAMMER[0], y - HAMMER[1]
    free: Mask = np.hypot(dx, dy - np.clip(dy, -half, half)) >= FREE
    return free


def goal(scene: Scene) -> UseInOrder:
    """The blocks in their order."""
    hammer = scene.object(Facts.of(scene).hammer)
    head = objects.object_model(hammer.asset, hammer.params).frames["head"]
    counters = []
    for name in Facts.of(scene).order:
        block = scene.object(name)
        top = objects.object_model(block.asset, block.params).frames["press"]
        counters.append(HitCounter(name, top, hammer.name, head))
    return UseInOrder(counters, hammer.name)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """All hits by the arm on the first block's side."""
    order = Facts.of(scene).order
    arm = side(scene.object(order[0]).pose.position[0])
    return (Hit(Facts.of(scene).hammer, order, arm=arm),)


def slots(scene: Scene) -> Slots:
    """Phrasings for the order of the colours."""
    colors = Facts.of(scene).colors
    if len(colors) == 1:
        return TEXT.slots("hammer", "block", color=colors[0])
    return TEXT.slots("hammer") | {"order": color_orders(colors)}


TASK = Task(
    name="Hit_Blocks_Hammer_Order",
    category="OCE",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Hit the blocks with the hammer in the given order of colours.",
    success=(
        "The hammer's head has touched the middle of the blocks' tops in the order red, green, "
        "blue, yellow, purple (as many as there are)."
    ),
)
