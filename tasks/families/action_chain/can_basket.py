"""Click_Can_Place_Items: clicks on a can, with things to put away in between.

Draw: a fixed can on the left, a fixed bread basket with bread on the right (from level 2), a pill
bottle and a blue pad on the left (from level 4). Success: all clicks done, the bread in the basket,
the pill bottle on the pad, both grippers open where the last step puts something down. The order is
asked for, but not enforced.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.tasks import objects
from robospa.tasks.colors import NAMED
from robospa.tasks.families.tabletop import Item, draw_look, named, radius, standing
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.parts import Part, Rests, level_with
from robospa.tasks.goals.repeat import ActionCounter, PressCounter
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText
from robospa.tasks.plan import Home, Pick, Place, Press, Skill
from robospa.tasks.sampling.places import Point, free_point, retry
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "can_basket.toml")

STEPS = {1: "c", 2: "cb", 3: "cbc", 4: "cbcp", 5: "cbcpc"}
"""What is asked for: c a click, b the bread into the basket, p the pill bottle onto the pad."""

LET_GO = (2, 4)
"""Levels that ask for both grippers open (official): those that end with something put down."""

CAN_BOX = (0.03, 0.03, 0.04)
"""Half sizes [m] of the box around the can's press point in which a touch counts."""

CAN_X, CAN_FIRST_Y, CAN_Y = (-0.25, -0.05), (-0.2, -0.15), (-0.2, 0.1)
BASKET = (0.10, -0.2)
BREAD_X, BREAD_Y, BREAD_YAW = (0.15, 0.27), (-0.10, 0.05), math.pi / 4
BOTTLE_X, PAD_X, LEFT_Y = (-0.25, -0.10), (-0.25, -0.05), (-0.1, 0.1)
PAD_HALF = (0.04, 0.04, 0.0005)
BOTTLE_GRIP = (0.0, 0.0, 0.125)
"""Where the pill bottle is held [m, its frame]."""
HELD_WITHIN = 0.18
"""How far [m] the grasp centre is from the origin of a held thing at most."""
GAP = 0.005
"""Free space [m] between the footprints of things that must not touch."""

LEVELS = {
    n: Level(candidates=1 + len(set(steps) - {"c"}), subtasks=n, steps=200 * n)
    for n, steps in STEPS.items()
}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """Things by their role; those of later levels may be missing."""

    can: str
    basket: str = ""
    bread: str = ""
    pill_bottle: str = ""
    pad: str = ""


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """The things of this level, each in its region, no two touching."""
    return retry(
        lambda: _draw(level, rng, workcell), f"objects of Click_Can_Place_Items level {level}"
    )


def _draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample | None:
    can = draw_look(rng, "can")
    items: list[Item] = []
    far: list[tuple[Point, float]] = []  # what the can must keep away from, and how far [m]
    if level >= 2:
        basket, bread = draw_look(rng, "bread_basket"), draw_look(rng, "bread")
        between = max(0.1, radius("bread_basket", basket) + radius("bread", bread) + GAP)
        at = free_point(rng, BREAD_X, BREAD_Y, [(BASKET, between)])
        if at is None:
            return None
        turn = float(rng.uniform(-math.pi, math.pi))
        items.append(Item("basket", "bread_basket", standing(BASKET, turn), basket, fixed=True))
        turn = float(rng.uniform(-BREAD_YAW, BREAD_YAW))
        items.append(Item("bread", "bread", standing(at, turn), bread))
        far += [(BASKET, 0.18), (at, 0.18)]
    if level >= 4:
        look = draw_look(rng, "pill_bottle")
        bottle = free_point(rng, BOTTLE_X, LEFT_Y, [])
        pad = free_point(rng, PAD_X, LEFT_Y, [(bottle, 0.1)] if bottle else [])
        if bottle is None or pad is None:
            return None
        square = {"half": list(PAD_HALF), "color": list(NAMED["blue"])}
        items.append(Item("pill_bottle", "pill_bottle", standing(bottle), look))
        items.append(Item("pad", "block", standing(pad, 0.0, PAD_HALF[2]), square, fixed=True))
        far += [(bottle, 0.1), (pad, 0.1)]
    first_y = CAN_FIRST_Y if level >= 2 else CAN_Y
    place = free_point(rng, CAN_X, first_y, far, tries=1) or free_point(rng, CAN_X, CAN_Y, far)
    if place is None:
        return None
    items.append(Item("can", "can", standing(place), can, fixed=True))
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(**names))


def goal(scene: Scene) -> Checklist:
    """Clicks and placements in the asked order."""
    facts = Facts.of(scene)
    can = scene.object(facts.can)
    model = objects.object_model(can.asset, can.params)
    counter = PressCounter(can.name, model.frames["touched"], CAN_BOX)
    subtasks: list[ActionCounter | Part] = []
    for step in STEPS[scene.level]:
        if step == "b":
            basket = scene.object(facts.basket)
            rim = scene.table_top + objects.object_model(basket.asset, basket.params).size[2]
            height = (scene.table_top - 0.01, rim + 0.01)
            subtasks.append(Rests(facts.bread, (facts.basket,), level_with(0.05, *height)))
        elif step == "p":
            height = (scene.table_top - 0.004, scene.table_top + 0.006)
            on_pad = level_with(0.03, *height)
            subtasks.append(Rests(facts.pill_bottle, (facts.pad,), on_pad, grip=BOTTLE_GRIP))
        else:
            subtasks.append(counter)
    return Checklist(subtasks, released=scene.level in LET_GO, radius=HELD_WITHIN)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """The asked steps in the asked order; home at the end, which opens the grippers."""
    facts = Facts.of(scene)
    skills: list[Skill] = []
    for step in STEPS[scene.level]:
        if step == "c":
            skills.append(Press(facts.can, arm="left"))
        elif step == "b":
            skills.append(Pick(facts.bread, arm="right"))
            skills.append(Place(facts.bread, on=facts.basket, drop=0.02, arm="right"))
        else:
            skills.append(Pick(facts.pill_bottle, lift=0.08, arm="left"))
            skills.append(Place(facts.pill_bottle, on=facts.pad, arm="left"))
    return (*skills, Home())


def slots(scene: Scene) -> Slots:
    """Phrasings for the things."""
    things = ("can", "bread", "basket", "bottle", "pad")
    return TEXT.slots(*things[: {1: 1, 2: 3, 3: 3}.get(scene.level, 5)])


TASK = Task(
    name="Click_Can_Place_Items",
    category="CAC",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Click the can, put the bread into the basket and the pill bottle onto the blue pad.",
    success=(
        "The can was clicked as often as asked, the bread lies in the basket, the pill bottle "
        "stands on the pad (as far as the level asks), and at levels 2 and 4 both grippers are "
        "open."
    ),
)
