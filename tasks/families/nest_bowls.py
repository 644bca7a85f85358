"""Place_Bowls_Plates: stack all bowls on the plate.

Draw: one fixed plate left or right of the middle, k equal bowls farther away. Success: all bowls
stand in each other on the plate, in any order, and both grippers are open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robospa.geometry import Array, Vec3
from robospa.tasks import objects
from robospa.tasks.families import table
from robospa.tasks.goals.placing import nest
from robospa.tasks.instructions import NUMBERS, Slots, TaskText, by_count
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.sampling.places import Area, Mask, candidates, scatter, shuffled
from robospa.tasks.scene import Scene
from robospa.tasks.task import SceneFacts, SceneSample, Task, Tracker
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "nest_bowls.toml")

PLATE_X, PLATE_SPREAD, PLATE_Y = 0.12, 0.03, (-0.15, -0.10)
AREA, MIDDLE = Area((-0.28, 0.28), (-0.05, 0.20), True), 0.08
TRIES, RESTARTS = 100, 80
DISTANCE = 0.13
"""Least distance [m] of bowls from each other and from the plate."""
BOWL = {"look": 2}
"""All bowls are of the one official model."""


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The plate and the bowls."""

    plate: str
    bowls: tuple[str, ...]


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    left = rng.random() < 0.5
    plate_x = (-PLATE_X if left else PLATE_X) + float(rng.uniform(-PLATE_SPREAD, PLATE_SPREAD))
    plate = (plate_x, float(rng.uniform(*PLATE_Y)))
    model = objects.object_model("bowl", BOWL)

    def free(x: Array, y: Array) -> Mask:
        off_plate: Mask = np.hypot(x - plate[0], y - plate[1]) >= DISTANCE
        return off_plate & workcell.in_reach(x, y)

    shape, height = (level, TRIES), model.size[2]
    propose = candidates(workcell, AREA, shape, model.radius, height, MIDDLE, free)
    points = shuffled(rng, scatter(rng, propose, DISTANCE, restarts=RESTARTS))
    items = [
        table.Item(
            "plate", "plate", table.standing(plate), table.draw_variant(rng, "plate"), fixed=True
        )
    ]
    items += [
        table.Item(str(i), "bowl", table.standing(point), BOWL) for i, point in enumerate(points)
    ]
    scene_objects, names = table.named(rng, items)
    return SceneSample(
        scene_objects, Facts(names["plate"], tuple(names[str(i)] for i in range(level)))
    )


def goal(scene: Scene) -> Tracker:
    return nest(Facts.of(scene).bowls, Facts.of(scene).plate)


def plan(scene: Scene) -> tuple[Skill, ...]:
    plate = Facts.of(scene).plate
    at = {name: scene.object(name).pose.position for name in Facts.of(scene).bowls}
    here = table.side_of(scene, plate)
    skills: list[Skill] = []
    below: str | None = None
    for name in sorted(at, key=lambda n: (table.side(at[n][0]) != here, at[n][1])):
        arm = table.side(at[name][0])
        skills.append(Pick(name, lift=0.10, arm=arm))
        if below is None:
            skills.append(Place(name, on=plate, arm=arm))
        else:
            skills.append(Place(name, _nested(scene, below), on=below, arm=arm))
        below = name
    return tuple(skills)


def _nested(scene: Scene, below: str) -> Vec3:
    frames = objects.model_of(scene.object(below)).frames
    return (0.0, 0.0, frames["nest"].position[2] - frames["support"].position[2])


def slots(scene: Scene) -> Slots:
    count = len(Facts.of(scene).bowls)
    bowls = "bowl" if count == 1 else f"bowls.{by_count(count)}"
    return TEXT.slots("plate", bowls, count=count, word=NUMBERS[count])


TASK = Task(
    name="Place_Bowls_Plates",
    category="OFE",
    levels=table.LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Stack all bowls on the plate.",
    success=(
        "All bowls stand in one stack on the plate, each within 4 cm of the one below it, and both "
        "grippers are open. Level 1: the bowl is within 5 cm of the plate's centre."
    ),
)
