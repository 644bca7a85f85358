"""Place_Phone_Press_Stapler and Stamp_Seals_Press_Stapler: something else first, then the stapler.

Phone: a phone and a fixed stand on the right, from level 2 on a fixed stapler, at level 5 a small
bin with a ball in it on the left and the bin on the floor; the table stands 0.3 m farther right.

Seals: a seal and its pad on the left, from level 3 on another pair on the right, at level 5 a fixed
stapler in the middle.
"""

import math
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Pose
from robospa.tasks.families.chain import ActionChain, Region, Station, placed, pressing_arm
from robospa.tasks.families.dustbin import BIN, TABLE_SHIFT, container
from robospa.tasks.families.table import Item, draw_variant, frame_of, presses, radius, thing
from robospa.tasks.goals.conditions import Inside, Near, Rests
from robospa.tasks.goals.counters import StampCounter, inside_box
from robospa.tasks.instructions import Slots, TaskText, times
from robospa.tasks.plan import Dock, Home, Pour, Press, Stamp
from robospa.tasks.sampling.places import Point, free_point, tried_point
from robospa.tasks.sampling.turns import Turnable
from robospa.tasks.scene import Scene
from robospa.tasks.task import SceneFacts
from robospa.workcell import Workcell

PHONE_TEXT = TaskText.beside(__file__, "chain_stapler_phone.toml")
SEALS_TEXT = TaskText.beside(__file__, "chain_stapler_seals.toml")

PRESSES = {1: 0, 2: 1, 3: 2, 4: 3, 5: 3}
DUMP_LEVEL = 5
"""The level at which the small bin has to be emptied."""
REGIONS: dict[str, Region] = {
    "phone": ((0.05, 0.25), (-0.2, 0.0), 0.7),
    "phone_stand": ((0.0, 0.15), (0.0, 0.2), 0.0),
    "stapler": ((0.0, 0.2), (-0.2, -0.05), math.pi),
    "table_trash_bin": ((-0.2, -0.07), (-0.2, 0.0), math.pi / 8.5),
}
PHONE_DISTANCE = 0.15
"""Least distance [m] from phone to stand."""
VARIANTS = {"phone_stand": (0, 1)}
"""Variants that are used, where not all: the official models."""
GAP = 0.01
"""Free space [m] between footprints."""
BOX = (0.045, 0.04, 0.04)
"""Half sizes [m] of the box around the stand's place in which the phone's lower end counts."""
GARBAGE_XY, GARBAGE_Z = 0.01, 0.78
"""How far off the small bin's axis the ball starts, and how high [m]."""


@dataclass(frozen=True)
class PhoneFacts(SceneFacts):
    """Things by their role; those of later levels may be missing."""

    phone: str
    phone_stand: str
    stapler: str = ""
    table_trash_bin: str = ""
    garbage: str = ""
    dustbin: str = ""


def _phone_items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[Item]:
    items: list[Item] = []
    taken: list[tuple[Turnable, float]] = []
    wanted = ["phone", "phone_stand", *(["stapler"] if PRESSES[level] else [])]
    for asset in (*wanted, *(["table_trash_bin"] if level == DUMP_LEVEL else [])):
        variant = draw_variant(rng, asset, VARIANTS.get(asset))
        least = PHONE_DISTANCE if asset == "phone_stand" else 0.0
        others = [(thing, turn, least) for thing, turn in taken]
        taken.append(placed(rng, workcell, (asset, variant), REGIONS[asset], others, GAP))
        (item, turn), fixed = taken[-1], asset in ("phone_stand", "stapler")
        items.append(thing(asset, asset, item.place, variant, turn, fixed))
    if level == DUMP_LEVEL:
        dx, dy = (rng.uniform(-GARBAGE_XY, GARBAGE_XY) for _ in range(2))
        bin_x, bin_y = taken[-1][0].place
        start = Pose((bin_x + dx, bin_y + dy, GARBAGE_Z))
        items.append(Item("garbage", "garbage", start, {"look": 0}))
        items.append(Item("dustbin", "dustbin", BIN, {"look": 0}, fixed=True))
    return items


def _within(box: tuple[float, float, float], own: Pose, frame: Pose) -> Near:

    def near(pose: Pose, target: Pose) -> bool:
        return inside_box(pose.apply(own.position), target.apply(frame.position), box)

    return near


def _phone_station(scene: Scene, step: str) -> Station:
    """The right arm docks the phone and presses, the left one empties the small bin."""
    facts = PhoneFacts.of(scene)
    if step == "d":
        phone, stand = facts.phone, facts.phone_stand
        near = _within(BOX, frame_of(scene, phone, "end"), frame_of(scene, stand, "end"))
        rests = Rests(phone, near, targets=(stand,))
        return Station(rests, (Dock(phone, on=stand, arm="right"),))
    if step == "s":
        return Station(presses(scene, facts.stapler), (Press(facts.stapler, arm="right"),))
    small, dustbin = facts.table_trash_bin, facts.dustbin
    inside = Inside(facts.garbage, container(scene.object(dustbin)), targets=(dustbin,))
    return Station(inside, (Home("right"), Pour(small, into=dustbin, arm="left")), tool=small)


def _phone_slots(scene: Scene) -> Slots:
    phrases = PHONE_TEXT.slots("phone", "stand")
    if PRESSES[scene.level]:
        phrases |= PHONE_TEXT.slots("stapler") | {"times": times(PRESSES[scene.level])}
    return phrases | (PHONE_TEXT.slots("bin", "dustbin") if scene.level == DUMP_LEVEL else {})


PHONE = ActionChain(
    "Place_Phone_Press_Stapler",
    # d the phone onto its stand, s the stapler, b the small bin emptied; only presses latch
    steps={n: "d" + "s" * count + "b" * (n == DUMP_LEVEL) for n, count in PRESSES.items()},
    limits={1: 400, 2: 600, 3: 800, 4: 1000, 5: 1300},
    facts=PhoneFacts,
    items=_phone_items,
    station=_phone_station,
    table_shift=TABLE_SHIFT,
).task(
    PHONE_TEXT.templates,
    _phone_slots,
    summary="Put the phone on its stand, press the stapler, empty the small bin.",
    success=(
        "The phone was let go on the stand and is there, the stapler was pressed as often as "
        "asked, and the ball lies inside the bin on the floor (as far as the level asks)."
    ),
)

SEALS_STEPS = {1: "l", 2: "ll", 3: "llr", 4: "llrr", 5: "llrrs"}
"""What is asked for: l a stamp with the left seal, r one with the right seal, s the stapler."""
SIDES = {"l": "left", "r": "right"}
X = {"left": (-0.25, -0.12), "right": (0.10, 0.22)}
Y = {1: (-0.05, 0.05), 2: (-0.05, 0.05), 3: (-0.15, 0.05), 4: (-0.15, 0.05), 5: (-0.15, 0.05)}
PAD_FAR_Y = 0.1
"""A pad that does not fit near its seal may lie up to here."""
DISTANCE = 0.1
STAPLER_X, STAPLER_Y = (-0.03, 0.04), (-0.15, 0.05)


@dataclass(frozen=True)
class SealsFacts(SceneFacts):
    """Seals and pads by side, and the stapler; those of later levels may be missing."""

    left_seal: str
    left_pad: str
    right_seal: str = ""
    right_pad: str = ""
    stapler: str = ""


def _seals_items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[Item]:
    items: list[Item] = []
    taken: list[tuple[Point, float]] = []
    for at in ("left", "right")[: 1 + ("r" in SEALS_STEPS[level])]:
        x, y = X[at], Y[level]
        seal = free_point(rng, x, y)
        near = [(seal, DISTANCE)]
        pad = tried_point(rng, x, y, near, 1) or free_point(rng, x, (y[0], PAD_FAR_Y), near)
        variant = draw_variant(rng, "seal")
        items.append(thing(f"{at}_seal", "seal", seal, variant))
        color = draw_variant(rng, "pad")
        items.append(thing(f"{at}_pad", "pad", pad, color, fixed=True))
        taken += [(seal, radius("seal", variant)), (pad, radius("pad", color))]
    if "s" in SEALS_STEPS[level]:
        variant = draw_variant(rng, "stapler")
        room = radius("stapler", variant) + GAP
        spot = free_point(rng, STAPLER_X, STAPLER_Y, [(p, r + room) for p, r in taken])
        turn = rng.uniform(-math.pi, math.pi)
        items.append(thing("stapler", "stapler", spot, variant, turn, fixed=True))
    return items


def _seals_station(scene: Scene, step: str) -> Station:
    facts = SealsFacts.of(scene)
    if step == "s":
        press = Press(facts.stapler, arm=pressing_arm(scene, facts.stapler))
        return Station(presses(scene, facts.stapler), (press,))
    left = step == "l"
    seal, pad = (facts.left_seal, facts.left_pad) if left else (facts.right_seal, facts.right_pad)
    stamp = Stamp(seal, on=pad, times=SEALS_STEPS[scene.level].count(step), arm=SIDES[step])
    return Station(StampCounter(seal, pad), (stamp,), at_once=True)


def _seals_slots(scene: Scene) -> Slots:
    level = scene.level
    if level < 3:
        return SEALS_TEXT.slots("seal", "pad") | {"times": times(level)}
    phrases = SEALS_TEXT.slots(*(("stapler",) if level == 5 else ()))
    phrases |= {"left_times": times(2), "right_times": times(1 if level == 3 else 2)}
    for at in ("left", "right"):
        phrases[f"{at}_seal"] = SEALS_TEXT.phrasings("side_seal", side=at)
        phrases[f"{at}_pad"] = SEALS_TEXT.phrasings("side_pad", side=at)
    return phrases


SEALS = ActionChain(
    "Stamp_Seals_Press_Stapler",
    SEALS_STEPS,
    limits={n: 200 * n for n in range(1, 6)},
    facts=SealsFacts,
    items=_seals_items,
    station=_seals_station,
).task(
    SEALS_TEXT.templates,
    _seals_slots,
    summary="Stamp the pads with the seals as often as asked, then press the stapler.",
    success=(
        "Each seal came down within 1 cm of its pad as often as asked, raised or moved away by "
        "2 cm in between, and the stapler was pressed (as far as the level asks)."
    ),
)
