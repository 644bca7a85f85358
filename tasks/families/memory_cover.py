"""Remember_Color_Cover: look at a row of coloured blocks, then open their covers by colour.

Draw: k blocks of different colours in a row; after 2.0 s equal covers appear over them. Success:
the covers have been opened in the asked order of colours, each put 13 cm behind its block.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robospa.tasks.families import table
from robospa.tasks.goals.memory import AfterCue, Cover, uncover
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText, color_orders
from robospa.tasks.plan import Home, Skill, Wait
from robospa.tasks.sampling.places import Point, shuffled
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "memory_cover.toml")

COLORS = table.first_colors(10)
ROWS = {
    1: (0.0,),
    2: (-0.20, 0.20),
    3: (-0.20, 0.0, 0.20),
    4: (-0.20, -0.0667, 0.0667, 0.20),
    5: (-0.27, -0.145, -0.02, 0.105, 0.23),
}
"""x of the blocks [m]."""
Y, HALF = -0.18, 0.02
COVERED_AT = 2.0
"""When the covers appear [s]."""
BEHIND = 0.13
"""An opened cover's place lies this far [m] behind its block, away from the robot."""
OPEN_BELOW = 0.005
"""An opened cover's origin is lower than this [m]."""
LEVELS = {n: Level(candidates=n, subtasks=n, steps=50 + 200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """Colours, covers and blocks in the order in which covers are opened."""

    colors: tuple[str, ...]
    covers: tuple[str, ...]
    blocks: tuple[str, ...]


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Different colours in a fixed row, opened in a uniformly random order."""
    chosen = [list(COLORS)[int(i)] for i in rng.permutation(len(COLORS))[:level]]
    items = []
    for color, x in zip(chosen, ROWS[level], strict=True):
        pose = table.standing((x, Y), height=HALF)
        items.append(
            table.Item(f"{color} block", "block", pose, table.cube(HALF, COLORS[color]), fixed=True)
        )
        items.append(
            table.Item(f"{color} cover", "cover", table.standing((x, Y)), appears_at=COVERED_AT)
        )
    order = tuple(shuffled(rng, chosen))
    scene_objects, names = table.named(rng, items)
    facts = Facts(
        colors=order,
        covers=tuple(names[f"{color} cover"] for color in order),
        blocks=tuple(names[f"{color} block"] for color in order),
    )
    return SceneSample(scene_objects, facts)


def _open_places(scene: Scene) -> dict[str, Point]:
    """Where each cover goes, in the asked order."""
    facts, places = Facts.of(scene), {}
    for cover, block in zip(facts.covers, facts.blocks, strict=True):
        x, y, _ = scene.object(block).pose.position
        places[cover] = (x, y + BEHIND)
    return places


def goal(scene: Scene) -> AfterCue:
    """The covers in the asked order."""
    below = scene.table_top + OPEN_BELOW
    return uncover([Cover(name, place, below) for name, place in _open_places(scene).items()])


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Hold still until the covers are there, then open them one by one."""
    skills: list[Skill] = [Wait(COVERED_AT + 0.6)]
    for name, (x, y) in _open_places(scene).items():
        skills += table.moved(name, (x, y, scene.table_top), table.side(x))
    return (*skills, Home())


def slots(scene: Scene) -> Slots:
    """Phrasings for the order of the colours, and where a cover goes."""
    colors = Facts.of(scene).colors
    if len(colors) == 1:
        return TEXT.slots("where", "block", color=colors[0])
    return TEXT.slots("where") | {"order": color_orders(colors)}


TASK = Task(
    name="Remember_Color_Cover",
    category="MIP",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Remember the colours under the covers and open them in the asked order.",
    success=(
        "After the covers have appeared, each was put 13 cm behind its block in the asked order; "
        "moving before, opening one too early or moving an opened one fails for good."
    ),
)
