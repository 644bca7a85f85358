"""Lift_Pot_Repeat and Lift_Fan_Repeat: lift a thing and put it back, a given number of times.

Draw: a pot with two handles, or a light fan, in front of the robot; the level is the count.
Success: that many cycles of up and back to where it was. The pot has to hang on both handles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robospa.tasks import objects
from robospa.tasks.families.tabletop import Item, named, side, standing
from robospa.tasks.goals.lift_cycles import LiftCycles, back_home, held_up, put_down, raised
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText, by_count
from robospa.tasks.plan import RaiseLower, Skill
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "lift.toml")

LEVELS = {n: Level(candidates=1, subtasks=n, steps=200 * n) for n in range(1, 6)}

UP = 0.82
"""A lifted pot's origin is higher than this [m, world]."""

DOWN, ASIDE = (-0.03, 0.07), 0.08
"""A pot is down between these heights over its first one, and this near to its place [m]."""

FAN_UP, FAN_WAY, FAN_TURN = 0.05, 0.04, 0.05
"""Rise [m] of a lifted fan; errors in each coordinate [m] and quaternion component at home."""


@dataclass(frozen=True)
class Facts(SceneFacts):
    """What is lifted, and how often."""

    thing: str
    count: int


def _pot_goal(scene: Scene) -> LiftCycles:
    pot = scene.object(Facts.of(scene).thing)
    model = objects.object_model(pot.asset, pot.params)
    handles = [model.frames[arm].position for arm in ("left", "right")]
    up, down = held_up(pot.name, UP + scene.table_rise, handles), put_down(pot.name, DOWN, ASIDE)
    return LiftCycles(pot.name, Facts.of(scene).count, up, down, radius=0.2)


def _fan_goal(scene: Scene) -> LiftCycles:
    name = Facts.of(scene).thing
    up, down = raised(name, FAN_UP), back_home(name, FAN_WAY, FAN_TURN)
    return LiftCycles(name, Facts.of(scene).count, up, down, radius=0.2)


@dataclass(frozen=True)
class Thing:
    """What is lifted: where it may stand, how it is judged, how high the expert lifts it."""

    name: str
    asset: str
    x: tuple[float, float]
    y: tuple[float, float]
    yaw: float
    rise: float
    goal: Callable[[Scene], LiftCycles]
    both: bool
    looks: Sequence[int]
    success: str


THINGS = (
    Thing(
        "pot",
        "kitchen_pot",
        (-0.05, 0.05),
        (-0.05, 0.05),
        math.pi / 8,
        0.11,
        _pot_goal,
        True,
        range(objects.look_count("kitchen_pot")),
        "As often as asked, the pot was lifted above 0.82 m upright with a gripper at either "
        "handle, and then stood within 8 cm of its place again.",
    ),
    Thing(
        "fan",
        "fan",
        (-0.1, 0.1),
        (-0.15, -0.05),
        0.0,
        0.08,
        _fan_goal,
        False,
        (0, 1),  # official models
        "As often as asked, the fan was lifted by 5 cm and then was back within 4 cm and about "
        "6 degrees of its place.",
    ),
)


def _draw(thing: Thing, level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    point = (float(rng.uniform(*thing.x)), float(rng.uniform(*thing.y)))
    pose = standing(point, float(rng.uniform(-thing.yaw, thing.yaw)))
    look = int(thing.looks[int(rng.integers(len(thing.looks)))])
    items = [Item("thing", thing.asset, pose, {"look": look})]
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(names["thing"], level))


def _plan(thing: Thing, scene: Scene) -> tuple[Skill, ...]:
    """All cycles in one go: both arms for the pot, the arm on its side for the fan."""
    name, count = Facts.of(scene).thing, Facts.of(scene).count
    near = side(scene.object(name).pose.position[0])
    return (RaiseLower(name, thing.rise, count, ("left", "right") if thing.both else (near,)),)


def _slots(thing: Thing, scene: Scene) -> Slots:
    count = Facts.of(scene).count
    own = f"thing.{thing.name}", f"hands.{thing.name}"
    if count == 1:
        return TEXT.slots(*own)
    times = f"times.{by_count(count)}"
    return TEXT.slots(*own, times, "lifts", count=count, word=NUMBERS[count])


def _task(thing: Thing) -> Task:
    return Task(
        name=f"Lift_{thing.name.capitalize()}_Repeat",
        category="RPF",
        levels=LEVELS,
        draw=lambda level, rng, workcell: _draw(thing, level, rng, workcell),
        goal=thing.goal,
        plan=lambda scene: _plan(thing, scene),
        templates=TEXT.templates,
        slots=lambda scene: _slots(thing, scene),
        summary=f"Lift the {thing.name} and put it back, the given number of times.",
        success=thing.success,
    )


TASKS = tuple(_task(thing) for thing in THINGS)
