"""Stamp_Seals_Order: stamp a row of coloured pads from right to left with one seal.

Draw: k flat pads of different colours in a row and a seal beside them. Success: the seal was
brought down on the middle of each pad, the rightmost first.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robospa.tasks import objects
from robospa.tasks.colors import LOOK_ALIKES
from robospa.tasks.families.tabletop import Item, draw_look, in_view, named, side, standing
from robospa.tasks.goals.stamping import StampCounter
from robospa.tasks.goals.tools import UseInOrder
from robospa.tasks.instructions.grammar import Phrasings, Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText, by_count, color_orders
from robospa.tasks.objects.tools import PADS
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.sampling.places import LayoutError, Point, free_point
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import ObjectModel
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.text import listed
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "seal.toml")

COLORS = (*LOOK_ALIKES, *((w,) for w in PADS if not any(w in some for some in LOOK_ALIKES)))
"""The official colours in groups of look-alikes: a scene has at most one of each group."""

ROWS = {
    2: ((0.14, 0.25), (-0.05, 0.06)),
    3: ((0.15, 0.25), (-0.05, 0.05), (-0.25, -0.15)),
    4: ((0.17, 0.25), (0.05, 0.10), (-0.10, -0.05), (-0.25, -0.17)),
    5: ((0.20, 0.25), (0.10, 0.13), (-0.02, 0.00), (-0.13, -0.10), (-0.25, -0.20)),
}
"""Ranges of the pads' x [m] from right to left."""

ROW_Y, SEAL_X, SEAL_Y, APART = (-0.18, 0.08), (0.0, 0.25), (-0.15, 0.05), 0.12
ONE_X, ONE_Y, ONE_APART, MIDDLE = (0.05, 0.25), (-0.05, 0.05), 0.10, 0.05
PADS_APART = 0.08
"""Least distance [m] of neighbouring pads' middles: they are 0.07 wide."""

LAYOUTS = 60

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The seal, and the pads with their colours from right to left."""

    seal: str
    colors: tuple[str, ...]
    order: tuple[str, ...]


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Pads of different colours, the seal not too near to any."""
    groups = [COLORS[int(i)] for i in rng.permutation(len(COLORS))[:level]]
    colors = tuple(group[int(rng.integers(len(group)))] for group in groups)
    look = draw_look(rng, "seal")
    points, seal = _layout(level, rng, workcell, look)
    items = [Item("seal", "seal", standing(seal), look)]
    for color, point in zip(colors, points, strict=True):
        items.append(Item(color, "pad", standing(point), {"look": PADS.index(color)}, fixed=True))
    scene_objects, names = named(rng, items)
    facts = Facts(names["seal"], colors, tuple(names[c] for c in colors))
    return SceneSample(scene_objects, facts)


def _layout(
    level: int, rng: np.random.Generator, workcell: Workcell, look: dict[str, int]
) -> tuple[list[Point], Point]:
    """Places of the pads from right to left, and of the seal."""
    pad_seen, seal_seen = in_view(workcell, "pad", {}), in_view(workcell, "seal", look)
    for _ in range(LAYOUTS):
        if level == 1:
            way = 1 if rng.random() < 0.5 else -1
            found = free_point(rng, ONE_X, ONE_Y, [], 1)
            pads = [(way * found[0], found[1])] if found else []
            x = (ONE_X[0], ONE_X[1]) if way > 0 else (-ONE_X[1], -ONE_X[0])
            seal = free_point(rng, x, ONE_Y, [(p, ONE_APART) for p in pads])
        else:
            y = float(rng.uniform(*ROW_Y))
            pads = [(float(rng.uniform(*span)), y) for span in ROWS[level]]
            if any(a[0] - b[0] < PADS_APART for a, b in pairwise(pads)):
                continue
            seal = free_point(rng, SEAL_X, SEAL_Y, [(p, APART) for p in pads], 40)
        if seal and seal_seen(seal) and all(pad_seen(p) for p in pads):
            return pads, seal
    raise LayoutError(f"no free place of the seal beside {level} pads; skip this seed")


def goal(scene: Scene) -> UseInOrder:
    """The pads from right to left; a counter is told which pad comes to which seal."""
    seal = Facts.of(scene).seal
    return UseInOrder([StampCounter(pad, seal) for pad in Facts.of(scene).order], seal)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """From pad to pad, each time with the arm that has less far to reach: the one on the side of
    the pad, or of the seal, that is farther out."""
    seal = Facts.of(scene).seal
    skills: list[Skill] = []
    here = scene.object(seal).pose.position[0]
    for pad in Facts.of(scene).order:
        there = scene.object(pad).pose.position[0]
        arm = side(max(here, there, key=abs))
        skills += [Pick(seal, lift=0.06, arm=arm), Place(seal, on=pad, drop=0.002, arm=arm)]
        here = there
    return tuple(skills)


def slots(scene: Scene) -> Slots:
    """Phrasings for the seal, the pads and their order."""
    facts = Facts.of(scene)
    colors, seal = facts.colors, scene.object(facts.seal)
    count = len(colors)
    own: Slots = {"seal": _seal_names(objects.object_model(seal.asset, seal.params))}
    if count == 1:
        return TEXT.slots("pad", color=colors[0]) | own
    train, held = color_orders(colors)
    own["order"] = (
        (f"from right to left, {train[0]}", f"right to left: {listed(colors)}"),
        tuple(f"going right to left: {text}" for text in held),
    )
    return TEXT.slots(f"pads.{by_count(count)}", count=count, word=NUMBERS[count]) | own


def _seal_names(model: ObjectModel) -> Phrasings:
    """Plain names and the model's own, of which the last third is held out."""
    cut = len(model.phrases) - max(2, len(model.phrases) // 3)
    own = tuple(f"the {p}" for p in model.phrases)
    return ("the stamp", *own[:cut]), ("the hand seal", *own[cut:])


TASK = Task(
    name="Stamp_Seals_Order",
    category="OCE",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Stamp the pads with the seal from right to left.",
    success=(
        "The seal was brought down on each pad, within 1 cm of its middle and of its surface, the "
        "rightmost pad first, then leftwards."
    ),
)
