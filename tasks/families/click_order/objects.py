"""Click_Objects_Order: click the things on the table in a given order.

Draw: an alarm clock, a stapler, a can, playing cards and bread (the first k), fixed, anywhere in
front of the robot. Success: all were clicked in that order with a closed gripper.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robospa.tasks.families.click_order.clicking import (
    click,
    click_counter,
    clickable_look,
    laid_out,
)
from robospa.tasks.families.tabletop import Item, named, side, standing
from robospa.tasks.goals.clicks import ClickInOrder
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText, acting_arm, one_after_another
from robospa.tasks.plan import Skill
from robospa.tasks.sampling.places import Area
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "objects.toml")

ORDER = ("alarm_clock", "stapler", "can", "playing_cards", "bread")
AREA, MIDDLE, DISTANCE = Area((-0.25, 0.25), (-0.20, 0.0)), 0.05, 0.14

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The things in the order of the clicks."""

    order: tuple[str, ...]


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """The first things of the order, at random places off the middle."""
    looks = [(asset, clickable_look(rng, asset)) for asset in ORDER[:level]]
    places = laid_out(rng, workcell, AREA, MIDDLE, DISTANCE, looks)
    items = [
        Item(asset, asset, standing(*place), look, fixed=True)
        for (asset, look), place in zip(looks, places, strict=True)
    ]
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(tuple(names[asset] for asset in ORDER[:level])))


def goal(scene: Scene) -> ClickInOrder:
    """The things in their order; one that is touched when its turn comes is clicked (official)."""
    counters = [click_counter(scene, name) for name in Facts.of(scene).order]
    return ClickInOrder(counters, standing=True)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """One press each."""
    return tuple(click(scene, name) for name in Facts.of(scene).order)


def slots(scene: Scene) -> Slots:
    """Phrasings for the things, and the arm on the side of the first."""
    order = [scene.object(name) for name in Facts.of(scene).order]
    arm = acting_arm(side(order[0].pose.position[0]))
    if len(order) == 1:
        return TEXT.slots(f"thing.{order[0].asset}") | arm
    nouns = [TEXT.phrasings(f"thing.{item.asset}") for item in order]
    return TEXT.slots() | {"order": one_after_another(nouns)} | arm


TASK = Task(
    name="Click_Objects_Order",
    category="OCE",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Click the objects in the given order.",
    success=(
        "The alarm clock, the stapler, the can, the playing cards and the bread (as many as there "
        "are) were clicked in this order, the gripper on their side being closed."
    ),
)
