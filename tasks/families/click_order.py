"""Click_Objects_Order and Click_Bell_Clockwise_Order: clicks in a given order, grippers closed.

Objects: an alarm clock, a stapler, a can, playing cards and bread (the first k), fixed, anywhere in
front of the robot. Bells: k equal bells on a wobbly ring anywhere in the region; clockwise is as
seen from above, from the farthest one. Other click tasks share the counters and presses.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robospa.tasks import objects
from robospa.tasks.families import table
from robospa.tasks.families.table import standing
from robospa.tasks.goals.clicks import ClickInOrder
from robospa.tasks.instructions import NUMBERS, Slots, TaskText, acting_arm, one_after_another
from robospa.tasks.plan import Press, Skill
from robospa.tasks.sampling import places
from robospa.tasks.sampling.turns import Turnable, outline, turned
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Params
from robospa.tasks.task import SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "click_order.toml")
BELLS_TEXT = TaskText.beside(__file__, "click_order_bells.toml")

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
