"""Hang_Mug_Stack_Blocks: hang the mug on the rack, then stack coloured blocks near the left.

Draw: a mug and a fixed rack on the right, from level 2 on red, green, blue and yellow blocks (one
more a level) on the left. Success: the mug hangs on the rack's peg, the red block lies in the near
left area, every further block on the one before it; nothing latches.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from robospa.geometry import Pose
from robospa.tasks.families import table
from robospa.tasks.families.chain import ActionChain, Station
from robospa.tasks.families.dustbin import reachable
from robospa.tasks.goals.conditions import Near, Rests
from robospa.tasks.instructions import Slots, TaskText
from robospa.tasks.plan import Hang, Pick, Place
from robospa.tasks.sampling.places import NoRoom, Point, Range, free_point
from robospa.tasks.scene import Scene
from robospa.tasks.task import SceneFacts
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "chain_mug.toml")

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
BLOCK_X, BLOCK_YAW, DISTANCE = (-0.28, -0.05), 0.75, 0.1
BLOCK_Y = {2: (0.0, 0.2), 3: (-0.2, 0.2), 4: (-0.2, 0.2), 5: (-0.2, 0.2)}
MIDDLE = 0.15
"""Nearer to the table's middle than this a block lies no farther away than y = 0."""
PLACE = (-0.16, -0.13)
"""Where the expert builds; no block starts within DISTANCE of it."""
AREA = {2: (-0.05, -0.1), 3: (0.0, -0.05), 4: (0.0, -0.05), 5: (0.0, -0.05)}
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
class Facts(SceneFacts):
    """Mug, rack, and as many blocks as the level has, by colour."""

    mug: str
    rack: str
    red: str = ""
    green: str = ""
    blue: str = ""
    yellow: str = ""


def _items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[table.Item]:
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
    far = [(other, DISTANCE) for other in others]
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
    right, far = AREA[level]

    def near(pose: Pose, start: Pose) -> bool:
        x, y, z = pose.position
        return x < right and y < far and z < table_top + HALF + LOW

    return near


def _on_top(pose: Pose, below: Pose) -> bool:
    offsets = zip(pose.position, below.position, (0.0, 0.0, 2 * HALF), STACKED, strict=True)
    return all(abs(a - b - up) < most for a, b, up, most in offsets)


def _station(scene: Scene, step: str) -> Station:
    facts = Facts.of(scene)
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


def _slots(scene: Scene) -> Slots:
    colors = list(COLORS)[: scene.level - 1]
    blocks = {color: TEXT.phrasings("block", color=color) for color in colors}
    return TEXT.slots("mug", "rack", *(("area",) if colors else ())) | blocks


TASK = ActionChain(
    "Hang_Mug_Stack_Blocks",
    steps={n: "mrgby"[:n] for n in range(1, 6)},
    limits={n: 200 + 200 * n for n in range(1, 6)},
    facts=Facts,
    items=_items,
    station=_station,
    radius=HELD_WITHIN,
).task(
    TEXT.templates,
    _slots,
    summary="Hang the mug on the rack, then stack the blocks in the near left area.",
    success=(
        "The mug hangs on the rack's peg, the red block lies in the near left area and the green, "
        "blue and yellow blocks straight on the one before (as far as the level asks), all let go."
    ),
)
