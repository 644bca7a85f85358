"""Rank_Blocks_Height, _Color and _Size: line blocks up from left to right in a given order.

Draw: k blocks scattered in front of the robot, never in the right order already. Success: each
block lies farther right than the one before it, hardly nearer or farther away, let go of; for sizes
both grippers are open, too. Level 1 has one block, to be brought to the middle of its near half.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robospa.geometry import Vec3
from robospa.tasks.families import table
from robospa.tasks.families.towers import NEAR_BAND
from robospa.tasks.goals.placing import bring_alone, row
from robospa.tasks.instructions import COMMON, NUMBERS, Phrasings, Slots, TaskText, by_count
from robospa.tasks.plan import Skill
from robospa.tasks.sampling import places
from robospa.tasks.scene import Scene
from robospa.tasks.task import SceneFacts, SceneSample, Task, Tracker
from robospa.text import listed
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "rank_blocks.toml")

Color = list[float]
Block = tuple[Vec3, Color]
"""Half sizes [m] and colour of one block."""

HALF_HEIGHTS = ((0.058, 0.060), (0.042, 0.044), (0.028, 0.030), (0.016, 0.018), (0.006, 0.008))
HALF_SIZES = ((0.032, 0.034), (0.027, 0.029), (0.022, 0.024), (0.017, 0.019), (0.012, 0.014))
"""Ranges [m] by rank at level 5; the levels below leave out the first."""

X, Y, DISTANCE, YAW = (-0.28, 0.28), (-0.08, 0.05), 0.10, 0.75
TRIES = 14
"""Draws per block before a layout is started again: five blocks nearly fill the region."""

BAND, NEAR_MIDDLE = 0.05, (0.0, -0.10)
"""No block starts with |x| below the band, or within DISTANCE of that point."""

TIGHT = (0.12, 0.03)
"""A layout whose neighbours in rank are all this near [m] in x and y is drawn anew."""

ROWS = {
    1: (0.0,),
    2: (-0.07, 0.07),
    3: (-0.11, 0.0, 0.11),
    4: (-0.15, -0.05, 0.05, 0.15),
    5: (-0.19, -0.095, 0.0, 0.095, 0.19),
}
ROW_Y = -0.175
"""Where the expert lines them up; not part of the rule."""


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The blocks from left to right."""

    order: tuple[str, ...]


def _heights(level: int, rng: np.random.Generator) -> list[Block]:
    half, color = rng.uniform(0.013, 0.015), table.drawn_color(rng)
    if level == 1:
        return [((half, half, half), color)]
    ranges = HALF_HEIGHTS if level == 5 else HALF_HEIGHTS[1 : level + 1]
    return [((half, half, rng.uniform(*ends)), color) for ends in ranges]


def _colors(level: int, rng: np.random.Generator) -> list[Block]:
    half = rng.uniform(0.015, 0.025)
    return [
        ((half, half, half), color) for color in map(list, list(table.ORDERED.values())[:level])
    ]


def _sizes(level: int, rng: np.random.Generator) -> list[Block]:
    color = table.drawn_color(rng)
    ranges = HALF_SIZES if level == 5 else HALF_SIZES[1 : level + 1]
    halves = [rng.uniform(*ends) for ends in ranges]
    if level == 1:
        halves = [rng.uniform(0.015, 0.025)]
    return [((half, half, half), color) for half in halves]


def _scattered(points: Sequence[places.Point]) -> bool:
    """Neither in the right order already nor all in one tight row (one block always passes)."""
    pairs = list(pairwise(points))
    if not pairs:
        return True
    ordered = all(b[0] > a[0] for a, b in pairs)
    tight = all(abs(b[0] - a[0]) < TIGHT[0] and abs(b[1] - a[1]) < TIGHT[1] for a, b in pairs)
    return not ordered and not tight


def _places(
    looks: Sequence[Block], rng: np.random.Generator, workcell: Workcell
) -> list[places.Point]:
    """Free places, all wholly in the head camera's view."""
    reach = max(math.hypot(half[0], half[1]) for half, _ in looks)
    height = max(2 * half[2] for half, _ in looks)

    def allowed(point: places.Point) -> bool:
        x, y = point
        if abs(x) < BAND or not places.apart(point, [NEAR_MIDDLE], DISTANCE):
            return False
        low, high = workcell.view_span(y, reach, height)
        return low <= x <= high

    for _ in range(places.LAYOUTS):
        found = places.scatter_points(rng, len(looks), X, Y, DISTANCE, allowed, True, TRIES)
        points = places.shuffled(rng, found)
        if _scattered(points):
            return points
    raise places.LayoutError(f"no mixed-up layout of {len(looks)} blocks; skip this seed")


def _draw(looks: Sequence[Block], rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    items = [
        table.block("order", point, half, color, rng.uniform(-YAW, YAW))
        for (half, color), point in zip(looks, _places(looks, rng, workcell), strict=True)
    ]
    return table.sample(rng, items, Facts)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Each block to its place, first those on the left, from the outside in.

    In that order the arms change only once, and no block is set down beside one not yet moved.
    """
    order = Facts.of(scene).order
    at = {name: scene.object(name).pose.position for name in order}
    skills: list[Skill] = []
    for name in sorted(order, key=lambda n: (at[n][0] > 0, -abs(at[n][0]))):
        arm = table.side(at[name][0])
        x = ROWS[scene.level][order.index(name)]
        half = float(scene.object(name).params["half"][2])
        skills += table.moved(name, (x, ROW_Y, scene.table_top + half), arm)
    return tuple(skills)


def _falling(count: int, ends: tuple[str, str], measure: str) -> Phrasings:
    """Phrasings for an order by a measure: comparatives for two blocks, superlatives for more."""
    ending = "er" if count == 2 else "est"
    most, least = (word.removesuffix("e") + ending for word in ends)
    return TEXT.phrasings("order.falling", most=most, least=least, measure=measure)


def _task(
    name: str,
    looks: Callable[[int, np.random.Generator], list[Block]],
    single: str,
    phrases: Callable[[int], Phrasings],
    summary: str,
    next_one: str,
    released: bool = False,
) -> Task:
    """The task to line up blocks of these `looks`.

    `single` is the entry of the phrasings for the only block of level 1, `phrases(count)` are those
    of the order of several. `released`: both grippers have to be open (official).
    """

    def goal(scene: Scene) -> Tracker:
        order = Facts.of(scene).order
        return (
            bring_alone(order[0], NEAR_BAND, released) if scene.level == 1 else row(order, released)
        )

    def slots(scene: Scene) -> Slots:
        count = len(Facts.of(scene).order)
        if count == 1:
            return TEXT.slots(single) | {"middle": COMMON.phrasings("middle.near")}
        blocks = TEXT.slots(f"blocks.{by_count(count)}", count=count, word=NUMBERS[count])
        return blocks | {"order": phrases(count)}

    open_too = ", both grippers open" if released else ""
    return Task(
        name=f"Rank_Blocks_{name}",
        category="OFE",
        levels=table.LEVELS,
        draw=lambda level, rng, workcell: _draw(looks(level, rng), rng, workcell),
        goal=goal,
        plan=plan,
        templates=TEXT.templates,
        slots=slots,
        summary=f"Line the blocks up from left to right{summary}.",
        success=(
            f"From left to right every block is followed by the next {next_one} block, at most 3 "
            f"cm nearer or farther, and all lie on the table, let go of{open_too}. Level 1: the "
            "block lies near the robot in the middle."
        ),
    )


def _color_order(count: int) -> Phrasings:
    colors = list(table.ORDERED)[:count]
    words = {"colors": listed(colors), "first": colors[0], "rest": listed(colors[1:])}
    return TEXT.phrasings("order.colors", **words)


TASKS = (
    _task(
        "Height",
        _heights,
        "block.plain",
        lambda count: _falling(count, ("tall", "short"), "height"),
        ", from the tallest to the shortest",
        "shorter",
    ),
    _task(
        "Color",
        _colors,
        "block.red",
        _color_order,
        ": red, green, blue, yellow, purple",
        "colour's",
    ),
    _task(
        "Size",
        _sizes,
        "block.plain",
        lambda count: _falling(count, ("large", "small"), "size"),
        ", from the largest to the smallest",
        "smaller",
        released=True,
    ),
)
