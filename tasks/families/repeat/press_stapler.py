"""Press_Stapler_Repeat: press a stapler a given number of times.

Draw: one fixed stapler, any yaw, in the middle of the table; the level is the count.
Success: that many presses, each a gripper touching the stapler within 3 cm of its press point,
counted when the touch begins and re-armed by 0.1 s without one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.tasks import objects
from robospa.tasks.families.tabletop import Item, draw_look, named, side, standing
from robospa.tasks.goals.repeat import PressCounter, Repeat
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText, by_count
from robospa.tasks.plan import Press, Skill
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "press_stapler.toml")

X, Y = (-0.2, 0.2), (-0.1, 0.05)

LEVELS = {n: Level(candidates=1, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The stapler, and how often it is pressed."""

    stapler: str
    count: int


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """One stapler anywhere in the region, turned any way."""
    point = (float(rng.uniform(*X)), float(rng.uniform(*Y)))
    pose = standing(point, float(rng.uniform(-math.pi, math.pi)))
    items = [Item("stapler", "stapler", pose, draw_look(rng, "stapler"), fixed=True)]
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(names["stapler"], level))


def goal(scene: Scene) -> Repeat:
    """The press counter of the scene's stapler."""
    stapler = scene.object(Facts.of(scene).stapler)
    model = objects.object_model(stapler.asset, stapler.params)
    return Repeat(PressCounter(stapler.name, model.frames["touched"]), Facts.of(scene).count)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """As many presses as asked for, by the arm on the press point's side."""
    stapler = scene.object(Facts.of(scene).stapler)
    press = objects.object_model(stapler.asset, stapler.params).frames["press"]
    arm = side(stapler.pose.apply(press.position)[0])
    return (Press(stapler.name, arm=arm),) * Facts.of(scene).count


def slots(scene: Scene) -> Slots:
    """Phrasings for the stapler and the count."""
    count = Facts.of(scene).count
    if count == 1:
        return TEXT.slots("stapler")
    times = f"times.{by_count(count)}"
    return TEXT.slots("stapler", times, "presses", count=count, word=NUMBERS[count])


TASK = Task(
    name="Press_Stapler_Repeat",
    category="RPF",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Press the stapler the given number of times.",
    success=(
        "The stapler was touched by a gripper near its press point as often as asked, "
        "with at least 0.1 s without a touch between presses."
    ),
)
