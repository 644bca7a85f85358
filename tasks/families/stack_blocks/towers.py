"""What the three stacking tasks share: where the expert builds, and how.

A tower is a list of blocks from bottom to top. With a single block there is nothing to stack: it
is brought to the middle of the near edge instead (official level 1).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robospa.tasks.families.tabletop import Point, apart, side
from robospa.tasks.goals.stack import HEIGHT_TOLERANCE, Bring, Stack
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import COMMON, TaskText
from robospa.tasks.instructions.words import NUMBERS, by_count
from robospa.tasks.layouts import Area, LayoutError, Points
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.scene import Scene
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "towers.toml")

NEAR_BAND: tuple[Point, Point] = ((-0.05, 0.05), (-1.0, -0.08))
"""Level 1: the block's centre must come here (x, y)."""

CLEARANCE = 0.09
"""The expert's place keeps this far [m] from all blocks where it can: a gripper must fit."""

POOL, LAYOUTS, POOLS = 256, 2048, 40
"""Places drawn at once, layouts made of them, and how often at most."""

LAYER_SHARE = 0.65
"""Heights may be wrong by at most this share of the thinnest block: a layer is never mistaken."""


def building_place(level: int, rng: np.random.Generator, blocks: Sequence[Point]) -> Point:
    """Where the expert builds; not part of the task's rule."""
    x, y = ((-0.01, 0.01), (-0.20, -0.10)) if level == 1 else ((-0.03, 0.03), (-0.15, -0.11))
    for _ in range(100):
        point = (float(rng.uniform(*x)), float(rng.uniform(*y)))
        if apart(point, blocks, CLEARANCE):
            return point
    return (0.0, -0.16)


@dataclass(frozen=True)
class Ground:
    """Where the blocks of a tower may lie: in `area`, |x| at least `off_middle` [m].

    And at least `free` [m] from the point `middle` [m] of the near edge.
    """

    area: Area
    off_middle: float
    middle: Point
    free: float


def scattered_blocks(
    rng: np.random.Generator,
    workcell: Workcell,
    ground: Ground,
    halves: Sequence[Sequence[float]],
    gaps: Callable[[int, int], float],
    accept: Callable[[Points], bool] = lambda points: True,
) -> list[Point]:
    """A place [m] for a block of each half sizes [m], seen whole by the head camera.

    `gaps(i, j)` is the least distance [m] of two blocks. Many layouts are drawn at once from a pool
    of usable places, and the first that keeps the distances and that `accept` takes is used, so
    every such layout is equally likely. LayoutError if there is none in a bounded number.
    """
    count = len(halves)
    reach = max(math.hypot(*half[:2]) for half in halves)  # the same for all: places tell nothing
    height = 2 * max(half[2] for half in halves)
    pairs = list(itertools.combinations(range(count), 2))
    for _ in range(POOLS):
        x, y = ground.area.draw(rng, (POOL,))
        mx, my = ground.middle
        usable = (np.abs(x) >= ground.off_middle) & (np.hypot(x - mx, y - my) >= ground.free)
        usable &= workcell.in_view(x, y, reach, height, (0.0, 0.0))
        x, y = x[usable], y[usable]
        drawn = rng.integers(len(x), size=(LAYOUTS, count)).T
        xs, ys = x[drawn], y[drawn]  # a row a block, a column a layout
        for i, j in pairs:
            free = (xs[i] - xs[j]) ** 2 + (ys[i] - ys[j]) ** 2 >= gaps(i, j) ** 2
            xs, ys = xs[:, free], ys[:, free]
        for px, py in zip(xs.T.tolist(), ys.T.tolist(), strict=True):
            points = list(zip(px, py, strict=True))
            if accept(points):
                return points
    raise LayoutError(f"no free layout of {count} blocks in {POOLS * LAYOUTS} draws; skip the seed")


@dataclass(frozen=True)
class Scale:
    """What is compared: its two ends for two blocks and for more, and other words held out."""

    two: tuple[str, str]
    more: tuple[str, str]
    held_two: tuple[str, str]
    held_more: tuple[str, str]


SIZE = Scale(
    ("larger", "smaller"), ("largest", "smallest"), ("bigger", "smaller"), ("biggest", "tiniest")
)
LENGTH = Scale(
    ("longer", "shorter"), ("longest", "shortest"), ("longer", "shorter"), ("longest", "shortest")
)


def tower_slots(scale: Scale, count: int) -> Slots:
    """How a tower by size or length is said, largest or longest at the bottom."""
    if count == 1:
        return TEXT.slots("block") | {"middle": COMMON.phrasings("middle.near")}
    most, least = scale.two if count == 2 else scale.more
    held_most, held_least = scale.held_two if count == 2 else scale.held_more
    more, less = (f"{word.removesuffix('st')}r" for word in (most, least))
    some = by_count(count)
    order = TEXT.phrasings(
        f"order.{some}",
        most=most,
        least=least,
        held_most=held_most,
        held_least=held_least,
        more=more,
        less=less,
    )
    middle = COMMON.phrasings("middle.table")
    number = TEXT.slots(f"number.{some}", count=count, word=NUMBERS[count])
    return number | {"order": order, "middle": middle}


def draw_color(rng: np.random.Generator) -> list[float]:
    """A random colour (linear RGB) that all blocks of a scene share."""
    return [round(float(c), 3) for c in rng.uniform(0.0, 1.0, 3)]


def tower_goal(scene: Scene) -> Stack | Bring:
    """The blocks of fact `order` as a tower, or at level 1 a block in the near band.

    Heights are looked at finely enough to tell a thin block's layer from the one below.
    """
    order = scene.facts["order"]
    if scene.level == 1:
        return Bring(order[0], *NEAR_BAND)
    thick = [2 * _half_height(scene, name) for name in order]
    return Stack(order, thick, min(HEIGHT_TOLERANCE, LAYER_SHARE * min(thick)))


def tower_plan(scene: Scene) -> tuple[Skill, ...]:
    """Bottom block to the drawn place, every further block on top of the one before."""
    order = list(scene.facts["order"])
    x, y = scene.facts["place"]
    skills: list[Skill] = []
    height = 0.0
    for i, name in enumerate(order):
        arm = side(scene.object(name).pose.position[0])
        half = _half_height(scene, name)
        skills.append(Pick(name, lift=0.10 + height, arm=arm))
        if i == 0:
            skills.append(Place(name, (x, y, scene.table_top + half), arm=arm))
        else:
            skills.append(Place(name, on=order[i - 1], arm=arm))
        height += 2 * half
    return tuple(skills)


def _half_height(scene: Scene, name: str) -> float:
    return float(scene.object(name).params["half"][2])
