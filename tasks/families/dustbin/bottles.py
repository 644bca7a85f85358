"""Put_Bottles_Dustbin: throw all bottles into the bin beside the table.

Draw: upright bottles scattered on the far half of a table that stands 0.3 m farther right; the bin
stands on the floor at its left. Success: every bottle lies inside the bin's walls at once. The
right arm cannot reach the bin, so it hands bottles over by setting them down in the middle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from robospa.tasks import objects
from robospa.tasks.families.dustbin.floor_bin import (
    BIN,
    EXCHANGE,
    TABLE_SHIFT,
    container,
    discard,
    reachable,
)
from robospa.tasks.families.tabletop import Item, middle_in_view, named, standing
from robospa.tasks.goals.placing import collect
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText, by_count
from robospa.tasks.plan import Skill
from robospa.tasks.sampling.places import Point, scatter_points
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task, Tracker
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "bottles.toml")

X, Y, DISTANCE, MIDDLE = (-0.25, 0.3), (0.03, 0.23), 0.13, 0.05
HALF_HEIGHT = 0.124
"""Of the tallest bottle [m]; what is above may be cut off at the far side."""
LEVELS = {n: Level(candidates=n, subtasks=n, steps=400 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The bin and the bottles."""

    dustbin: str
    bottles: tuple[str, ...]


def _usable(workcell: Workcell, point: Point) -> bool:
    """Off the middle strip, within reach of the arm on that side, a bottle's middle in view."""
    return (
        abs(point[0]) >= MIDDLE
        and reachable(workcell, point)
        and middle_in_view(workcell, point, HALF_HEIGHT)
    )


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Bottles anywhere in the region but the middle strip; different looks up to level 3."""
    points = scatter_points(rng, level, X, Y, DISTANCE, partial(_usable, workcell))
    count = objects.look_count("bottle")
    looks = rng.choice(count, size=level, replace=level > min(3, count))
    items = [Item("dustbin", "dustbin", BIN, {"look": 0}, fixed=True)]
    for i, (point, look) in enumerate(zip(points, looks, strict=True)):
        items.append(Item(f"bottle {i}", "bottle", standing(point), {"look": int(look)}))
    scene_objects, names = named(rng, items)
    facts = Facts(names["dustbin"], tuple(names[f"bottle {i}"] for i in range(level)))
    return SceneSample(scene_objects, facts, TABLE_SHIFT)


def goal(scene: Scene) -> Tracker:
    """All bottles inside the bin's walls."""
    dustbin = scene.object(Facts.of(scene).dustbin)
    names = Facts.of(scene).bottles
    return collect(names, container(dustbin), lost_below=scene.table_top - 0.1)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Left bottles first, then those on the right by way of the exchange place.

    On each side the one nearest to where it goes is first, so that no bottle is carried over one
    that still stands: the lift alone does not clear it.
    """

    def turn(name: str) -> tuple[bool, float]:
        point = scene.object(name).pose.position[:2]
        right = point[0] > 0
        return right, math.dist(point, EXCHANGE if right else BIN.position[:2])

    dustbin = Facts.of(scene).dustbin
    skills: list[Skill] = []
    for name in sorted(Facts.of(scene).bottles, key=turn):
        skills += discard(scene, name, dustbin)
    return tuple(skills)


def bottle_slots(count: int) -> Slots:
    """Phrasings for so many bottles and the bin."""
    bottles = f"bottles.{by_count(count)}"
    return TEXT.slots(bottles, "bin", "side", count=count, word=NUMBERS[count])


def slots(scene: Scene) -> Slots:
    """Phrasings for the bottles and the bin."""
    return bottle_slots(len(Facts.of(scene).bottles))


TASK = Task(
    name="Put_Bottles_Dustbin",
    category="OFE",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Throw all bottles into the dustbin.",
    success="Every bottle is inside the bin's walls, below its rim, and came to rest there.",
)
