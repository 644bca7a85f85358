"""Click_Bell_Clockwise_Order: click bells that stand in a ring, clockwise from the farthest one.

Draw: k equal bells on a wobbly ring anywhere in the region; clockwise is as seen from above.
Success: all were clicked in that order with a closed gripper.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robospa.tasks.families.click_order import objects
from robospa.tasks.families.click_order.clicking import click, click_counter, clickable_look
from robospa.tasks.families.tabletop import Item, in_view, named, side, standing
from robospa.tasks.goals.clicks import ClickInOrder
from robospa.tasks.instructions.grammar import Slots, Templates
from robospa.tasks.instructions.text import NUMBERS, TaskText, acting_arm, one_after_another
from robospa.tasks.plan import Skill
from robospa.tasks.sampling.places import LayoutError, Point, apart
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "bells.toml")

X, Y = (-0.255, 0.255), (-0.225, 0.055)
APART = {1: 0.0, 2: 0.12, 3: 0.080, 4: 0.085, 5: 0.085}
"""Least distance [m] between bells."""

BASE = {3: (0.09, 0.14), 4: (0.09, 0.14), 5: (0.088, 0.138)}
"""Range of the ring's radius [m]."""

LEAD, TURN, LAYOUTS = 0.012, 0.12, 400
"""The first bell is this much farther [m]; angles between bells are at least this [rad]."""

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The bells in the order of the clicks."""

    order: tuple[str, ...]


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """The ring of bells, all of one look, shifted to a random place of the region."""
    params = clickable_look(rng, "bell")
    points = _ring(level, rng, in_view(workcell, "bell", params))
    items = [
        Item(f"bell {i}", "bell", standing(point), params, fixed=True)
        for i, point in enumerate(points)
    ]
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(tuple(names[item.role] for item in items)))


def _ring(level: int, rng: np.random.Generator, seen: Callable[[Point], bool]) -> list[Point]:
    """Places [m] in clicking order, all of which are `seen`."""
    for _ in range(LAYOUTS):
        ring = _pair(rng) if level == 2 else _round(level, rng) if level > 2 else [(0.0, 0.0)]
        if _regular(ring, APART[level]):
            shift = [
                float(rng.uniform(low - min(p[k] for p in ring), high - max(p[k] for p in ring)))
                for k, (low, high) in enumerate((X, Y))
            ]
            ring = [(x + shift[0], y + shift[1]) for x, y in ring]
            if all(seen(point) for point in ring):
                return ring
    raise LayoutError(f"no ring of {level} bells in {LAYOUTS} draws; skip this seed")


def _pair(rng: np.random.Generator) -> list[Point]:
    """One bell far, one near."""
    base = float(rng.uniform(0.10, 0.15))
    return [
        (float(rng.uniform(-0.015, 0.015)), way * base * float(rng.uniform(0.92, 1.10)))
        for way in (1, -1)
    ]


def _round(level: int, rng: np.random.Generator) -> list[Point]:
    """Bells around the origin, clockwise from the far side."""
    base = float(rng.uniform(*BASE[level]))
    wide, deep = float(rng.uniform(0.80, 1.18)), float(rng.uniform(0.80, 1.14))
    ring = []
    for i in range(level):
        angle = math.pi / 2 - 2 * math.pi * i / level
        angle += float(rng.uniform(-0.05, 0.05) if i == 0 else rng.uniform(-0.22, 0.22))
        radius = base * float(rng.uniform(0.85, 1.18))
        dx, dy = (float(v) for v in rng.uniform(-0.012, 0.012, 2))
        ring.append((wide * radius * math.cos(angle) + dx, deep * radius * math.sin(angle) + dy))
    return ring


def _regular(ring: list[Point], distance: float) -> bool:
    """Whether bells are apart, it fits the region, and nobody can doubt the order."""
    if not all(apart(p, ring[:i], distance) for i, p in enumerate(ring)):
        return False
    for k, (low, high) in enumerate((X, Y)):
        if max(p[k] for p in ring) - min(p[k] for p in ring) > high - low:
            return False
    if any(y > ring[0][1] - LEAD for _, y in ring[1:]):
        return False
    middle = [sum(p[k] for p in ring) / len(ring) for k in (0, 1)]
    angles = [math.atan2(x - middle[0], y - middle[1]) for x, y in ring]
    turns = [(a - angles[0]) % (2 * math.pi) for a in angles[1:]]
    steps = [b - a for a, b in zip([0.0, *turns], [*turns, 2 * math.pi], strict=True)]
    return len(ring) < 3 or min(steps) > TURN


def goal(scene: Scene) -> ClickInOrder:
    """The bells in their order."""
    return ClickInOrder([click_counter(scene, name) for name in Facts.of(scene).order])


def plan(scene: Scene) -> tuple[Skill, ...]:
    """One press each."""
    return tuple(click(scene, name) for name in Facts.of(scene).order)


def slots(scene: Scene) -> Slots:
    """Phrasings for the bells and their order, and the arm on the side of the first."""
    first = scene.object(Facts.of(scene).order[0])
    count = len(Facts.of(scene).order)
    if count == 1:
        phrases = objects.TEXT.slots("thing.bell")
    elif count == 2:
        pair = TEXT.phrasings("far"), TEXT.phrasings("near")
        phrases = TEXT.slots() | {"order": one_after_another(pair)}
    else:
        phrases = TEXT.slots("bells", "way", count=count, word=NUMBERS[count])
    return phrases | acting_arm(side(first.pose.position[0]))


def templates(level: int) -> Templates:
    """One bell, two bells by distance, a ring."""
    return (objects.TEXT if level < 3 else TEXT).templates(level)


TASK = Task(
    name="Click_Bell_Clockwise_Order",
    category="OCE",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=templates,
    slots=slots,
    summary="Click the bells clockwise, beginning with the one farthest from the robot.",
    success=(
        "All bells were clicked in clockwise order as seen from above, the farthest first, the "
        "gripper on their side being closed."
    ),
)
