"""Remember_Orientation_Restore: turn the near T-blocks as their hidden partners lie.

Draw: k pairs of T-shaped blocks, one in a far and one in a near row, each turned by a quarter turn
or none, partners differently. After 2.0 s a wall hides the far row. Success: every near block lies
at its place in its partner's direction, both grippers open.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.geometry import yaw_rotation
from robospa.tasks import objects
from robospa.tasks.families.memory_wall.wall import HOLD_STILL, WALL, row, wall
from robospa.tasks.families.tabletop import Item, named, side, standing
from robospa.tasks.goals.cue import AfterCue
from robospa.tasks.goals.restore import OrientationTarget, Restore
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText
from robospa.tasks.plan import Home, Pick, Place, Skill
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "orientation.toml")

TURNS = (0.0, -math.pi / 2, math.pi, math.pi / 2)
"""Up, right, down, left: where the bar of the T points, seen from the robot."""

FAR_Y, FAR_X, NEAR_Y, NEAR_X, WALL_Y = 0.18, 0.20, -0.10, 0.21, 0.10
LOW = 0.014
"""A turned block is lower than this [m] above the table (official: z < 0.77, from 0.756 on)."""

FULL_TURN = 0.2
"""Only this far [m] from the middle or more can the expert make half a turn at once."""

LEVELS = {n: Level(candidates=2 * n, subtasks=n, steps=50 + 200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """Both rows, how the far and the near blocks lie (indices of TURNS), and the wall."""

    near: tuple[str, ...]
    far: tuple[str, ...]
    turns: tuple[int, ...]
    start: tuple[int, ...]
    wall: str


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Two rows; a near block never lies as its partner does. All blocks of a row look alike."""
    shown = [int(i) for i in rng.integers(4, size=level)]
    start = [(turn + int(rng.integers(1, 4))) % 4 for turn in shown]
    far_kind = int(rng.integers(2))
    look = int(rng.integers(objects.look_count("t_block")))
    items = [wall(WALL_Y)]
    for i, (x, turn) in enumerate(zip(row(level, FAR_X), shown, strict=True)):
        pose = standing((x, FAR_Y), TURNS[turn])
        items.append(Item(f"far {i}", "t_block", pose, {"look": look, "kind": far_kind}))
    for i, (x, turn) in enumerate(zip(row(level, NEAR_X), start, strict=True)):
        pose = standing((x, NEAR_Y), TURNS[turn])
        items.append(Item(f"near {i}", "t_block", pose, {"look": look, "kind": 1 - far_kind}))
    scene_objects, names = named(rng, items)
    facts = Facts(
        near=tuple(names[f"near {i}"] for i in range(level)),
        far=tuple(names[f"far {i}"] for i in range(level)),
        turns=tuple(shown),
        start=tuple(start),
        wall=names[WALL],
    )
    return SceneSample(scene_objects, facts)


def goal(scene: Scene) -> AfterCue:
    """The near blocks turned like the far ones, after the wall has come."""
    pairs = zip(Facts.of(scene).near, Facts.of(scene).turns, strict=True)
    wanted = [
        OrientationTarget(name, yaw_rotation(TURNS[turn]), scene.table_top + LOW)
        for name, turn in pairs
    ]
    return AfterCue(Restore(wanted, Facts.of(scene).far), [Facts.of(scene).wall])


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Hold still, then turn the near blocks from left to right.

    Where the wrist cannot, half a turn is made of two quarters.
    """
    skills: list[Skill] = [HOLD_STILL]
    facts = Facts.of(scene)
    for name, start, turn in zip(facts.near, facts.start, facts.turns, strict=True):
        place = scene.object(name).pose.position
        arm = side(place[0])
        half = (turn - start) % 4 == 2 and abs(place[0]) < FULL_TURN
        for way in ((start + 1) % 4, turn) if half else (turn,):
            skills.append(Pick(name, lift=0.08, arm=arm))
            skills.append(Place(name, place, yaw=TURNS[way], arm=arm))
    return (*skills, Home())


def slots(scene: Scene) -> Slots:
    """Which blocks are to be turned like which; no direction is named."""
    count = len(Facts.of(scene).near)
    some = "one" if count == 1 else "many"
    return TEXT.slots(*(f"{slot}.{some}" for slot in ("wall", "near", "far")), word=NUMBERS[count])


TASK = Task(
    name="Remember_Orientation_Restore",
    category="MIP",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Remember how the far blocks lie and turn the near ones the same way.",
    success=(
        "After the wall has come, every near block lies within 3 cm of its place and 15 degrees of "
        "its partner's direction, and both grippers are open; moving before fails for good."
    ),
)
