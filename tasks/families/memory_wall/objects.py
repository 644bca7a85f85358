"""Observe_Objects_Click_Memory: see objects on a stand, then click their twins in that order.

Draw: k objects of different kinds in a row on a stand at the back, and one like each of them on the
table, all fixed. After 2.0 s a wall hides the stand. Success: the objects on the table were clicked
in the order in which they stood on the stand from left to right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Pose, yaw_rotation
from robospa.tasks.families.click_order.clicking import (
    TURNS,
    click,
    click_counter,
    clickable_look,
    laid_out,
)
from robospa.tasks.families.memory_wall.wall import HOLD_STILL, STAND_TOP, WALL, row, stand, wall
from robospa.tasks.families.tabletop import Item, named, standing
from robospa.tasks.goals.clicks import ClickInOrder
from robospa.tasks.goals.cue import AfterCue
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText, by_count
from robospa.tasks.plan import Skill
from robospa.tasks.sampling.places import Area
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "objects.toml")

KINDS = ("bread", "stapler", "can", "playing_cards", "bell")
STAND_Y, STAND_HALF, SHOWN_X = 0.15, (0.24, 0.05, 0.01), 0.18
SHOWN_TURN = math.pi / 4
WALL_Y, WALL_HALF_X = 0.05, 0.32
AREA, MIDDLE, DISTANCE = Area((-0.27, 0.27), (-0.21, -0.05)), 0.05, 0.10

LEVELS = {n: Level(candidates=n, subtasks=n, steps=50 + 200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """Objects and kinds in the order shown, and the wall."""

    order: tuple[str, ...]
    kinds: tuple[str, ...]
    wall: str


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Different kinds, in random order on the stand, at random places on the table."""
    kinds = [KINDS[int(i)] for i in rng.permutation(len(KINDS))[:level]]
    looks = [(kind, clickable_look(rng, kind)) for kind in kinds]
    turns = dict.fromkeys(TURNS, math.pi)
    places = laid_out(rng, workcell, AREA, MIDDLE, DISTANCE, looks, turns)
    items = [wall(WALL_Y, WALL_HALF_X), stand(STAND_Y, STAND_HALF)]
    for (kind, look), x, place in zip(looks, row(level, SHOWN_X), places, strict=True):
        turn = float(rng.uniform(-SHOWN_TURN, SHOWN_TURN)) if kind == "bread" else 0.0
        pose = Pose((x, STAND_Y, STAND_TOP), yaw_rotation(turn))
        items.append(Item(f"{kind} shown", kind, pose, look, fixed=True))
        items.append(Item(kind, kind, standing(*place), look, fixed=True))
    scene_objects, names = named(rng, items)
    facts = Facts(tuple(names[kind] for kind in kinds), tuple(kinds), names[WALL])
    return SceneSample(scene_objects, facts)


def goal(scene: Scene) -> AfterCue:
    """The objects on the table in the order of the stand, after the wall has come.

    One that is touched when its turn comes is clicked (official).
    """
    counters = [click_counter(scene, name) for name in Facts.of(scene).order]
    return AfterCue(ClickInOrder(counters, standing=True), [Facts.of(scene).wall])


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Hold still, then one press each."""
    return (HOLD_STILL, *(click(scene, name) for name in Facts.of(scene).order))


def slots(scene: Scene) -> Slots:
    """What is shown and which way round to go; no object is named."""
    count = len(Facts.of(scene).order)
    return TEXT.slots("wall", f"objects.{by_count(count)}", word=NUMBERS[count])


TASK = Task(
    name="Observe_Objects_Click_Memory",
    category="MIP",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Remember the row of objects shown and click the same ones in that order.",
    success=(
        "After the wall has come, the objects on the table were clicked in the order in which they "
        "were shown from left to right, the gripper on their side being closed; moving before "
        "fails for good."
    ),
)
