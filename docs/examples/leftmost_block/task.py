"""Pick_Leftmost_Block: among blocks of one size and colour, lift the one farthest to the left.

A worked example, not a task of the benchmark; docs/adding-a-task.md walks through it.
"""

from __future__ import annotations

import numpy as np

from robospa.geometry import Array, Pose, yaw_rotation
from robospa.tasks.families.table import PickFacts
from robospa.tasks.goals.lifting import Lift, PickTracker
from robospa.tasks.instructions import Slots, TaskText
from robospa.tasks.plan import Pick, Skill
from robospa.tasks.sampling.places import Area, Mask, Points, scatter
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import Level, SceneSample, Task, Tracker
from robospa.workcell import TABLE_TOP, Workcell

TEXT = TaskText.beside(__file__, "instructions.toml")
HALF = 0.022  # [m]
AREA = Area(x=(-0.25, 0.25), y=(-0.15, 0.08), clear_middle=True)
LEVELS = {k: Level(candidates=k + 1, subtasks=1, steps=150) for k in range(1, 6)}


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Blocks scattered at least 9 cm apart, the leftmost one by a clear 3 cm."""
    count = LEVELS[level].candidates

    def propose(rng: np.random.Generator) -> tuple[Array, Array, Mask]:
        x, y = AREA.draw(rng, (count, 40))
        return x, y, workcell.in_view(x, y, 1.42 * HALF, 2 * HALF)

    def unambiguous(points: Points) -> bool:
        first, second = sorted(x for x, _ in points)[:2]
        return second - first > 0.03

    points = scatter(rng, propose, [[0.09] * count] * count, unambiguous)
    color = [round(float(c), 4) for c in rng.random(3)]
    blocks = tuple(
        SceneObject(
            name=f"object_{i}",  # says nothing about its role
            asset="block",
            pose=Pose((x, y, TABLE_TOP + HALF), yaw_rotation(float(rng.uniform(-0.6, 0.6)))),
            params={"half": [HALF] * 3, "color": color},
        )
        for i, (x, y) in enumerate(points)
    )
    target = min(blocks, key=lambda block: block.pose.position[0])
    return SceneSample(blocks, PickFacts(target.name))


def goal(scene: Scene) -> Tracker:
    """The target rises by more than 6 cm while a gripper carries it."""
    names = tuple(item.name for item in scene.objects)
    return PickTracker(PickFacts.of(scene).target, names, Lift(rise=0.06))


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Pick the target."""
    return (Pick(PickFacts.of(scene).target),)


def slots(scene: Scene) -> Slots:
    """What may stand for {target}: in training, and held out. {arm} and {table} are common ones."""
    return TEXT.slots("target")


TASK = Task(
    name="Pick_Leftmost_Block",
    category="CPI",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Pick the leftmost of 2 to 6 equal blocks.",
    success="the leftmost block rises by more than 6 cm while a gripper carries it",
)
