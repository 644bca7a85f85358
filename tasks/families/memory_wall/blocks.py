"""Observe_Blocks_Move_Memory: see which colours are shown, then bring those blocks nearer.

Draw: k blocks of different colours on a stand at the back; 2 k blocks on the table, among them one
of each colour shown. After 2.0 s a wall hides the stand. Success: the blocks of the shown colours
lie in the strip nearest to the robot, no other block has ever been there, both grippers open.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Pose
from robospa.tasks.families.colors import COLORS
from robospa.tasks.families.memory_wall.wall import HOLD_STILL, STAND_TOP, WALL, row, stand, wall
from robospa.tasks.families.tabletop import Item, named, side, standing
from robospa.tasks.goals.cue import AfterCue
from robospa.tasks.goals.parts import Region
from robospa.tasks.goals.placing import gather
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText, by_count
from robospa.tasks.plan import Home, Pick, Place, Skill
from robospa.tasks.sampling.places import Area, candidates, scatter, shuffled
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "blocks.toml")

HALF = 0.015
STAND_Y, STAND_HALF, SHOWN_X = 0.20, (0.26, 0.055, 0.01), 0.18
WALL_Y = 0.12
AREA, MIDDLE, DISTANCE, TRIES = Area((-0.25, 0.25), (-0.10, 0.08)), 0.04, 0.06, 100
NEAR = Region((-0.26, 0.26), (-1.0, -0.11))
"""Where the shown blocks have to go, and no others may be."""

GOAL_Y, GOAL_X = -0.18, 0.16
"""Where the expert puts them."""

LEVELS = {n: Level(candidates=2 * n, subtasks=n, steps=50 + 200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The colours shown, the blocks of these colours, all other blocks, and the wall."""

    colors: tuple[str, ...]
    targets: tuple[str, ...]
    others: tuple[str, ...]
    wall: str


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Colours on the stand; the same and as many others on the table, all places alike."""
    colors = [list(COLORS)[int(i)] for i in rng.permutation(len(COLORS))[: 2 * level]]
    shape, radius = (2 * level, TRIES), HALF * math.sqrt(2)
    propose = candidates(workcell, AREA, shape, radius, 2 * HALF, MIDDLE)
    points = shuffled(rng, scatter(rng, propose, DISTANCE))
    items = [wall(WALL_Y), stand(STAND_Y, STAND_HALF)]
    for color, x in zip(colors[:level], row(level, SHOWN_X), strict=True):
        pose = Pose((x, STAND_Y, STAND_TOP + HALF))
        items.append(Item(f"{color} shown", "block", pose, _look(color), fixed=True))
    for color, point in zip(colors, points, strict=True):
        items.append(Item(color, "block", standing(point, height=HALF), _look(color)))
    scene_objects, names = named(rng, items)
    facts = Facts(
        colors=tuple(colors[:level]),
        targets=tuple(names[color] for color in colors[:level]),
        others=tuple(names[color] for color in colors[level:]),
        wall=names[WALL],
    )
    return SceneSample(scene_objects, facts)


def _look(color: str) -> dict[str, list[float]]:
    return {"half": [HALF, HALF, HALF], "color": list(COLORS[color])}


def goal(scene: Scene) -> AfterCue:
    """The shown colours' blocks in the strip near the robot, after the wall has come."""
    blocks = gather(Facts.of(scene).targets, Facts.of(scene).others, NEAR)
    return AfterCue(blocks, [Facts.of(scene).wall])


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Hold still, then bring the blocks of each side to the nearest free place of the strip."""
    targets = sorted(Facts.of(scene).targets, key=lambda n: scene.object(n).pose.position[0])
    skills: list[Skill] = [HOLD_STILL]
    for name, x in zip(targets, row(len(targets), GOAL_X), strict=True):
        arm = side(scene.object(name).pose.position[0])
        skills.append(Pick(name, lift=0.08, arm=arm))
        skills.append(Place(name, (x, GOAL_Y, scene.table_top + HALF), arm=arm))
    return (*skills, Home())


def slots(scene: Scene) -> Slots:
    """What is shown, and where the blocks have to go; no colour is named."""
    count = len(Facts.of(scene).targets)
    return TEXT.slots("wall", f"blocks.{by_count(count)}", "strip", word=NUMBERS[count])


TASK = Task(
    name="Observe_Blocks_Move_Memory",
    category="MIP",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Remember the colours shown and bring the blocks of these colours near the robot.",
    success=(
        "After the wall has come, the blocks of all colours that were shown lie in the strip "
        "nearest to the robot and both grippers are open; moving before, or bringing another block "
        "there, fails for good."
    ),
)
