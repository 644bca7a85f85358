"""Click_Can_Place_Items and Click_Bell_Open_Microwave_Place_Object: clicks with deeds in between.

Can: a fixed can on the left, a fixed bread basket with bread on the right (from level 2), a pill
bottle and a blue pad on the left (from level 4).

Microwave: a fixed bell on the left, from level 2 on a fixed microwave behind it, from level 4 on
two small things of different kinds; a click counts while the left gripper is closed.
"""

import math
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Pose
from robospa.tasks import objects
from robospa.tasks.colors import NAMED
from robospa.tasks.families import table
from robospa.tasks.families.chain import ActionChain, Station, click
from robospa.tasks.goals.conditions import Opened, Rests, level_with
from robospa.tasks.instructions import Slots, TaskText
from robospa.tasks.plan import Home, Open, Pick, Place, Press
from robospa.tasks.sampling.places import NoRoom, Point, Range, free_point, tried_point
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Hinge, Params
from robospa.tasks.task import SceneFacts
from robospa.workcell import Workcell

CAN_TEXT = TaskText.beside(__file__, "chain_clicks_can.toml")
TEXT = TaskText.beside(__file__, "chain_clicks_microwave.toml")

CAN_X, CAN_FIRST_Y, CAN_Y = (-0.25, -0.05), (-0.2, -0.15), (-0.2, 0.1)
BASKET = (0.10, -0.2)
BREAD_X, BREAD_Y, BREAD_YAW = (0.15, 0.27), (-0.10, 0.05), math.pi / 4
BOTTLE_X, PAD_X, LEFT_Y = (-0.25, -0.10), (-0.25, -0.05), (-0.1, 0.1)
PAD_HALF = (0.04, 0.04, 0.0005)
BOTTLE_GRIP = (0.0, 0.0, 0.125)
"""Where the pill bottle is held [m, its frame]."""
HELD_WITHIN = 0.18
"""How far [m] the grasp centre is from the origin of a held bottle at most."""
GAP = 0.005
"""Free space [m] between the footprints of things that must not touch."""


@dataclass(frozen=True)
class CanFacts(SceneFacts):
    """Things by their role; those of later levels may be missing."""

    can: str
    basket: str = ""
    bread: str = ""
    pill_bottle: str = ""
    pad: str = ""


def _can_items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[table.Item]:
    can = table.draw_variant(rng, "can")
    items: list[table.Item] = []
    far: list[tuple[Point, float]] = []  # what the can must keep away from, and how far [m]
    if level >= 2:
        basket, bread = table.draw_variant(rng, "bread_basket"), table.draw_variant(rng, "bread")
        between = max(
            0.1, table.radius("bread_basket", basket) + table.radius("bread", bread) + GAP
        )
        at = free_point(rng, BREAD_X, BREAD_Y, [(BASKET, between)])
        turn = rng.uniform(-math.pi, math.pi)
        items.append(table.thing("basket", "bread_basket", BASKET, basket, turn, fixed=True))
        turn = rng.uniform(-BREAD_YAW, BREAD_YAW)
        items.append(table.thing("bread", "bread", at, bread, turn))
        far += [(BASKET, 0.18), (at, 0.18)]
    if level >= 4:
        variant = table.draw_variant(rng, "pill_bottle")
        bottle = free_point(rng, BOTTLE_X, LEFT_Y)
        pad = free_point(rng, PAD_X, LEFT_Y, [(bottle, 0.1)])
        square = {"half": list(PAD_HALF), "color": list(NAMED["blue"])}
        items.append(table.thing("pill_bottle", "pill_bottle", bottle, variant))
        items.append(table.thing("pad", "block", pad, square, fixed=True, height=PAD_HALF[2]))
        far += [(bottle, 0.1), (pad, 0.1)]
    first_y = CAN_FIRST_Y if level >= 2 else CAN_Y
    place = tried_point(rng, CAN_X, first_y, far, 1) or free_point(rng, CAN_X, CAN_Y, far)
    return [*items, table.thing("can", "can", place, can, fixed=True)]


def _can_station(scene: Scene, step: str) -> Station:
    facts, top = CanFacts.of(scene), scene.table_top
    if step == "c":
        return Station(table.presses(scene, facts.can), (Press(facts.can, arm="left"),))
    if step == "b":
        name, basket = facts.bread, facts.basket
        rim = top + objects.model_of(scene.object(basket)).size[2]
        return Station(
            Rests(name, level_with(0.05, top - 0.01, rim + 0.01), targets=(basket,)),
            (Pick(name, arm="right"), Place(name, on=basket, drop=0.02, arm="right")),
        )
    name, near = facts.pill_bottle, level_with(0.03, top - 0.004, top + 0.006)
    return Station(
        Rests(name, near, grip=BOTTLE_GRIP, targets=(facts.pad,)),
        (Pick(name, lift=0.08, arm="left"), Place(name, on=facts.pad, arm="left")),
    )


def _can_slots(scene: Scene) -> Slots:
    things = ("can", "bread", "basket", "bottle", "pad")
    return CAN_TEXT.slots(*things[: {1: 1, 2: 3, 3: 3}.get(scene.level, 5)])


CAN = ActionChain(
    "Click_Can_Place_Items",
    # c a click, b the bread into the basket, p the pill bottle onto the pad
    steps={1: "c", 2: "cb", 3: "cbc", 4: "cbcp", 5: "cbcpc"},
    limits={n: 200 * n for n in range(1, 6)},
    facts=CanFacts,
    items=_can_items,
    station=_can_station,
    released=(2, 4),  # official: the levels that end with something put down
    radius=HELD_WITHIN,
    end=(Home(),),
).task(
    CAN_TEXT.templates,
    _can_slots,
    summary="Click the can, put the bread into the basket and the pill bottle onto the blue pad.",
    success=(
        "The can was clicked as often as asked, the bread lies in the basket, the pill bottle "
        "stands on the pad (as far as the level asks), and at levels 2 and 4 both grippers are "
        "open."
    ),
)

OPEN = 0.6
"""Share of the door's limit from which it counts as open; the expert aims for 0.7."""
NEAR, FAR, LEVEL_WITH = 0.08, 0.20, 0.05
"""Distance [m] of the two things' origins, and most difference of their y."""
BELL_X, BELL_Y = (-0.25, -0.15), (-0.20, -0.15)
MICROWAVE_X, MICROWAVE_Y = (-0.12, -0.02), (0.15, 0.20)
THINGS = (
    "mouse", "stapler", "toycar", "rubikscube", "bread", "phone", "playing_cards", "tea_box",
    "coffee_box", "soap", "wooden_block",
)  # fmt: skip
WEST_X, EAST_X, THING_Y = (0.0, 0.25), (0.18, 0.23), (-0.2, 0.0)
"""Where the things lie, the one farther left and the one farther right."""
ROWS, BETWEEN, OVEN_ROOM = 0.1, 0.19, 0.18
"""Least difference in y, least distance, distance from the microwave's origin [m] (official)."""
SHIFT = 0.12
"""The expert puts the thing this far to the left of the other [m]."""
SHIFTED = np.array([SHIFT, 0.0])
PAIRS = 256
"""Places that are looked at for a pair of things before everything is drawn anew."""
SWING = 0.185
"""What the opening door sweeps: a disc around its hinge [m]."""
ELBOW = 0.04
"""Free space [m] around the bell."""


@dataclass(frozen=True)
class MicrowaveFacts(SceneFacts):
    """Bell, microwave, the thing to be moved and the one that stays; "" where there is none."""

    bell: str
    microwave: str = ""
    object: str = ""
    reference: str = ""


def _items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[table.Item]:
    bell, variant = _point(rng, BELL_X, BELL_Y), table.draw_variant(rng, "bell")
    items = [table.thing("bell", "bell", bell, variant, fixed=True)]
    if level >= 2:
        oven, finish = _point(rng, MICROWAVE_X, MICROWAVE_Y), table.draw_variant(rng, "microwave")
        items.append(table.thing("microwave", "microwave", oven, finish, fixed=True))
        if level >= 4:
            axis = _door(finish).point
            hinge = (oven[0] + axis[0], oven[1] + axis[1])
            far = [(bell, table.radius("bell", variant) + ELBOW), (hinge, SWING)]
            items += _things(rng, workcell, far, oven)
    return items


def _point(rng: np.random.Generator, x: Range, y: Range) -> Point:
    return (rng.uniform(*x), rng.uniform(*y))


def _things(
    rng: np.random.Generator, workcell: Workcell, far: list[tuple[Point, float]], oven: Point
) -> list[table.Item]:
    """Two things, either of which has room to the left of the other.

    Which of the two is to be moved is a toss, so that the scene does not tell.
    """
    kinds = [THINGS[int(i)] for i in rng.choice(len(THINGS), 2, replace=False)]
    variants = [table.draw_variant(rng, kind) for kind in kinds]
    sizes = [table.radius(kind, variant) for kind, variant in zip(kinds, variants, strict=True)]
    west, east = (
        np.stack([rng.uniform(*x, PAIRS), rng.uniform(*THING_Y, PAIRS)], axis=1)
        for x in (WEST_X, EAST_X)
    )
    fits = (east[:, 0] > west[:, 0]) & (np.abs(east[:, 1] - west[:, 1]) >= ROWS)
    fits &= np.hypot(*(east - west).T) > BETWEEN
    # where they are, and where each goes if it is the one to be moved
    for at, size in zip((west, east, east - SHIFTED, west - SHIFTED), sizes * 2, strict=True):
        fits &= np.hypot(*(at - oven).T) > OVEN_ROOM
        for point, room in far:
            fits &= np.hypot(*(at - point).T) >= room + size
        fits &= workcell.in_view(at[:, 0], at[:, 1], size, 0.0, (0.0, 0.0))
    if not fits.any():
        raise NoRoom("no free places of two things")
    first = int(np.argmax(fits))
    roles = ("object", "reference") if rng.random() < 0.5 else ("reference", "object")
    return [
        table.thing(role, kind, (x, y), variant, rng.uniform(-math.pi, math.pi))
        for role, kind, variant, (x, y) in zip(
            roles, kinds, variants, (west[first].tolist(), east[first].tolist()), strict=True
        )
    ]


def _door(params: Params) -> Hinge:
    door = objects.object_model("microwave", params).hinge
    assert door is not None
    return door


def beside(pose: Pose, other: Pose) -> bool:
    """Whether a thing lies to the left of the other one, and how far is right."""
    dx, dy = (other.position[i] - pose.position[i] for i in (0, 1))
    return dx > 0 and NEAR < math.hypot(dx, dy) < FAR and abs(dy) < LEVEL_WITH


def _station(scene: Scene, step: str) -> Station:
    facts = MicrowaveFacts.of(scene)
    if step == "c":
        return click(scene, facts.bell)
    if step == "o":
        opened = Opened(facts.microwave, OPEN * _door({}).upper)
        return Station(opened, (Open(facts.microwave, arm="left"),))
    name, arm = facts.object, table.side_of(scene, facts.object)
    x, y, _ = scene.object(facts.reference).pose.position
    to = (x - SHIFT, y, scene.table_top - objects.model_of(scene.object(name)).bottom)
    near = Rests(name, beside, targets=(facts.reference,))
    return Station(near, (Pick(name, arm=arm), Place(name, to, arm=arm)))


def _slots(scene: Scene) -> Slots:
    facts = MicrowaveFacts.of(scene)
    phrases = TEXT.slots("arm", "bell", *(("microwave",) if scene.level >= 2 else ()))
    for role in ("object", "reference") if facts.object else ():
        thing = scene.object(getattr(facts, role))
        train, held = table.variant_phrasings(objects.model_of(thing))
        phrases[role] = tuple(f"the {p}" for p in train), tuple(f"the {p}" for p in held)
    return phrases


MICROWAVE = ActionChain(
    "Click_Bell_Open_Microwave_Place_Object",
    # c a click, o the microwave opened, p one thing placed left of another
    steps={1: "c", 2: "co", 3: "coc", 4: "cocp", 5: "cocpc"},
    limits={1: 200, 2: 1000, 3: 1200, 4: 1400, 5: 1600},
    facts=MicrowaveFacts,
    items=_items,
    station=_station,
    released=(4,),  # official: a click alone ends with a closed gripper
).task(
    TEXT.templates,
    _slots,
    summary="Click the bell, open the microwave, and put one thing to the left of another.",
    success=(
        "The bell was clicked with the left gripper closed as often as asked, the door is open to "
        "0.6 of its limit, the thing lies 8 to 20 cm to the left of the other one, their y less "
        "than 5 cm apart (as far as the level asks), and at level 4 both grippers are open."
    ),
)
