"""Hit_Blocks_Hammer_Order and Stamp_Seals_Order: a tool used in a given order.

Hammer: it lies in the middle; k fixed cubes, coloured red, green, blue, yellow, purple (the first
k), stand around it on one side of the table. Seal: k flat pads of different colours in a row, which
are stamped from right to left, and a seal beside them.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robospa.geometry import Array
from robospa.tasks import objects
from robospa.tasks.colors import LOOK_ALIKES
from robospa.tasks.families import table
from robospa.tasks.goals.clicks import UseInOrder
from robospa.tasks.goals.counters import HitCounter, StampCounter
from robospa.tasks.instructions import NUMBERS, Phrasings, Slots, TaskText, by_count, color_orders
from robospa.tasks.objects.tools import PADS
from robospa.tasks.plan import Hit, Pick, Place, Skill
from robospa.tasks.sampling import places
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import ObjectModel
from robospa.tasks.task import SceneFacts, SceneSample, Task
from robospa.text import listed
from robospa.workcell import Workcell

HAMMER_TEXT = TaskText.beside(__file__, "tool_order_hammer.toml")
SEAL_TEXT = TaskText.beside(__file__, "tool_order_seal.toml")


HALF, YAW, DISTANCE, TRIES = 0.025, 0.5, 0.12, 60
HAMMER_AT: places.Point = (0.0, -0.06)
AREA, MIDDLE = places.Area((-0.25, 0.25), (-0.25, 0.25)), 0.05
ACROSS = 0.10
"""How far [m] the further blocks may lie beyond the middle, seen from the first one."""
FREE = 0.068
"""Least distance [m] of a block's centre from the hammer's handle and head."""


@dataclass(frozen=True)
class HammerFacts(SceneFacts):
    """The hammer, and the blocks with their colours in the order of the hits."""

    hammer: str
    colors: tuple[str, ...]
    order: tuple[str, ...]


def _draw_hammer(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    left = bool(rng.random() < 0.5)
    arm = workcell.arms[0 if left else 1]
    nearest, farthest = arm.tool_reach

    def propose(generator: np.random.Generator) -> tuple[Array, Array, places.Mask]:
        x, y = AREA.draw(generator, (level, TRIES))
        inward = -x if left else x  # the first arm's side is positive
        usable = (np.abs(x) >= MIDDLE) & (inward >= -ACROSS) & _beside_hammer(x, y)
        usable[0] &= inward[0] > 0
        reach = np.hypot(x - arm.base[0], y - arm.base[1])
        usable &= (reach >= nearest) & (reach <= farthest)
        return x, y, usable & workcell.in_view(x, y, HALF * math.sqrt(2), 2 * HALF, (0.0, 0.0))

    first, *others = places.scatter(rng, propose, DISTANCE)
    points = [first, *places.shuffled(rng, others)]
    items = [table.thing("hammer", "hammer", HAMMER_AT, table.draw_variant(rng, "hammer"))]
    for rgb, point in zip(table.ORDERED.values(), points, strict=False):
        yaw = rng.uniform(-YAW, YAW)
        items.append(table.block("order", point, HALF, rgb, yaw, fixed=True))
    return table.sample(rng, items, HammerFacts, colors=tuple(table.ORDERED)[:level])


def _beside_hammer(x: Array, y: Array) -> places.Mask:
    half = objects.object_model("hammer").size[1] / 2
    dx, dy = x - HAMMER_AT[0], y - HAMMER_AT[1]
    free: places.Mask = np.hypot(dx, dy - np.clip(dy, -half, half)) >= FREE
    return free


def _hammer_goal(scene: Scene) -> UseInOrder:
    facts = HammerFacts.of(scene)
    head = table.frame_of(scene, facts.hammer, "head")
    counters = [
        HitCounter(name, table.frame_of(scene, name, "press"), facts.hammer, head)
        for name in facts.order
    ]
    return UseInOrder(counters, facts.hammer)


def _hammer_plan(scene: Scene) -> tuple[Skill, ...]:
    facts = HammerFacts.of(scene)
    return (Hit(facts.hammer, facts.order, arm=table.side_of(scene, facts.order[0])),)


def _hammer_slots(scene: Scene) -> Slots:
    colors = HammerFacts.of(scene).colors
    if len(colors) == 1:
        return HAMMER_TEXT.slots("hammer", "block", color=colors[0])
    return HAMMER_TEXT.slots("hammer") | {"order": color_orders(colors)}


HAMMER = Task(
    name="Hit_Blocks_Hammer_Order",
    category="OCE",
    levels=table.LEVELS,
    draw=_draw_hammer,
    goal=_hammer_goal,
    plan=_hammer_plan,
    templates=HAMMER_TEXT.templates,
    slots=_hammer_slots,
    summary="Hit the blocks with the hammer in the given order of colours.",
    success=(
        "The hammer's head has touched the middle of the blocks' tops in the order red, green, "
        "blue, yellow, purple (as many as there are)."
    ),
)

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
ONE_X, ONE_Y, ONE_APART = (0.05, 0.25), (-0.05, 0.05), 0.10
PADS_APART = 0.08
"""Least distance [m] of neighbouring pads' middles: they are 0.07 wide."""
LAYOUTS = 60


@dataclass(frozen=True)
class SealFacts(SceneFacts):
    """The seal, and the pads with their colours from right to left."""

    seal: str
    colors: tuple[str, ...]
    order: tuple[str, ...]


def _draw_seal(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    groups = [COLORS[int(i)] for i in rng.permutation(len(COLORS))[:level]]
    colors = tuple(group[int(rng.integers(len(group)))] for group in groups)
    variant = table.draw_variant(rng, "seal")
    points, seal = _layout(level, rng, workcell, variant)
    items = [table.thing("seal", "seal", seal, variant)]
    for color, point in zip(colors, points, strict=True):
        items.append(table.thing("order", "pad", point, {"look": PADS.index(color)}, fixed=True))
    return table.sample(rng, items, SealFacts, colors=colors)


def _layout(
    level: int, rng: np.random.Generator, workcell: Workcell, variant: dict[str, int]
) -> tuple[list[places.Point], places.Point]:
    pad_seen, seal_seen = (
        table.in_view(workcell, "pad", {}),
        table.in_view(workcell, "seal", variant),
    )
    for _ in range(LAYOUTS):
        if level == 1:
            way = 1 if rng.random() < 0.5 else -1
            found = (rng.uniform(*ONE_X), rng.uniform(*ONE_Y))
            pads = [(way * found[0], found[1])]
            x = (ONE_X[0], ONE_X[1]) if way > 0 else (-ONE_X[1], -ONE_X[0])
            seal = places.tried_point(rng, x, ONE_Y, [(p, ONE_APART) for p in pads], 100)
        else:
            y = rng.uniform(*ROW_Y)
            pads = [(rng.uniform(*span), y) for span in ROWS[level]]
            if any(a[0] - b[0] < PADS_APART for a, b in pairwise(pads)):
                continue
            seal = places.tried_point(rng, SEAL_X, SEAL_Y, [(p, APART) for p in pads], 40)
        if seal and seal_seen(seal) and all(pad_seen(p) for p in pads):
            return pads, seal
    raise places.LayoutError(f"no free place of the seal beside {level} pads; skip this seed")


def _seal_goal(scene: Scene) -> UseInOrder:
    """The pads from right to left; a counter is given which pad comes to which seal."""
    facts = SealFacts.of(scene)
    return UseInOrder([StampCounter(pad, facts.seal) for pad in facts.order], facts.seal)


def _seal_plan(scene: Scene) -> tuple[Skill, ...]:
    """From pad to pad, each time with the arm that has less far to reach: the one on the side of
    the pad, or of the seal, that is farther out."""
    facts = SealFacts.of(scene)
    skills: list[Skill] = []
    here = scene.object(facts.seal).pose.position[0]
    for pad in facts.order:
        there = scene.object(pad).pose.position[0]
        arm = table.side(max(here, there, key=abs))
        skills.append(Pick(facts.seal, lift=0.06, arm=arm))
        skills.append(Place(facts.seal, on=pad, drop=0.002, arm=arm))
        here = there
    return tuple(skills)


def _seal_slots(scene: Scene) -> Slots:
    facts = SealFacts.of(scene)
    colors, count = facts.colors, len(facts.colors)
    own: Slots = {"seal": _seal_names(objects.model_of(scene.object(facts.seal)))}
    if count == 1:
        return SEAL_TEXT.slots("pad", color=colors[0]) | own
    train, held = color_orders(colors)
    own["order"] = (
        (f"from right to left, {train[0]}", f"right to left: {listed(colors)}"),
        tuple(f"going right to left: {text}" for text in held),
    )
    return SEAL_TEXT.slots(f"pads.{by_count(count)}", count=count, word=NUMBERS[count]) | own


def _seal_names(model: ObjectModel) -> Phrasings:
    """Plain names and the model's own, of which the last third is held out."""
    cut = len(model.phrases) - max(2, len(model.phrases) // 3)
    own = tuple(f"the {p}" for p in model.phrases)
    return ("the stamp", *own[:cut]), ("the hand seal", *own[cut:])


SEAL = Task(
    name="Stamp_Seals_Order",
    category="OCE",
    levels=table.LEVELS,
    draw=_draw_seal,
    goal=_seal_goal,
    plan=_seal_plan,
    templates=SEAL_TEXT.templates,
    slots=_seal_slots,
    summary="Stamp the pads with the seal from right to left.",
    success=(
        "The seal was brought down on each pad, within 1 cm of its middle and of its surface, the "
        "rightmost pad first, then leftwards."
    ),
)
