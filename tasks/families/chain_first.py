"""One thing first, then the stapler or blocks.

Place_Phone_Press_Stapler: a phone and a fixed stand on the right, from level 2 on a fixed stapler,
at level 5 a small bin with a ball in it on the left and the bin on the floor; the table stands
0.3 m farther right.

Stamp_Seals_Press_Stapler: a seal and its pad on the left, from level 3 on another pair on the
right, at level 5 a fixed stapler in the middle.

Hang_Mug_Stack_Blocks: a mug and a fixed rack on the right, from level 2 on red, green, blue and
yellow blocks (one more a level) on the left; nothing latches.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from robospa.geometry import Pose
from robospa.tasks.families import table
from robospa.tasks.families.chain import ActionChain, Region, Station, placed, pressing_arm
from robospa.tasks.families.dustbin import BIN, TABLE_SHIFT, container, reachable
from robospa.tasks.goals.conditions import Inside, Near, Rests
from robospa.tasks.goals.counters import StampCounter, inside_box
from robospa.tasks.instructions import Slots, TaskText, times
from robospa.tasks.plan import Dock, Hang, Home, Pick, Place, Pour, Press, Stamp
from robospa.tasks.sampling.places import NoRoom, Point, Range, free_point, tried_point
from robospa.tasks.sampling.turns import Turnable
from robospa.tasks.scene import Scene
from robospa.tasks.task import SceneFacts
from robospa.workcell import Workcell

PHONE_TEXT = TaskText.beside(__file__, "chain_stapler_phone.toml")
SEALS_TEXT = TaskText.beside(__file__, "chain_stapler_seals.toml")
MUG_TEXT = TaskText.beside(__file__, "chain_mug.toml")

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


def _phone_items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[table.Item]:
    items: list[table.Item] = []
    taken: list[tuple[Turnable, float]] = []
    wanted = ["phone", "phone_stand", *(["stapler"] if PRESSES[level] else [])]
    for asset in (*wanted, *(["table_trash_bin"] if level == DUMP_LEVEL else [])):
        variant = table.draw_variant(rng, asset, VARIANTS.get(asset))
        least = PHONE_DISTANCE if asset == "phone_stand" else 0.0
        others = [(thing, turn, least) for thing, turn in taken]
        taken.append(placed(rng, workcell, (asset, variant), REGIONS[asset], others, GAP))
        (item, turn), fixed = taken[-1], asset in ("phone_stand", "stapler")
        items.append(table.thing(asset, asset, item.place, variant, turn, fixed))
    if level == DUMP_LEVEL:
        dx, dy = (rng.uniform(-GARBAGE_XY, GARBAGE_XY) for _ in range(2))
        bin_x, bin_y = taken[-1][0].place
        start = Pose((bin_x + dx, bin_y + dy, GARBAGE_Z))
        items.append(table.Item("garbage", "garbage", start, {"look": 0}))
        items.append(table.Item("dustbin", "dustbin", BIN, {"look": 0}, fixed=True))
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
        near = _within(
            BOX, table.frame_of(scene, phone, "end"), table.frame_of(scene, stand, "end")
        )
        rests = Rests(phone, near, targets=(stand,))
        return Station(rests, (Dock(phone, on=stand, arm="right"),))
    if step == "s":
        return Station(table.presses(scene, facts.stapler), (Press(facts.stapler, arm="right"),))
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


def _seals_items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[table.Item]:
    items: list[table.Item] = []
    taken: list[tuple[Point, float]] = []
    for at in ("left", "right")[: 1 + ("r" in SEALS_STEPS[level])]:
        x, y = X[at], Y[level]
        seal = free_point(rng, x, y)
        near = [(seal, DISTANCE)]
        pad = tried_point(rng, x, y, near, 1) or free_point(rng, x, (y[0], PAD_FAR_Y), near)
        variant = table.draw_variant(rng, "seal")
        items.append(table.thing(f"{at}_seal", "seal", seal, variant))
        color = table.draw_variant(rng, "pad")
        items.append(table.thing(f"{at}_pad", "pad", pad, color, fixed=True))
        taken += [(seal, table.radius("seal", variant)), (pad, table.radius("pad", color))]
    if "s" in SEALS_STEPS[level]:
        variant = table.draw_variant(rng, "stapler")
        room = table.radius("stapler", variant) + GAP
        spot = free_point(rng, STAPLER_X, STAPLER_Y, [(p, r + room) for p, r in taken])
        turn = rng.uniform(-math.pi, math.pi)
        items.append(table.thing("stapler", "stapler", spot, variant, turn, fixed=True))
    return items


def _seals_station(scene: Scene, step: str) -> Station:
    facts = SealsFacts.of(scene)
    if step == "s":
        press = Press(facts.stapler, arm=pressing_arm(scene, facts.stapler))
        return Station(table.presses(scene, facts.stapler), (press,))
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

COLORS = table.first_colors(4)
"""Bottom to top; level n has the first n - 1."""
LETTERS = dict(zip("rgby", COLORS, strict=True))
HALF = 0.015
MUG_X, MUG_Y, MUG_YAW = (0.05, 0.20), (-0.20, -0.05), 1.57
RACK_X, RACK_Y, RACK_YAW = (0.10, 0.30), (0.13, 0.17), 0.2
RACK_TURN = -0.935
"""The peg points towards the robot's left (official); the yaw is added to it [rad]."""
RACK_SEEN = (0.116, 0.055)
"""Height and radius [m] of the part of the rack that has to be in view: foot and peg, not the head
of the post."""
BLOCK_X, BLOCK_YAW, BLOCKS_DISTANCE = (-0.28, -0.05), 0.75, 0.1
BLOCK_Y = {2: (0.0, 0.2), 3: (-0.2, 0.2), 4: (-0.2, 0.2), 5: (-0.2, 0.2)}
MIDDLE = 0.15
"""Nearer to the table's middle than this a block lies no farther away than y = 0."""
PLACE = (-0.16, -0.13)
"""Where the expert builds; no block starts within BLOCKS_DISTANCE of it."""
NEAR_LEFT = {2: (-0.05, -0.1), 3: (0.0, -0.05), 4: (0.0, -0.05), 5: (0.0, -0.05)}
"""The near left area: x and y below these [m]."""
LOW = 0.02  # [m] how much higher than on the table the red block may be
ON_PEG, HANGING = 0.02, 0.86
"""Offset [m] of the handle from the peg's place in x and in y, and its least height [m, world]
over a table at its usual height."""
MUG_GRIP = (0.0, 0.0, 0.08)
HELD_WITHIN = 0.16
"""How far [m] the grasp centre is from the origin of a held mug at most."""
STACKED = (0.015, 0.015, 0.007)
"""Allowed offset [m] in x, y, z of a block from straight on top of the one below."""
HELD_RADIUS = 0.03


@dataclass(frozen=True)
class MugFacts(SceneFacts):
    """Mug, rack, and as many blocks as the level has, by colour."""

    mug: str
    rack: str
    red: str = ""
    green: str = ""
    blue: str = ""
    yellow: str = ""


def _mug_items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[table.Item]:
    mug, rack = table.draw_variant(rng, "mug"), table.draw_variant(rng, "mug_rack")
    at = free_point(rng, MUG_X, MUG_Y, allowed=table.in_view(workcell, "mug", mug))
    stand = free_point(
        rng, RACK_X, RACK_Y, allowed=lambda point: table.point_in_view(workcell, point, *RACK_SEEN)
    )
    if math.dist(at, stand) < table.radius("mug", mug) + table.radius("mug_rack", rack):
        raise NoRoom("the mug is too near to the rack")
    turn = rng.uniform(-MUG_YAW, MUG_YAW)
    items = [table.thing("mug", "mug", at, mug, turn)]
    turn = RACK_TURN + rng.uniform(-RACK_YAW, RACK_YAW)
    items.append(table.thing("rack", "mug_rack", stand, rack, turn, fixed=True))
    points: list[Point] = [PLACE]
    for color in list(COLORS)[: level - 1]:
        points.append(_block_point(rng, workcell, BLOCK_Y[level], points))
        yaw = rng.uniform(-BLOCK_YAW, BLOCK_YAW)
        items.append(table.block(color, points[-1], HALF, COLORS[color], yaw))
    return items


def _block_point(
    rng: np.random.Generator, workcell: Workcell, y: Range, others: list[Point]
) -> Point:
    """A free place: off the far middle, where the official scenes draw another y."""
    far = [(other, BLOCKS_DISTANCE) for other in others]
    allowed = partial(reachable, workcell)
    point = free_point(rng, BLOCK_X, y, far, allowed=allowed)
    if abs(point[0]) >= MIDDLE or point[1] <= 0:
        return point
    return free_point(rng, (point[0], point[0]), (y[0], 0.0), far, 1, allowed)


def _hangs(handle: Pose, peg: Pose, above: float) -> Near:
    """The middle of the handle is at the peg's place, higher than `above` [m, world]."""

    def near(mug: Pose, rack: Pose) -> bool:
        x, y, z = mug.apply(handle.position)
        px, py, _ = rack.apply(peg.position)
        return abs(x - px) < ON_PEG and abs(y - py) < ON_PEG and z > above

    return near


def _in_area(level: int, table_top: float) -> Near:
    right, far = NEAR_LEFT[level]

    def near(pose: Pose, start: Pose) -> bool:
        x, y, z = pose.position
        return x < right and y < far and z < table_top + HALF + LOW

    return near


def _on_top(pose: Pose, below: Pose) -> bool:
    offsets = zip(pose.position, below.position, (0.0, 0.0, 2 * HALF), STACKED, strict=True)
    return all(abs(a - b - up) < most for a, b, up, most in offsets)


def _mug_station(scene: Scene, step: str) -> Station:
    facts = MugFacts.of(scene)
    if step == "m":
        handle, peg = (
            table.frame_of(scene, facts.mug, "handle"),
            table.frame_of(scene, facts.rack, "hang"),
        )
        near = _hangs(handle, peg, HANGING + scene.table_rise)
        hangs = Rests(facts.mug, near, grip=MUG_GRIP, targets=(facts.rack,))
        return Station(hangs, (Hang(facts.mug, on=facts.rack, arm="right"),))
    i = list(LETTERS).index(step)
    names = [getattr(facts, color) for color in COLORS]
    name = names[i]
    pick = Pick(name, lift=0.07 + 2 * HALF * i, arm="left")
    if i == 0:
        lies = Rests(name, _in_area(scene.level, scene.table_top), HELD_RADIUS)
        return Station(lies, (pick, Place(name, (*PLACE, scene.table_top + HALF), arm="left")))
    on_top = Rests(name, _on_top, HELD_RADIUS, targets=(names[i - 1],))
    return Station(on_top, (pick, Place(name, on=names[i - 1], arm="left")))


def _mug_slots(scene: Scene) -> Slots:
    colors = list(COLORS)[: scene.level - 1]
    blocks = {color: MUG_TEXT.phrasings("block", color=color) for color in colors}
    return MUG_TEXT.slots("mug", "rack", *(("area",) if colors else ())) | blocks


MUG = ActionChain(
    "Hang_Mug_Stack_Blocks",
    steps={n: "mrgby"[:n] for n in range(1, 6)},
    limits={n: 200 + 200 * n for n in range(1, 6)},
    facts=MugFacts,
    items=_mug_items,
    station=_mug_station,
    radius=HELD_WITHIN,
).task(
    MUG_TEXT.templates,
    _mug_slots,
    summary="Hang the mug on the rack, then stack the blocks in the near left area.",
    success=(
        "The mug hangs on the rack's peg, the red block lies in the near left area and the green, "
        "blue and yellow blocks straight on the one before (as far as the level asks), all let go."
    ),
)
