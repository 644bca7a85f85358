"""Remember_Color_Cover: look at a row of coloured blocks, then open their covers by colour.

Draw: k blocks of different colours in a row; after 2.0 s equal covers appear over them. Success:
the covers have been opened in the asked order of colours, each put 13 cm behind its block.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robospa.tasks.families.colors import first_colors
from robospa.tasks.families.tabletop import Item, named, side, standing
from robospa.tasks.goals.memory import Cover, UncoverInOrder
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText, color_orders
from robospa.tasks.plan import Home, Pick, Place, Skill, Wait
from robospa.tasks.sampling.places import shuffled
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "instructions.toml")

COLORS = first_colors(10)
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
        block = {"half": [HALF, HALF, HALF], "color": list(COLORS[color])}
        pose = standing((x, Y), height=HALF)
        items.append(Item(f"{color} block", "block", pose, block, fixed=True))
        cover = Item(f"{color} cover", "cover", standing((x, Y)), appears_at=COVERED_AT)
        items.append(cover)
    order = tuple(shuffled(rng, chosen))
    scene_objects, names = named(rng, items)
    facts = Facts(
        colors=order,
        covers=tuple(names[f"{color} cover"] for color in order),
        blocks=tuple(names[f"{color} block"] for color in order),
    )
    return SceneSample(scene_objects, facts)


def _open_place(scene: Scene, block: str) -> tuple[float, float]:
    x, y, _ = scene.object(block).pose.position
    return (x, y + BEHIND)


def goal(scene: Scene) -> UncoverInOrder:
    """The covers in the asked order."""
    pairs = zip(Facts.of(scene).covers, Facts.of(scene).blocks, strict=True)
    covers = [Cover(cover, _open_place(scene, block)) for cover, block in pairs]
    return UncoverInOrder(covers, scene.table_top + OPEN_BELOW)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Hold still until the covers are there, then open them one by one."""
    skills: list[Skill] = [Wait(COVERED_AT + 0.6)]
    for cover, block in zip(Facts.of(scene).covers, Facts.of(scene).blocks, strict=True):
        x, y = _open_place(scene, block)
        arm = side(x)
        skills.append(Pick(cover, lift=0.08, arm=arm))
        skills.append(Place(cover, (x, y, scene.table_top), arm=arm))
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
