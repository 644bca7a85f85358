"""What the three stacking tasks share: where the expert builds, and how.

A tower is a list of blocks from bottom to top. With a single block there is nothing to stack: it
is brought to the middle of the near edge instead (official level 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robospa.tasks.families.tabletop import side
from robospa.tasks.goals.stack import HEIGHT_TOLERANCE, Bring, Stack
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import COMMON, NUMBERS, TaskText, by_count
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.sampling.places import Point, apart
from robospa.tasks.scene import Scene
from robospa.tasks.task import SceneFacts

TEXT = TaskText.beside(__file__, "towers.toml")

NEAR_BAND: tuple[Point, Point] = ((-0.05, 0.05), (-1.0, -0.08))
"""Level 1: the block's centre must come here (x, y)."""

CLEARANCE = 0.09
"""The expert's place keeps this far [m] from all blocks where it can: a gripper must fit."""

LAYER_SHARE = 0.65
"""Heights may be wrong by at most this share of the thinnest block: a layer is never mistaken."""


@dataclass(frozen=True)
class TowerFacts(SceneFacts):
    """The blocks from bottom to top, and where [m] the expert builds."""

    order: tuple[str, ...]
    place: tuple[float, float]


def building_place(level: int, rng: np.random.Generator, blocks: Sequence[Point]) -> Point:
    """Where the expert builds; not part of the task's rule."""
    x, y = ((-0.01, 0.01), (-0.20, -0.10)) if level == 1 else ((-0.03, 0.03), (-0.15, -0.11))
    for _ in range(100):
        point = (float(rng.uniform(*x)), float(rng.uniform(*y)))
        if apart(point, blocks, CLEARANCE):
            return point
    return (0.0, -0.16)


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
    """Phrasings for a tower by size or length, largest or longest at the bottom."""
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


def tower_goal(scene: Scene) -> Stack | Bring:
    """The blocks of fact `order` as a tower, or at level 1 a block in the near band.

    Heights are looked at finely enough to tell a thin block's layer from the one below.
    """
    order = TowerFacts.of(scene).order
    if scene.level == 1:
        return Bring(order[0], *NEAR_BAND)
    thick = [2 * _half_height(scene, name) for name in order]
    return Stack(order, thick, min(HEIGHT_TOLERANCE, LAYER_SHARE * min(thick)))


def tower_plan(scene: Scene) -> tuple[Skill, ...]:
    """Bottom block to the drawn place, every further block on top of the one before."""
    order = TowerFacts.of(scene).order
    x, y = TowerFacts.of(scene).place
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
