"""Move_Blocks_Apart: blocks of two colours in the middle, one colour to the right, one to the left.

Draw: k equal cubes in a narrow column in the middle of the table, coloured in two colours. Success:
every block of the first colour lies at least 10 cm right of the middle, every other one at least
10 cm left of it, at the same time. Level 1 has one block and one side.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.tasks.families.colors import first_colors
from robospa.tasks.families.tabletop import Item, named, standing
from robospa.tasks.goals.parts import Region
from robospa.tasks.goals.placing import Destination, bring
from robospa.tasks.instructions.grammar import Phrasings, Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.sampling.places import LAYOUTS, TRIES_PER_POINT, LayoutError, shuffled
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task, Tracker
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "blocks.toml")

COLORS = first_colors(7)
TO_RIGHT = {2: 1, 3: 1, 4: 2, 5: 2}
"""How many of the blocks have the first colour, which goes right."""

X, Y, YAW = (-0.06, 0.06), (-0.22, 0.10), 0.75
HALF = (0.014, 0.016)
DISTANCE, GAP = 0.04, 0.003
"""Least distance of centres, and of the cubes' sides [m]."""

RIGHT, LEFT = Region(x=(0.1, math.inf)), Region(x=(-math.inf, -0.1))

PLACE_X = 0.17
PLACE_Y = {1: (-0.05,), 2: (-0.02, -0.14), 3: (0.0, -0.10, -0.20)}
"""Where the expert puts the blocks of one colour, far ones first; not part of the rule."""

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The blocks of each side, and their colour; None where there is none."""

    right: tuple[str, ...]
    left: tuple[str, ...]
    right_color: str | None
    left_color: str | None


@dataclass(frozen=True)
class Square:
    """A cube's footprint: centre [m], turn [rad] and half edge [m]."""

    x: float
    y: float
    yaw: float
    half: float

    def clear_of(self, other: Square) -> bool:
        """Whether the centres are DISTANCE and the sides GAP apart."""
        dx, dy = other.x - self.x, other.y - self.y
        if math.hypot(dx, dy) <= DISTANCE:
            return False
        turns = (self.yaw, self.yaw + math.pi / 2, other.yaw, other.yaw + math.pi / 2)
        return any(
            abs(dx * math.cos(t) + dy * math.sin(t)) > self._extent(t) + other._extent(t) + GAP
            for t in turns
        )

    def _extent(self, turn: float) -> float:
        return self.half * (abs(math.cos(turn - self.yaw)) + abs(math.sin(turn - self.yaw)))


def _squares(rng: np.random.Generator, count: int, half: float) -> list[Square]:
    """Free footprints, in random order."""
    for _ in range(LAYOUTS):
        found: list[Square] = []
        for _ in range(TRIES_PER_POINT * count):
            x, y, yaw = (float(rng.uniform(*ends)) for ends in (X, Y, (-YAW, YAW)))
            square = Square(x, y, yaw, half)
            if all(square.clear_of(other) for other in found):
                found.append(square)
                if len(found) == count:
                    return shuffled(rng, found)
    raise LayoutError(f"no free column of {count} blocks in {LAYOUTS} draws; skip this seed")


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Two colours, the first for the right side (level 1: one colour, either side)."""
    first, second = (list(COLORS)[int(i)] for i in rng.permutation(len(COLORS))[:2])
    right = TO_RIGHT[level] if level > 1 else int(rng.integers(2))
    words = [first] * right + [second] * (level - right)
    half = float(rng.uniform(*HALF))
    items = [
        Item(
            str(i),
            "block",
            standing((square.x, square.y), square.yaw, half),
            {"half": [half, half, half], "color": list(COLORS[word])},
        )
        for i, (word, square) in enumerate(zip(words, _squares(rng, level, half), strict=True))
    ]
    scene_objects, names = named(rng, items)
    blocks = tuple(names[str(i)] for i in range(level))
    facts = Facts(
        right=blocks[:right],
        left=blocks[right:],
        right_color=first if right else None,
        left_color=second if right < level else None,
    )
    return SceneSample(scene_objects, facts)


def goal(scene: Scene) -> Tracker:
    """Every block on its colour's side; the other side is astray."""
    facts = Facts.of(scene)
    parts = [Destination(name, (RIGHT,), (LEFT,)) for name in facts.right]
    parts += [Destination(name, (LEFT,), (RIGHT,)) for name in facts.left]
    return bring(parts, scene.table_top)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Right blocks with the right arm, then left ones with the left arm, far ones first."""
    skills: list[Skill] = []
    facts = Facts.of(scene)
    sides = (("right", PLACE_X, facts.right), ("left", -PLACE_X, facts.left))
    for arm, x, names in sides:
        at = {name: scene.object(name).pose.position for name in names}
        rows = PLACE_Y.get(len(at), ())
        for name, y in zip(sorted(at, key=lambda n: -at[n][1]), rows, strict=True):
            half = float(scene.object(name).params["half"][2])
            skills.append(Pick(name, lift=0.08, arm=arm))
            skills.append(Place(name, (x, y, scene.table_top + half), arm=arm))
    return tuple(skills)


def slots(scene: Scene) -> Slots:
    """Phrasings for the colours and sides."""
    facts = Facts.of(scene)
    if scene.level == 1:
        side, color = ("right" if facts.right else "left"), facts.right_color or facts.left_color
        return TEXT.slots("block", "to", "at", color=color, side=side)
    return TEXT.slots() | {
        "right": _blocks(facts.right_color, len(facts.right)),
        "left": _blocks(facts.left_color, len(facts.left)),
    }


def _blocks(color: str | None, count: int) -> Phrasings:
    entry = "blocks.one" if count == 1 else "blocks.many"
    return TEXT.phrasings(entry, color=color, count=count, word=NUMBERS[count])


TASK = Task(
    name="Move_Blocks_Apart",
    category="OFE",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Move the blocks of one colour to the right and those of the other to the left.",
    success=(
        "Every block lies on the table, at least 10 cm from the middle on its colour's side, "
        "and was let go of there."
    ),
)
