"""Press_Stapler_Memory: press each stapler of a row as often as the instruction says.

Draw: k fixed staplers in a row, each of any variant and turned any way, and a count from 1 to 5 for
each. Success: at one instant every stapler was pressed exactly as often as asked; one press too
many cannot be made good.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.tasks.families.chain import pressing_arm
from robospa.tasks.families.click_order import click_counter
from robospa.tasks.families.table import Item, draw_variant, named, standing
from robospa.tasks.goals.clicks import PressCounts
from robospa.tasks.instructions.grammar import Phrasings, Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText, by_count, ordinal
from robospa.tasks.plan import Press, Skill
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.text import listed
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "memory_counts.toml")

ROWS = {
    1: (0.0,),
    2: (-0.24, 0.24),
    3: (-0.24, 0.0, 0.24),
    4: (-0.24, -0.08, 0.08, 0.24),
    5: (-0.24, -0.12, 0.0, 0.12, 0.24),
}
"""x of the staplers [m]."""
Y = (-0.03, 0.04)
"""Range of the row's y [m]: nearer to the robot, the outer staplers would not be in view."""
MOST = 5
LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The staplers from left to right, and how often each is pressed."""

    row: tuple[str, ...]
    counts: tuple[int, ...]


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """A row of staplers, and how often each is to be pressed."""
    y = float(rng.uniform(*Y))
    items = [
        Item(
            f"stapler {i}",
            "stapler",
            standing((x, y), float(rng.uniform(-math.pi, math.pi))),
            draw_variant(rng, "stapler"),
            fixed=True,
        )
        for i, x in enumerate(ROWS[level])
    ]
    counts = tuple(int(n) for n in rng.integers(1, MOST + 1, level))
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(tuple(names[item.role] for item in items), counts))


def goal(scene: Scene) -> PressCounts:
    """The row from left to right with its counts; grippers need not be closed (official)."""
    row = [click_counter(scene, name, closed=False) for name in Facts.of(scene).row]
    return PressCounts(row, Facts.of(scene).counts)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """From left to right, every stapler by the arm on its press point's side."""
    skills: list[Skill] = []
    for name, count in zip(Facts.of(scene).row, Facts.of(scene).counts, strict=True):
        skills += [Press(name, arm=pressing_arm(scene, name))] * count
    return tuple(skills)


def slots(scene: Scene) -> Slots:
    """Phrasings for the counts."""
    counts = Facts.of(scene).counts
    if len(counts) == 1:
        return TEXT.slots("stapler") | {"times": _times(counts[0])}
    words = [_times(n)[0][0] for n in counts]
    ranks = [f"the {ordinal(i)[1]} {word}" for i, word in enumerate(words, 1)]
    places = [f"number {i} {word}" for i, word in enumerate(words, 1)]
    each = [f"the {ordinal(i)[1]} one {word}" for i, word in enumerate(words, 1)]
    return TEXT.slots("row") | {
        "counts": (
            (listed(ranks), ", ".join(ranks)),
            (listed(places), ", ".join(places), listed(each)),
        )
    }


def _times(count: int) -> Phrasings:
    return TEXT.phrasings(f"times.{by_count(count)}", count=count, word=NUMBERS[count])


TASK = Task(
    name="Press_Stapler_Memory",
    category="MIP",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Press each stapler of the row as often as asked.",
    success=(
        "Every stapler was touched by a gripper near its press point exactly as often as asked, "
        "with at least 0.1 s without a touch between presses."
    ),
)
