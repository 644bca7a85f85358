"""Separate_Fries_Bread: of a mixed row, one kind of food goes forward and the other backward.

Draw: k breads and boxes of fries in a row, each at its slot, kinds shuffled. Success: everything of
the first kind lies beyond the far line, everything of the second before the near line, both
grippers open. Level 1 has one object and one direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.tasks.families.tabletop import Item, draw_look, named, side, standing
from robospa.tasks.goals.parts import Region
from robospa.tasks.goals.placing import Destination, bring
from robospa.tasks.instructions.grammar import Phrasings, Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task, Tracker
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "food.toml")

ASSETS = {"bread": "bread", "fries": "french_fries"}
SLOTS_X = {
    1: ((0.0,), 0.215),
    2: ((-0.13, 0.13), 0.08),
    3: ((-0.174, 0.0, 0.174), 0.037),
    4: ((-0.2, -0.06, 0.06, 0.2), 0.011),
    5: ((-0.21, -0.105, 0.0, 0.105, 0.21), 0.004),
}
"""Where each object of the row may lie, from the row's middle: centres and half widths [m]."""

MIDDLE = -0.03
"""The row's middle [m]: that of the head image."""

FIRST = {2: 1, 3: 2, 4: 2, 5: 2}
"""How many objects go forward."""

Y, BREAD_YAW = (-0.15, -0.10), math.pi / 4
FORWARD, BACKWARD = Region(y=(-0.08, math.inf)), Region(y=(-math.inf, -0.17))
PLACE_Y = {"forward": -0.04, "backward": -0.21}
"""Where the expert puts things; not part of the rule."""

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """What goes forward and what backward, and the kind of food that it is."""

    forward: tuple[str, ...]
    backward: tuple[str, ...]
    forward_kind: str
    backward_kind: str


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Which kind goes forward is a fair coin, and so is the direction at level 1."""
    kinds = ["bread", "fries"] if rng.random() < 0.5 else ["fries", "bread"]
    first = FIRST[level] if level > 1 else int(rng.integers(2))
    ways = ["forward"] * first + ["backward"] * (level - first)
    y = float(rng.uniform(*Y))
    items = []
    centres, spread = SLOTS_X[level]
    for centre, index in zip(centres, rng.permutation(level), strict=True):
        kind = kinds[0] if ways[int(index)] == "forward" else kinds[1]
        look = draw_look(rng, ASSETS[kind])
        yaw = float(rng.uniform(-BREAD_YAW, BREAD_YAW)) if kind == "bread" else 0.0
        x = MIDDLE + centre + float(rng.uniform(-spread, spread))
        pose = standing((x, y), yaw)
        items.append(Item(str(int(index)), ASSETS[kind], pose, look))
    scene_objects, names = named(rng, items)
    foods = tuple(names[str(i)] for i in range(level))
    facts = Facts(foods[:first], foods[first:], kinds[0], kinds[1])
    return SceneSample(scene_objects, facts)


def goal(scene: Scene) -> Tracker:
    """Every object beyond its line, and both grippers open."""
    parts = [Destination(name, (FORWARD,), (BACKWARD,)) for name in Facts.of(scene).forward]
    parts += [Destination(name, (BACKWARD,), (FORWARD,)) for name in Facts.of(scene).backward]
    return bring(parts, scene.table_top, released=True)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Everything straight forward or backward, from left to right: the arms change once."""
    facts = Facts.of(scene)
    moves = [
        (scene.object(name).pose.position[0], name, PLACE_Y[way])
        for way, names in (("forward", facts.forward), ("backward", facts.backward))
        for name in names
    ]
    skills: list[Skill] = []
    for x, name, y in sorted(moves):
        arm = side(x)
        skills.append(Pick(name, lift=0.08, arm=arm))
        skills.append(Place(name, (x, y, scene.table_top), arm=arm))
    return tuple(skills)


def slots(scene: Scene) -> Slots:
    """Phrasings for the kinds and the directions."""
    facts = Facts.of(scene)
    if scene.level == 1:
        way = "forward" if facts.forward else "backward"
        kind = facts.forward_kind if facts.forward else facts.backward_kind
        return TEXT.slots(f"way.{way}") | {"food": _food(kind, 1)}
    return TEXT.slots() | {
        "first": _food(facts.forward_kind, len(facts.forward)),
        "second": _food(facts.backward_kind, len(facts.backward)),
        "ahead": TEXT.phrasings("way.forward"),
        "back": TEXT.phrasings("way.backward"),
    }


def _food(kind: str, count: int) -> Phrasings:
    entry = f"{kind}.one" if count == 1 else f"{kind}.many"
    return TEXT.phrasings(entry, count=count, word=NUMBERS[count])


TASK = Task(
    name="Separate_Fries_Bread",
    category="OFE",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Move one kind of food forward and the other backward.",
    success=(
        "What goes forward lies at y >= -0.08 m, what goes backward at y <= -0.17 m, all at once, "
        "and both grippers are open."
    ),
)
