"""What the tasks of Geometric Attribute Cognition share: blocks that differ in one measure only.

All blocks of a scene share one colour; rank 1 is the largest of the measure. Rank, place, name and
order of the blocks are independent, so only the measure tells the target.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Array, Pose, Vec3, yaw_rotation
from robospa.tasks.families.colors import drawn_color
from robospa.tasks.families.picking import PickFacts, lifted, pick_target
from robospa.tasks.goals.pick import Lift
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText, ordinal
from robospa.tasks.sampling.places import Area, Mask, Points, scatter, spread
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import Level, SceneSample, Task
from robospa.workcell import TABLE_TOP, FixedCamera, Workcell

TEXT = TaskText.beside(__file__, "instructions.toml")

Range = tuple[float, float]

WORDS: Mapping[str, Mapping[str, str]] = {
    "size": {
        "measure": "size",
        "how": "big each block is",
        "most": "largest",
        "least": "smallest",
    },
    "height": {
        "measure": "height",
        "how": "tall each block is",
        "most": "tallest",
        "least": "shortest",
    },
    "length": {
        "measure": "length",
        "how": "long each block is from left to right",
        "most": "longest",
        "least": "shortest",
    },
    "area": {
        "measure": "base area",
        "how": "much table each block covers",
        "most": "largest base",
        "least": "smallest base",
    },
}
"""How a measure of blocks is called, how it is looked at, and its two ends, by slot."""

DISC = ((0.0, -0.12), 0.015)
"""No block lies within this squared radius [m2] of this point."""
LEVELS: Mapping[int, Level] = {k: Level(k + 1, 1, 150) for k in range(1, 6)}


@dataclass(frozen=True)
class Facts(PickFacts):
    """Target, and its rank in the one measure that differs; rank 1 is the largest."""

    size_rank: int = 0
    height_rank: int = 0
    length_rank: int = 0
    area_rank: int = 0

    @property
    def rank(self) -> int:
        """The rank that is asked for, in the measure of the scene."""
        return self.size_rank or self.height_rank or self.length_rank or self.area_rank


def tight_row(points: Points) -> bool:
    """Three blocks in one tight row, left to right: too hard to get between."""
    pairs = list(itertools.pairwise(sorted(points)))
    return all(b[0] - a[0] < 0.13 and abs(b[1] - a[1]) < 0.035 for a, b in pairs)


def wide(x: float, y: float) -> Callable[[Points], bool]:
    """Whether points extend over at least `x` and `y` [m]."""
    return lambda ps: spread([p[0] for p in ps]) >= x and spread([p[1] for p in ps]) >= y


@dataclass(frozen=True)
class Layout:
    """How the blocks of a level are scattered [m, rad].

    A block's first candidate comes from `first`, later ones from `redraw`; `margin` is added to
    the two blocks' room for the least centre distance; |x| below `band` is refused. A block has
    `tries` candidates before the layout is begun anew.
    """

    first: Area
    redraw: Area
    margin: float
    band: float
    yaw: float
    accept: Callable[[Points], bool] = lambda points: True
    tries: int = 40


_BOX = Area((-0.22, 0.22), (-0.15, 0.10), True)
LAYOUTS = {
    1: Layout(_BOX, Area((-0.25, 0.25), (-0.01, 0.11), True), 0.055, 0.04, 0.6),
    2: Layout(
        Area((-0.27, 0.27), (-0.15, 0.10), True),
        Area((-0.22, 0.22), (-0.01, 0.11), True),
        0.055,
        0.04,
        0.6,
        lambda points: not tight_row(points),
    ),
    3: Layout(_BOX, _BOX, 0.04, 0.02, 0.35, wide(0.14, 0.03)),
    4: Layout(_BOX, _BOX, 0.08, 0.02, 0.35, wide(0.15, 0.04)),
    5: Layout(_BOX, Area((-0.31, 0.31), (-0.02, 0.13), True), 0.052, 0.035, 0.6, wide(0.24, 0.08)),
}
"""Those of the tasks about size and area."""

FRONT_TRIES = 160
_FRONT = Area((-0.25, 0.25), (-0.15, 0.05), True)


def front(margin: float, yaw: float, x: float, y: float = 0.0) -> Layout:
    """A level's layout of the tasks about height and length, extending over at least `x`, `y`."""
    return Layout(_FRONT, _FRONT, margin, 0.02, yaw, wide(x, y), tries=FRONT_TRIES)


@dataclass(frozen=True)
class Measure:
    """One measure of blocks, and what follows from it.

    `ranges(level)` are the values [m] of ranks 1, 2, ...; `shared` are ranges of values that all
    blocks of a scene have in common; `half(value, shared, level)` makes the half sizes of a block.
    `room` [m] of a block enters the least centre distances, `seen` (radius, height) [m] the view.
    `visible(camera, points, halves)` refuses layouts in which a block hides another.
    """

    word: str
    ranges: Callable[[int], tuple[Range, ...]]
    half: Callable[[float, tuple[float, ...], int], Vec3]
    room: Callable[[Vec3], float]
    seen: Callable[[Vec3], tuple[float, float]]
    shared: tuple[Range, ...] = ()
    visible: Callable[[FixedCamera, Points, list[Vec3]], bool] = lambda camera, points, halves: True


def diagonal(half: Vec3) -> float:
    """Half the diagonal [m] of a block's base."""
    return math.hypot(half[0], half[1])


def draw(
    level: int, rng: np.random.Generator, workcell: Workcell, measure: Measure, layout: Layout
) -> SceneSample:
    """Blocks of the first n ranks in random order, scattered, and a uniform target rank."""
    ranges = measure.ranges(level)
    count = len(ranges)
    ranks = [int(r) + 1 for r in rng.permutation(count)]
    values = [float(rng.uniform(*ranges[r - 1])) for r in ranks]
    color = drawn_color(rng)
    shared = tuple(float(rng.uniform(*r)) for r in measure.shared)
    halves = [measure.half(v, shared, level) for v in values]
    radius, height = (np.array(c)[:, None] for c in zip(*map(measure.seen, halves), strict=True))

    def propose(rng: np.random.Generator) -> tuple[Array, Array, Mask]:
        x, y = layout.redraw.draw(rng, (count, layout.tries))
        x[:, :1], y[:, :1] = layout.first.draw(rng, (count, 1))
        (dx, dy), square = DISC
        usable = (np.abs(x) >= layout.band) & ((x - dx) ** 2 + (y - dy) ** 2 >= square)
        return x, y, usable & workcell.in_view(x, y, radius, height)

    rooms = [measure.room(h) for h in halves]
    points = scatter(
        rng,
        propose,
        [[a + b + layout.margin for b in rooms] for a in rooms],
        lambda points: layout.accept(points) and measure.visible(workcell.head, points, halves),
    )
    yaws = rng.uniform(-layout.yaw, layout.yaw, count)
    objects = tuple(
        SceneObject(
            f"object_{i}",
            "block",
            Pose(
                (points[i][0], points[i][1], TABLE_TOP + halves[i][2]), yaw_rotation(float(yaws[i]))
            ),
            {"half": list(halves[i]), "color": color},
        )
        for i in range(count)
    )
    target = int(rng.integers(count))
    rank = {f"{measure.word}_rank": ranks[target]}
    return SceneSample(objects, Facts(f"object_{target}", **rank))


def rank_task(measure: Measure, layouts: Mapping[int, Layout]) -> Task:
    """The task that asks for a block by its rank in `measure`."""
    word = measure.word

    def slots(scene: Scene) -> Slots:
        rank, count = Facts.of(scene).rank, len(scene.objects)
        if count == 2:
            which = "larger" if rank == 1 else "smaller"
        else:
            which = "first" if rank == 1 else "other"
        number, spelled = ordinal(rank)
        fixed: Slots = {slot: ((text,), (text,)) for slot, text in WORDS[word].items()}
        return fixed | TEXT.slots(f"block.{word}.{which}", number=number, word=spelled)

    return Task(
        name=f"Pick_Blocks_{word.capitalize()}",
        category="GAC",
        levels=LEVELS,
        draw=lambda level, rng, workcell: draw(level, rng, workcell, measure, layouts[level]),
        goal=lifted(Lift(above=0.82)),
        plan=pick_target,
        templates=TEXT.templates,
        slots=slots,
        summary=f"Pick the block of the named {word} rank among 2 to 6 blocks of one colour.",
        success="the target's centre is higher than 0.82 m while a gripper carries it",
    )
