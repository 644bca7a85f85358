"""Stack_Blocks_Color_Order, Size_Order, Length_Order, Place_Bowls_Plates: things on each other.

Blocks, stacked in a given order; k scattered in front: equal cubes coloured red, green,
blue, yellow, purple (the first k); cubes of one random colour and fixed sizes, the largest at the
bottom; bars of one colour and one cross-section, their lengths clearly different, the longest at
the bottom. Level 1 has a single block, which is brought to the middle of the near half (official).

Bowls: one fixed plate left or right of the middle, k equal bowls farther away, all to be stacked on
the plate in any order.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Array, Vec3
from robospa.tasks import objects
from robospa.tasks.families import table
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.conditions import Region
from robospa.tasks.goals.placing import HEIGHT_TOLERANCE, bring_alone, nest, stack
from robospa.tasks.instructions import COMMON, NUMBERS, Slots, TaskText, by_count, color_orders
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.sampling import places
from robospa.tasks.scene import Scene
from robospa.tasks.task import Draw, SceneFacts, SceneSample, Task
from robospa.text import listed
from robospa.workcell import Workcell

COLOR_TEXT = TaskText.beside(__file__, "stack_blocks_color.toml")
TEXT = TaskText.beside(__file__, "stack_blocks.toml")

NEAR_BAND = Region((-0.05, 0.05), (-1.0, -0.08))
"""Level 1: the block's centre must come here."""
CLEARANCE = 0.09
"""The expert's place keeps this far [m] from all blocks where it can: a gripper must fit."""
LAYER_SHARE = 0.65
"""Heights may be wrong by at most this share of the thinnest block: a layer is never mistaken."""


@dataclass(frozen=True)
class TowerFacts(SceneFacts):
    """The blocks from bottom to top, where [m] the expert builds, and the colours if they count."""

    order: tuple[str, ...]
    place: tuple[float, float]
    colors: tuple[str, ...] = ()


def _sample(
    level: int,
    rng: np.random.Generator,
    items: Sequence[table.Item],
    points: Sequence[places.Point],
    colors: tuple[str, ...] = (),
) -> SceneSample:
    """The place where the expert builds is not part of the task's rule."""
    x, y = ((-0.01, 0.01), (-0.20, -0.10)) if level == 1 else ((-0.03, 0.03), (-0.15, -0.11))
    place = places.tried_point(rng, x, y, [(p, CLEARANCE) for p in points], 100) or (0.0, -0.16)
    return table.sample(rng, items, TowerFacts, place=place, colors=colors)


def goal(scene: Scene) -> Checklist:
    """The blocks as a tower, or at level 1 a block in the near band.

    Heights are looked at finely enough to tell a thin block's layer from the one below.
    """
    order = TowerFacts.of(scene).order
    if scene.level == 1:
        return bring_alone(order[0], NEAR_BAND)
    thick = [2 * _half_height(scene, name) for name in order]
    return stack(order, thick, min(HEIGHT_TOLERANCE, LAYER_SHARE * min(thick)))


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Bottom block to the drawn place, every further block on top of the one before."""
    order = TowerFacts.of(scene).order
    x, y = TowerFacts.of(scene).place
    skills: list[Skill] = []
    height = 0.0
    for i, name in enumerate(order):
        arm = table.side_of(scene, name)
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


def _task(
    name: str, draw: Draw, text: TaskText, slots: Callable[[Scene], Slots], order: str, below: str
) -> Task:
    return Task(
        name=f"Stack_Blocks_{name}_Order",
        category="OCE",
        levels=table.LEVELS,
        draw=draw,
        goal=goal,
        plan=plan,
        templates=text.templates,
        slots=slots,
        summary=f"Stack the blocks {order}.",
        success=(
            f"Every block rests straight on the {below} and both grippers are open. Level 1: the "
            "block lies near the robot in the middle."
        ),
    )


COLOR_HALF = 0.018
X, Y, DISTANCE, YAW = (-0.28, 0.28), (-0.08, 0.05), 0.10, 0.75


def _draw_colors(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Scattered cubes; at level 1 the only one starts away from the place it must go to."""

    def away(point: places.Point) -> bool:
        return abs(point[0]) >= 0.05 and places.apart(point, [(0.0, -0.10)], 0.10)

    def allowed(point: places.Point) -> bool:
        return (level > 1 or away(point)) and table.point_in_view(workcell, point, COLOR_HALF)

    points = places.scatter_points(rng, level, X, Y, DISTANCE, allowed, near_middle=True)
    items = [
        table.block("order", point, COLOR_HALF, rgb, rng.uniform(-YAW, YAW))
        for rgb, point in zip(table.ORDERED.values(), points, strict=False)
    ]
    return _sample(level, rng, items, points, tuple(table.ORDERED)[:level])


def _color_slots(scene: Scene) -> Slots:
    colors = TowerFacts.of(scene).colors
    count = len(colors)
    if count == 1:
        middle = COMMON.phrasings("middle.near")
        return COLOR_TEXT.slots("block", color=colors[0]) | {"middle": middle}
    onto = list(zip(colors[1:], colors[:-1], strict=True))

    def pairs(joint: str, last: str = " and ") -> str:
        return listed([f"{a} {joint} {b}" for a, b in onto], last)

    number = f"number.{by_count(count)}"
    return COLOR_TEXT.slots(number, count=count, word=NUMBERS[count]) | {
        "order": color_orders(colors),
        "pairs": (
            (pairs("on"), pairs("onto", ", then ")),
            (pairs("over"), pairs("on top of"), pairs("above")),
        ),
        "bottom": COLOR_TEXT.phrasings("end", color=colors[0]),
        "top": COLOR_TEXT.phrasings("end", color=colors[-1]),
        "middle": COMMON.phrasings("middle.table"),
    }


COLOR = _task(
    "Color",
    _draw_colors,
    COLOR_TEXT,
    _color_slots,
    "in the given order of colours",
    "one before it, in the order red, green, blue, yellow, purple from the bottom,",
)


SIZES = (
    ("larger", "smaller", "bigger", "smaller"),
    ("largest", "smallest", "biggest", "smallest"),
)
LENGTHS = ("longer", "shorter") * 2, ("longest", "shortest") * 2
"""The two ends of what is compared and other words for them, held out: for two blocks, for more."""


def _tower_slots(words: Sequence[Sequence[str]], scene: Scene) -> Slots:
    count = len(TowerFacts.of(scene).order)
    if count == 1:
        return TEXT.slots("block") | {"middle": COMMON.phrasings("middle.near")}
    most, least, held_most, held_least = words[0 if count == 2 else 1]
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


HALVES = {
    2: (0.0165, 0.01275),
    3: (0.0165, 0.01275, 0.009),
    4: (0.02025, 0.0165, 0.01275, 0.009),
    5: (0.024, 0.02025, 0.0165, 0.01275, 0.009),
}
"""Half sizes [m] from bottom to top."""
ONE = (0.015, 0.025)
"""Level 1: range of the only cube's half size [m]."""
AREA, MIDDLE = places.Area((-0.28, 0.28), (-0.08, 0.05), clear_middle=True), (0.0, -0.10)


def _draw_sizes(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    halves = HALVES.get(level) or (round(rng.uniform(*ONE), 5),)
    cubes = [(half, half, half) for half in halves]
    ground = places.Ground(AREA, 0.05, MIDDLE, 0.10 if level == 1 else 0.15)
    points = places.scatter_blocks(rng, workcell, ground, cubes, lambda i, j: DISTANCE)
    color = table.drawn_color(rng)
    items = [
        table.block("order", point, half, color, rng.uniform(-YAW, YAW))
        for half, point in zip(halves, points, strict=True)
    ]
    return _sample(level, rng, items, points)


SIZE = _task(
    "Size",
    _draw_sizes,
    TEXT,
    lambda scene: _tower_slots(SIZES, scene),
    "from the largest at the bottom to the smallest on top",
    "next larger one",
)

HALF_LENGTHS = {
    1: ((0.0240, 0.0250),),
    2: ((0.0440, 0.0450), (0.0240, 0.0250)),
    3: ((0.0440, 0.0450), (0.0240, 0.0250), (0.0120, 0.0130)),
    4: ((0.0440, 0.0450), (0.0330, 0.0340), (0.0240, 0.0250), (0.0120, 0.0130)),
    5: (
        *((0.0440, 0.0450), (0.0330, 0.0340), (0.0240, 0.0250)),
        *((0.0170, 0.0180), (0.0120, 0.0130)),
    ),
}
"""Ranges of the half lengths [m] from bottom to top."""
SECTION = (0.0155, 0.0165)
"""Range of half width and half height [m], the same for all bars of a scene."""
SPANS = {1: (0.0, 0.0), 2: (0.06, 0.0), 3: (0.10, 0.03), 4: (0.15, 0.04), 5: (0.15, 0.04)}
"""Least spread of the bars in x and y [m]."""
GROUNDS = {
    1: places.Ground(AREA, 0.05, MIDDLE, 0.10),
    2: places.Ground(
        places.Area((-0.25, 0.25), (-0.15, 0.05), clear_middle=True), 0.02, (0.0, -0.12), 0.1225
    ),
}
"""Level 1, and all others."""
GAP, BAR_YAW = 0.045, 0.20


def _draw_lengths(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    half_y, half_z = (round(float(v), 5) for v in rng.uniform(*SECTION, 2))
    halves = [(round(rng.uniform(*ends), 5), half_y, half_z) for ends in HALF_LENGTHS[level]]
    reach = [math.hypot(half[0], half_y) for half in halves]

    def gap(i: int, j: int) -> float:
        return reach[i] + reach[j] + GAP

    ground, wide = GROUNDS[min(level, 2)], places.wide(*SPANS[level])
    points = places.scatter_blocks(rng, workcell, ground, halves, gap, wide)
    color = table.drawn_color(rng)
    items = [
        table.block("order", point, half, color, rng.uniform(-BAR_YAW, BAR_YAW))
        for half, point in zip(halves, points, strict=True)
    ]
    return _sample(level, rng, items, points)


LENGTH = _task(
    "Length",
    _draw_lengths,
    TEXT,
    lambda scene: _tower_slots(LENGTHS, scene),
    "from the longest at the bottom to the shortest on top",
    "next longer one",
)


BOWLS_TEXT = TaskText.beside(__file__, "nest_bowls.toml")

PLATE_X, PLATE_SPREAD, PLATE_Y = 0.12, 0.03, (-0.15, -0.10)
BOWLS_AREA, BOWLS_MIDDLE = places.Area((-0.28, 0.28), (-0.05, 0.20), True), 0.08
TRIES, RESTARTS = 100, 80
BOWLS_DISTANCE = 0.13
"""Least distance [m] of bowls from each other and from the plate."""
BOWL = {"look": 2}
"""All bowls are of the one official model."""


@dataclass(frozen=True)
class BowlsFacts(SceneFacts):
    """The plate and the bowls."""

    plate: str
    bowls: tuple[str, ...]


def _draw_bowls(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    left = rng.random() < 0.5
    plate_x = (-PLATE_X if left else PLATE_X) + rng.uniform(-PLATE_SPREAD, PLATE_SPREAD)
    plate = (plate_x, rng.uniform(*PLATE_Y))
    model = objects.object_model("bowl", BOWL)

    def free(x: Array, y: Array) -> places.Mask:
        off_plate: places.Mask = np.hypot(x - plate[0], y - plate[1]) >= BOWLS_DISTANCE
        return off_plate & workcell.in_reach(x, y)

    shape, height = (level, TRIES), model.size[2]
    propose = places.candidates(
        workcell, BOWLS_AREA, shape, model.radius, height, BOWLS_MIDDLE, free
    )
    points = places.shuffled(rng, places.scatter(rng, propose, BOWLS_DISTANCE, restarts=RESTARTS))
    items = [table.thing("plate", "plate", plate, table.draw_variant(rng, "plate"), fixed=True)]
    items += [table.thing("bowls", "bowl", point, BOWL) for point in points]
    return table.sample(rng, items, BowlsFacts)


def _bowls_plan(scene: Scene) -> tuple[Skill, ...]:
    plate = BowlsFacts.of(scene).plate
    at = {name: scene.object(name).pose.position for name in BowlsFacts.of(scene).bowls}
    here = table.side_of(scene, plate)
    skills: list[Skill] = []
    below: str | None = None
    for name in sorted(at, key=lambda n: (table.side(at[n][0]) != here, at[n][1])):
        arm = table.side(at[name][0])
        skills.append(Pick(name, lift=0.10, arm=arm))
        if below is None:
            skills.append(Place(name, on=plate, arm=arm))
        else:
            skills.append(Place(name, _nested(scene, below), on=below, arm=arm))
        below = name
    return tuple(skills)


def _nested(scene: Scene, below: str) -> Vec3:
    frames = objects.model_of(scene.object(below)).frames
    return (0.0, 0.0, frames["nest"].position[2] - frames["support"].position[2])


def _bowls_slots(scene: Scene) -> Slots:
    count = len(BowlsFacts.of(scene).bowls)
    bowls = "bowl" if count == 1 else f"bowls.{by_count(count)}"
    return BOWLS_TEXT.slots("plate", bowls, count=count, word=NUMBERS[count])


BOWLS = Task(
    name="Place_Bowls_Plates",
    category="OFE",
    levels=table.LEVELS,
    draw=_draw_bowls,
    goal=lambda scene: nest(BowlsFacts.of(scene).bowls, BowlsFacts.of(scene).plate),
    plan=_bowls_plan,
    templates=BOWLS_TEXT.templates,
    slots=_bowls_slots,
    summary="Stack all bowls on the plate.",
    success=(
        "All bowls stand in one stack on the plate, each within 4 cm of the one below it, and both "
        "grippers are open. Level 1: the bowl is within 5 cm of the plate's centre."
    ),
)
