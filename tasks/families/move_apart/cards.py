"""Move_Playing_Cards_Away: clear the middle of the table of boxes of playing cards.

Draw: k boxes scattered in the middle of the table, turned any way. Success: every box lies at least
23 cm from the middle, on either side, at the same time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.tasks import objects
from robospa.tasks.families.tabletop import Item, draw_look, named, side, standing
from robospa.tasks.goals.parts import Region
from robospa.tasks.goals.placing import Destination, bring
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText, by_count
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.sampling.places import scatter_points, shuffled
from robospa.tasks.sampling.turns import Turnable, free_turns
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task, Tracker
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "cards.toml")

X, Y, DISTANCE = (-0.20, 0.20), (-0.20, 0.10), 0.15
AWAY = 0.23
"""A box is away at least this far [m] from the middle."""

SIDES = {"left": Region(x=(-math.inf, -AWAY)), "right": Region(x=(AWAY, math.inf))}

PLACE_X, PLACE_Y, SPACING = 0.28, (-0.24, 0.10), 0.08
"""Where the expert puts the boxes of one side, and how far apart [m]; not part of the rule."""

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The boxes, in no order."""

    boxes: tuple[str, ...]


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Boxes anywhere in the region, each turned any way that a gripper can take."""
    items = []
    points = shuffled(rng, scatter_points(rng, level, X, Y, DISTANCE, tries=10))
    looks = [draw_look(rng, "playing_cards") for _ in points]
    lying = [Turnable("playing_cards", *thing) for thing in zip(looks, points, strict=True)]
    for i, (box, yaw) in enumerate(zip(lying, free_turns(rng, workcell, lying), strict=True)):
        items.append(Item(str(i), box.asset, standing(box.place, yaw), box.params))
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(tuple(names[item.role] for item in items)))


def _sides(scene: Scene) -> dict[str, list[str]]:
    """The boxes that start on each side."""
    found: dict[str, list[str]] = {"left": [], "right": []}
    for name in Facts.of(scene).boxes:
        found[side(scene.object(name).pose.position[0])].append(name)
    return found


def goal(scene: Scene) -> Tracker:
    """Every box far out on either side; the farther side is a diagnostic."""
    start = {name: where for where, names in _sides(scene).items() for name in names}
    both = tuple(SIDES.values())
    parts = [
        Destination(name, both, (SIDES["left" if start[name] == "right" else "right"],))
        for name in Facts.of(scene).boxes
    ]
    return bring(parts, scene.table_top)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Each box straight out to its own side, the outer ones first, with room between them."""
    skills: list[Skill] = []
    for arm, names in _sides(scene).items():
        at = {name: scene.object(name).pose.position for name in names}
        rows = _rows(sorted(at[name][1] for name in names))
        places = dict(zip(sorted(names, key=lambda n: at[n][1]), rows, strict=True))
        for name in sorted(names, key=lambda n: -abs(at[n][0])):
            x = PLACE_X if arm == "right" else -PLACE_X
            skills.append(Pick(name, lift=0.08, arm=arm))
            skills.append(Place(name, (x, places[name], scene.table_top), arm=arm))
    return tuple(skills)


def _rows(wanted: list[float]) -> list[float]:
    """The sorted values moved as little as it takes to keep SPACING, inside PLACE_Y."""
    low, high = PLACE_Y
    rows: list[float] = []
    for y in wanted:
        rows.append(max(y, rows[-1] + SPACING) if rows else max(y, low))
    for i in reversed(range(len(rows))):
        rows[i] = min(rows[i], high if i == len(rows) - 1 else rows[i + 1] - SPACING)
    return rows


def slots(scene: Scene) -> Slots:
    """Phrasings for the boxes."""
    boxes = Facts.of(scene).boxes
    count = len(boxes)
    if count > 1:
        entry = f"boxes.{by_count(count)}"
        return TEXT.slots(entry, "out.many", "at.many", count=count, word=NUMBERS[count])
    box = scene.object(boxes[0])
    color = objects.object_model(box.asset, box.params).phrases[0].split()[0]
    return TEXT.slots("box", "out.one", "at.one", color=color)


TASK = Task(
    name="Move_Playing_Cards_Away",
    category="OFE",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Move all boxes of playing cards out to the sides of the table.",
    success=(
        "Every box lies on the table, at least 23 cm left or right of the middle, and was let go "
        "of there."
    ),
)
