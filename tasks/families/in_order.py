"""Clicks in a given order, grippers closed, and a tool used in one.

Click_Objects_Order: an alarm clock, a stapler, a can, playing cards and bread (the first k), fixed,
anywhere in front of the robot. Click_Bell_Clockwise_Order: k equal bells on a wobbly ring anywhere
in the region; clockwise is as seen from above, from the farthest one.

Hit_Blocks_Hammer_Order: the hammer lies in the middle; k fixed cubes, coloured red, green, blue,
yellow, purple (the first k), stand around it on one side of the table. Stamp_Seals_Order: k flat
pads of different colours in a row, which are stamped from right to left, and a seal beside them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robospa.geometry import Array
from robospa.tasks import objects
from robospa.tasks.colors import LOOK_ALIKES
from robospa.tasks.families import table
from robospa.tasks.families.table import standing
from robospa.tasks.goals.checklist import ClickInOrder, UseInOrder
from robospa.tasks.goals.counters import HitCounter, StampCounter
from robospa.tasks.instructions import (
    NUMBERS,
    Phrasings,
    Slots,
    TaskText,
    acting_arm,
    by_count,
    color_orders,
    one_after_another,
)
from robospa.tasks.objects.tools import PADS
from robospa.tasks.plan import Hit, Pick, Place, Press, Skill
from robospa.tasks.sampling import places
from robospa.tasks.sampling.turns import Turnable, outline, turned
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import ObjectModel, Params
from robospa.tasks.task import SceneFacts, SceneSample, Task
from robospa.text import listed
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "click_order.toml")
BELLS_TEXT = TaskText.beside(__file__, "click_order_bells.toml")
HAMMER_TEXT = TaskText.beside(__file__, "tool_order_hammer.toml")
SEAL_TEXT = TaskText.beside(__file__, "tool_order_seal.toml")

TRIES = 60
"""Candidate places per object and draw."""
VARIANTS: Mapping[str, tuple[int, ...]] = {
    "alarm_clock": (0, 1), "bread": (0, 1, 2, 4, 5), "bell": (0, 1),
}  # fmt: skip
"""Variants that are used, where not all: official models 0, 1, 3, 5 and 6 of bread."""
TURNS: Mapping[str, float] = {
    "alarm_clock": math.pi, "stapler": math.pi, "playing_cards": math.pi, "bread": math.pi / 4,
}  # fmt: skip
"""How far either way an object may be turned about its upright axis [rad]; others are not."""


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The things in the order of the clicks."""

    order: tuple[str, ...]


def clickable(rng: np.random.Generator, asset: str) -> dict[str, int]:
    """Parameters of one of the variants of `asset` that click tasks use, each equally likely."""
    return table.draw_variant(rng, asset, VARIANTS.get(asset))


def laid_out(
    rng: np.random.Generator,
    workcell: Workcell,
    area: places.Area,
    middle: float,
    distance: float,
    items: Sequence[tuple[str, Params]],
    turns: Mapping[str, float] = TURNS,
) -> list[tuple[places.Point, float]]:
    """A free place [m] and a turn [rad] for each item, seen whole by the head camera.

    Off the middle line by `middle` [m], pairwise at least `distance` [m] apart, and not touching;
    `turns` says how far either way an asset may be turned. No item has the first choice.
    """
    order = [int(i) for i in rng.permutation(len(items))]
    models = [objects.object_model(*items[i]) for i in order]
    narrow = np.array([[min(outline(*items[i]).reach)] for i in order])
    height = np.array([[m.size[2]] for m in models])
    propose = places.candidates(workcell, area, (len(items), TRIES), narrow, height, middle)

    def lying() -> tuple[places.Points, list[Turnable]]:
        found = places.scatter(rng, propose, distance)
        return found, [
            Turnable(*items[i], point, turns.get(items[i][0], 0.0))
            for i, point in zip(order, found, strict=True)
        ]

    found, _, yaws = turned(rng, workcell, lying)
    placed = dict(zip(order, zip(found, yaws, strict=True), strict=True))
    return [placed[i] for i in range(len(items))]


def clicks(scene: Scene, order: Sequence[str]) -> tuple[Skill, ...]:
    """A press each, by the arm on the object's side."""
    return tuple(Press(name, arm=table.side_of(scene, name)) for name in order)


def in_order(scene: Scene, order: Sequence[str], standing: bool) -> ClickInOrder:
    """The goal of clicks in `order`; see ClickInOrder for `standing`."""
    return ClickInOrder(
        [table.presses(scene, name, closed=True) for name in order], standing=standing
    )


def plan(scene: Scene) -> tuple[Skill, ...]:
    return clicks(scene, Facts.of(scene).order)


ORDER = ("alarm_clock", "stapler", "can", "playing_cards", "bread")
AREA, MIDDLE, DISTANCE = places.Area((-0.25, 0.25), (-0.20, 0.0)), 0.05, 0.14


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    things = [(asset, clickable(rng, asset)) for asset in ORDER[:level]]
    places = laid_out(rng, workcell, AREA, MIDDLE, DISTANCE, things)
    items = [
        table.Item("order", asset, standing(*place), variant, fixed=True)
        for (asset, variant), place in zip(things, places, strict=True)
    ]
    return table.sample(rng, items, Facts)


def slots(scene: Scene) -> Slots:
    order = [scene.object(name) for name in Facts.of(scene).order]
    arm = acting_arm(table.side_of(scene, order[0].name))
    if len(order) == 1:
        return TEXT.slots(f"thing.{order[0].asset}") | arm
    nouns = [TEXT.phrasings(f"thing.{item.asset}") for item in order]
    return TEXT.slots() | {"order": one_after_another(nouns)} | arm


OBJECTS = Task(
    name="Click_Objects_Order",
    category="OCE",
    levels=table.LEVELS,
    draw=draw,
    # one that is touched when its turn comes is clicked (official)
    goal=lambda scene: in_order(scene, Facts.of(scene).order, standing=True),
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Click the objects in the given order.",
    success=(
        "The alarm clock, the stapler, the can, the playing cards and the bread (as many as there "
        "are) were clicked in this order, the gripper on their side being closed."
    ),
)

X, Y = (-0.255, 0.255), (-0.225, 0.055)
APART = {1: 0.0, 2: 0.12, 3: 0.080, 4: 0.085, 5: 0.085}
"""Least distance [m] between bells."""
BASE = {3: (0.09, 0.14), 4: (0.09, 0.14), 5: (0.088, 0.138)}
"""Range of the ring's radius [m]."""
LEAD, TURN, LAYOUTS = 0.012, 0.12, 400
"""The first bell is this much farther [m]; angles between bells are at least this [rad]."""


def _draw_bells(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """The ring of bells, all of one variant, shifted to a random place of the region."""
    params = clickable(rng, "bell")
    points = _ring(level, rng, table.in_view(workcell, "bell", params))
    items = [table.thing("order", "bell", point, params, fixed=True) for point in points]
    return table.sample(rng, items, Facts)


def _ring(
    level: int, rng: np.random.Generator, seen: Callable[[places.Point], bool]
) -> list[places.Point]:
    """Places [m] in clicking order, all of which are `seen`."""
    for _ in range(LAYOUTS):
        ring = _pair(rng) if level == 2 else _round(level, rng) if level > 2 else [(0.0, 0.0)]
        if _regular(ring, APART[level]):
            shift = [
                rng.uniform(low - min(p[k] for p in ring), high - max(p[k] for p in ring))
                for k, (low, high) in enumerate((X, Y))
            ]
            ring = [(x + shift[0], y + shift[1]) for x, y in ring]
            if all(seen(point) for point in ring):
                return ring
    raise places.LayoutError(f"no ring of {level} bells in {LAYOUTS} draws; skip this seed")


def _pair(rng: np.random.Generator) -> list[places.Point]:
    base = rng.uniform(0.10, 0.15)
    return [(rng.uniform(-0.015, 0.015), way * base * rng.uniform(0.92, 1.10)) for way in (1, -1)]


def _round(level: int, rng: np.random.Generator) -> list[places.Point]:
    base = rng.uniform(*BASE[level])
    wide, deep = rng.uniform(0.80, 1.18), rng.uniform(0.80, 1.14)
    ring = []
    for i in range(level):
        angle = math.pi / 2 - 2 * math.pi * i / level
        angle += float(rng.uniform(-0.05, 0.05) if i == 0 else rng.uniform(-0.22, 0.22))
        radius = base * rng.uniform(0.85, 1.18)
        dx, dy = (float(v) for v in rng.uniform(-0.012, 0.012, 2))
        ring.append((wide * radius * math.cos(angle) + dx, deep * radius * math.sin(angle) + dy))
    return ring


def _regular(ring: list[places.Point], distance: float) -> bool:
    """Whether bells are apart, it fits the region, and nobody can doubt the order."""
    if not all(places.apart(p, ring[:i], distance) for i, p in enumerate(ring)):
        return False
    for k, (low, high) in enumerate((X, Y)):
        if max(p[k] for p in ring) - min(p[k] for p in ring) > high - low:
            return False
    if any(y > ring[0][1] - LEAD for _, y in ring[1:]):
        return False
    middle = [sum(p[k] for p in ring) / len(ring) for k in (0, 1)]
    angles = [math.atan2(x - middle[0], y - middle[1]) for x, y in ring]
    turns = [(a - angles[0]) % (2 * math.pi) for a in angles[1:]]
    steps = [b - a for a, b in zip([0.0, *turns], [*turns, 2 * math.pi], strict=True)]
    return len(ring) < 3 or min(steps) > TURN


def _bell_slots(scene: Scene) -> Slots:
    """Phrasings for the bells and their order, and the arm on the side of the first."""
    order = Facts.of(scene).order
    count = len(order)
    if count == 1:
        phrases = TEXT.slots("thing.bell")
    elif count == 2:
        pair = BELLS_TEXT.phrasings("far"), BELLS_TEXT.phrasings("near")
        phrases = BELLS_TEXT.slots() | {"order": one_after_another(pair)}
    else:
        phrases = BELLS_TEXT.slots("bells", "way", count=count, word=NUMBERS[count])
    return phrases | acting_arm(table.side_of(scene, order[0]))


BELLS = Task(
    name="Click_Bell_Clockwise_Order",
    category="OCE",
    levels=table.LEVELS,
    draw=_draw_bells,
    goal=lambda scene: in_order(scene, Facts.of(scene).order, standing=False),
    plan=plan,
    templates=lambda level: (TEXT if level < 3 else BELLS_TEXT).templates(level),
    slots=_bell_slots,
    summary="Click the bells clockwise, beginning with the one farthest from the robot.",
    success=(
        "All bells were clicked in clockwise order as seen from above, the farthest first, the "
        "gripper on their side being closed."
    ),
)

HAMMER_HALF, HAMMER_YAW, HAMMER_DISTANCE = 0.025, 0.5, 0.12
HAMMER_AT: places.Point = (0.0, -0.06)
HAMMER_AREA, HAMMER_MIDDLE = places.Area((-0.25, 0.25), (-0.25, 0.25)), 0.05
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
        x, y = HAMMER_AREA.draw(generator, (level, TRIES))
        inward = -x if left else x  # the first arm's side is positive
        usable = (np.abs(x) >= HAMMER_MIDDLE) & (inward >= -ACROSS) & _beside_hammer(x, y)
        usable[0] &= inward[0] > 0
        reach = np.hypot(x - arm.base[0], y - arm.base[1])
        usable &= (reach >= nearest) & (reach <= farthest)
        return (
            x,
            y,
            usable
            & workcell.in_view(x, y, HAMMER_HALF * math.sqrt(2), 2 * HAMMER_HALF, (0.0, 0.0)),
        )

    first, *others = places.scatter(rng, propose, HAMMER_DISTANCE)
    points = [first, *places.shuffled(rng, others)]
    items = [table.thing("hammer", "hammer", HAMMER_AT, table.draw_variant(rng, "hammer"))]
    for rgb, point in zip(table.ORDERED.values(), points, strict=False):
        yaw = rng.uniform(-HAMMER_YAW, HAMMER_YAW)
        items.append(table.block("order", point, HAMMER_HALF, rgb, yaw, fixed=True))
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

PAD_COLORS = (*LOOK_ALIKES, *((w,) for w in PADS if not any(w in some for some in LOOK_ALIKES)))
"""The official colours in groups of look-alikes: a scene has at most one of each group."""
PAD_ROWS = {
    2: ((0.14, 0.25), (-0.05, 0.06)),
    3: ((0.15, 0.25), (-0.05, 0.05), (-0.25, -0.15)),
    4: ((0.17, 0.25), (0.05, 0.10), (-0.10, -0.05), (-0.25, -0.17)),
    5: ((0.20, 0.25), (0.10, 0.13), (-0.02, 0.00), (-0.13, -0.10), (-0.25, -0.20)),
}
"""Ranges of the pads' x [m] from right to left."""
PADS_Y, SEAL_X, SEAL_Y, SEAL_APART = (-0.18, 0.08), (0.0, 0.25), (-0.15, 0.05), 0.12
ONE_X, ONE_Y, ONE_APART = (0.05, 0.25), (-0.05, 0.05), 0.10
PADS_APART = 0.08
"""Least distance [m] of neighbouring pads' middles: they are 0.07 wide."""
SEAL_LAYOUTS = 60


@dataclass(frozen=True)
class SealFacts(SceneFacts):
    """The seal, and the pads with their colours from right to left."""

    seal: str
    colors: tuple[str, ...]
    order: tuple[str, ...]


def _draw_seal(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    groups = [PAD_COLORS[int(i)] for i in rng.permutation(len(PAD_COLORS))[:level]]
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
    for _ in range(SEAL_LAYOUTS):
        if level == 1:
            way = 1 if rng.random() < 0.5 else -1
            found = (rng.uniform(*ONE_X), rng.uniform(*ONE_Y))
            pads = [(way * found[0], found[1])]
            x = (ONE_X[0], ONE_X[1]) if way > 0 else (-ONE_X[1], -ONE_X[0])
            seal = places.tried_point(rng, x, ONE_Y, [(p, ONE_APART) for p in pads], 100)
        else:
            y = rng.uniform(*PADS_Y)
            pads = [(rng.uniform(*span), y) for span in PAD_ROWS[level]]
            if any(a[0] - b[0] < PADS_APART for a, b in pairwise(pads)):
                continue
            seal = places.tried_point(rng, SEAL_X, SEAL_Y, [(p, SEAL_APART) for p in pads], 40)
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
