"""Pick * Canonical (CPI) and Basic Ordinal * (SOI): one object of a grid, counted from named sides.

Objects stand in straight rows and columns. Row and column are counted from a named side, so the
same object has several names; what it is plays no part. A `Grid` says where a level's objects
stand, a `Line` of the task says what they are: blocks, cups or Rubik's cubes that all look the
same, or one of two sets of twelve different things. The counting directions are drawn; in the basic
tasks columns count from left to right and rows from far to near, so nothing about directions has to
be read from the instruction: a reference for how much of the difficulty lies there.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from robospa.tasks.families import table
from robospa.tasks.goals.lifting import Lift
from robospa.tasks.instructions import Slots, TaskText, ordinal
from robospa.tasks.sampling.grid import GapGrid, Grid
from robospa.tasks.sampling.places import NoRoom, retry
from robospa.tasks.sampling.turns import Turnable, between
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Params
from robospa.tasks.task import Level, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "canonical_index.toml")

Thing = tuple[str, Params]
"""Asset and parameters."""
Things = Callable[[np.random.Generator, int], Sequence[Thing]]
"""Draws what stands on the `count` cells, in any order."""


def alike(asset: str) -> Things:
    """All objects the same: one variant for the scene."""

    def things(rng: np.random.Generator, count: int) -> Sequence[Thing]:
        return [(asset, table.draw_variant(rng, asset))] * count

    return things


def different(assets: Sequence[str]) -> Things:
    """The first `count` of `assets`, one each, in random order."""

    def things(rng: np.random.Generator, count: int) -> Sequence[Thing]:
        drawn = [assets[int(a)] for a in rng.permutation(count)]
        return [(asset, table.draw_variant(rng, asset, VARIANTS.get(asset))) for asset in drawn]

    return things


VARIANTS: Mapping[str, tuple[int, ...]] = {"alarm_clock": (2,), "phone_stand": (1, 2, 3, 4, 5)}
"""Variants that are used, where not all: official ones, no clock too wide to be taken from afar."""


@dataclass(frozen=True)
class Line:
    """The data of one task: `kind` is what its objects are called in the task's name.

    Objects stand straight; those of `sideways` show their narrow side, across which a far one is
    grasped, those of `inward` turn their right side, where a handle is, to the middle column.
    `steady` is how far [m] the others may move up or down. `wording` is the set of templates:
    "noun", or "object" where everything is called an object (not in the basic tasks).
    """

    kind: str
    noun: str
    things: Things
    layouts: Mapping[int, Grid | GapGrid]
    steady: float
    what: str
    sideways: tuple[str, ...] = ()
    inward: tuple[str, ...] = ()
    wording: str = "noun"

    def turn(self, asset: str, right: bool) -> float:
        """How an object stands [rad], `right` of the middle column or not."""
        if asset in self.inward:
            return math.pi if right else 0.0
        return math.pi / 2 if asset in self.sideways else 0.0


@dataclass(frozen=True)
class Facts(table.PickFacts):
    """Target, and its column and row, counted from 1 in the directions; no row in a single line."""

    column: int
    column_direction: str
    row: int = 0
    row_direction: str = ""


def draw(
    level: int, rng: np.random.Generator, workcell: Workcell, line: Line, fixed: bool
) -> SceneSample:
    """The grid, what stands where, and a uniform cell to count to.

    Directions are uniform too, or, if `fixed`, left to right and far to near.
    """
    grid = line.layouts[level]
    count = grid.rows * grid.columns
    things = line.things(rng, count)

    def lying() -> tuple[list[int], list[tuple[Turnable, float]]]:
        place = grid.places(rng, workcell)
        cells = [int(c) for c in rng.permutation(count)]
        items = [
            (
                Turnable(asset, params, place(k, cells[k])),
                line.turn(asset, cells[k] % grid.columns >= grid.columns / 2),
            )
            for k, (asset, params) in enumerate(things)
        ]
        if any(between(a, b) < 0.0 for a, b in combinations(items, 2)):
            raise NoRoom("two things would touch")
        return cells, items

    cells, items = retry(lying, f"grid of {count} {line.noun}s")
    row, column = int(rng.integers(grid.rows)), int(rng.integers(grid.columns))
    from_right, from_far = False, True
    if not fixed:
        from_right, from_far = bool(rng.integers(2)), bool(rng.integers(2))
    facts = Facts(
        target=f"object_{cells.index(row * grid.columns + column)}",
        column=grid.columns - column if from_right else column + 1,
        column_direction="right_to_left" if from_right else "left_to_right",
    )
    if grid.rows > 1:
        facts = replace(
            facts,
            row=grid.rows - row if from_far else row + 1,
            row_direction="far_to_near" if from_far else "near_to_far",
        )
    return SceneSample(table.put_down(*zip(*items, strict=True)), facts)


def line_task(line: Line, basic: bool = False) -> Task:
    """The CPI task of `line` or, if `basic`, the SOI one with its fixed directions."""

    def slots(scene: Scene) -> Slots:
        facts = Facts.of(scene)
        number, word = ordinal(facts.column)
        a, b = facts.column_direction.split("_to_")
        phrases = {
            **TEXT.slots("viewer", f"noun.{line.noun}"),
            "column": TEXT.phrasings("rank", number=number, word=word),
            "column_direction": TEXT.phrasings("column_direction", a=a, b=b),
        }
        if facts.row:
            number, word = ordinal(facts.row)
            a, b = facts.row_direction.split("_to_")
            most = {"near": "nearest", "far": "farthest"}
            phrases["row"] = TEXT.phrasings("rank", number=number, word=word)
            phrases["row_direction"] = TEXT.phrasings(
                "row_direction", a=a, b=b, most_a=most[a], most_b=most[b]
            )
        return phrases

    wording = "noun" if basic else line.wording
    counted = ", counted from the left and from the far side" if basic else ""
    return Task(
        name=f"Basic_Ordinal_{line.kind}" if basic else table.pick_name(line.kind, "Canonical"),
        category="SOI" if basic else "CPI",
        levels={k: Level(g.rows * g.columns, 1, 150) for k, g in line.layouts.items()},
        draw=lambda level, rng, workcell: draw(level, rng, workcell, line, basic),
        goal=table.lifted(Lift(rise=0.04, steady=line.steady)),
        plan=table.pick_target,
        templates=lambda level: TEXT.templates(level, wording),
        slots=slots,
        summary=f"Pick the one at a counted place of a grid of 3 to 12 {line.what}{counted}.",
        success="the target rose by more than 4 cm while all others are within "
        f"{100 * line.steady:g} cm of their height",
    )


SET_A = (
    "rubikscube", "alarm_clock", "mouse", "stapler", "bell", "hamburger",
    "toycar", "playing_cards", "mug", "phone", "glue", "seal",
)  # fmt: skip
SET_B = (
    "cup", "phone_stand", "can", "pill_bottle", "french_fries", "apple",
    "soap", "perfume", "tea_box", "coffee_box", "sauce_can", "bread",
)  # fmt: skip
"""A level uses the first n of a set, one each."""


def blocks(rng: np.random.Generator, count: int) -> Sequence[Thing]:
    """Equal cubes of 28 to 40 mm in one colour, not so dark or pale that it is lost."""
    half = rng.uniform(0.014, 0.020)
    color = table.drawn_color(rng, 0.05, 0.95)
    return [("block", {"half": [half] * 3, "color": color})] * count


_BLOCK = ((0.0, -0.10, 0.063), 0.0283, 0.04)
"""No block in the middle near the robot (official); bounds of a block for the view."""
BLOCKS = {
    1: GapGrid(1, 3, (0.13, 0.13), (0.0, 0.0), (-0.14, 0.10), (-0.105, -0.01),
               0.015, (-0.015, 0.015), (0.10, 0.0), *_BLOCK),
    2: GapGrid(2, 3, (0.13, 0.13), (0.095, 0.095), (-0.10, 0.06), (-0.11, -0.01),
               0.015, (-0.010, 0.010), (0.10, 0.08), *_BLOCK),
    3: GapGrid(2, 4, (0.125, 0.125), (0.095, 0.095), (-0.04, 0.0), (-0.135, 0.01),
               0.010, (-0.010, 0.015), (0.10, 0.08), *_BLOCK),
    4: GapGrid(3, 3, (0.11, 0.125), (0.080, 0.090), (-0.10, 0.06), (-0.11, 0.0),
               0.012, (-0.010, 0.010), (0.085, 0.075), *_BLOCK),
    5: GapGrid(3, 4, (0.09, 0.12), (0.074, 0.080), (-0.15, 0.06), (-0.10, 0.0),
               0.017, (-0.014, 0.014), (0.068, 0.075), *_BLOCK),
}  # fmt: skip

_CUP = (0.0456, 0.112)
CUPS = {
    1: Grid(1, 3, 0.140, 0.0, (-0.08, 0.08), (-0.105, -0.010), (0.0104, 0.005), *_CUP),
    2: Grid(2, 3, 0.140, 0.100, (-0.07, 0.03), (-0.125, -0.025), (0.0104, 0.0058), *_CUP),
    3: Grid(2, 4, 0.140, 0.100, (-0.06, -0.02), (-0.125, -0.025), (0.0104, 0.0058), *_CUP),
    4: Grid(3, 3, 0.150, 0.110, (-0.06, 0.0), (-0.079, -0.052), (0.0104, 0.0058), *_CUP),
    5: Grid(3, 4, 0.152, 0.120, (-0.03, -0.02), (-0.061, -0.050), (0.0015, 0.0015), *_CUP),
}

_CUBE = (0.0405, 0.058)
CUBES = {
    1: Grid(1, 3, 0.135, 0.0, (-0.12, 0.08), (-0.12, -0.01), (0.0103, 0.0057), *_CUBE),
    2: Grid(2, 3, 0.135, 0.120, (-0.10, 0.06), (-0.11, -0.01), (0.0103, 0.0057), *_CUBE),
    3: Grid(2, 4, 0.135, 0.120, (-0.04, 0.0), (-0.11, -0.03), (0.0103, 0.0057), *_CUBE),
    4: Grid(3, 3, 0.130, 0.110, (-0.10, 0.06), (-0.072, -0.052), (0.0103, 0.0057), *_CUBE),
    5: Grid(3, 4, 0.136, 0.100, (-0.04, 0.0), (-0.082, -0.062), (0.010, 0.005), *_CUBE),
}

_A = (0.06, 0.194, 0.0)
"""With four columns the tallest thing, a bottle of glue, reaches to the image's very edge."""
GRIDS_A = {
    1: Grid(1, 3, 0.156, 0.0, (-0.12, 0.08), (-0.125, -0.01), (0.015, 0.02), *_A),
    2: Grid(2, 3, 0.156, 0.125, (-0.10, 0.06), (-0.105, -0.085), (0.012, 0.01), *_A),
    3: Grid(2, 4, 0.150, 0.125, (-0.05, -0.02), (-0.058, -0.045), (0.006, 0.01), *_A),
    4: Grid(3, 3, 0.156, 0.125, (-0.08, 0.02), (-0.048, -0.038), (0.012, 0.006), *_A),
    5: Grid(3, 4, 0.145, 0.125, (-0.04, -0.02), (-0.045, -0.040), (0.0015, 0.001), *_A),
}

_B = (0.0545, 0.156)
GRIDS_B = {
    1: Grid(1, 3, 0.156, 0.0, (-0.12, 0.08), (-0.125, -0.01), (0.015, 0.02), *_B),
    2: Grid(2, 3, 0.156, 0.135, (-0.10, 0.06), (-0.098, -0.05), (0.012, 0.012), *_B),
    3: Grid(2, 4, 0.150, 0.135, (-0.05, -0.02), (-0.07, -0.05), (0.006, 0.01), *_B),
    4: Grid(3, 3, 0.156, 0.125, (-0.08, 0.04), (-0.048, -0.038), (0.010, 0.003), *_B),
    5: Grid(3, 4, 0.147, 0.122, (-0.04, -0.028), (-0.051, -0.043), (0.003, 0.003), *_B),
}

LINES = (
    Line("Blocks", "block", blocks, BLOCKS, 0.025, "equal blocks"),
    Line("Cups", "cup", alike("cup"), CUPS, 0.03, "equal cups"),
    Line("Rubik_Cubes", "rubik_cube", alike("rubikscube"), CUBES, 0.03, "equal Rubik's cubes"),
    Line(
        "Mixed_Objects_A",
        "object",
        different(SET_A),
        GRIDS_A,
        0.03,
        "different objects",
        sideways=("alarm_clock",),
        inward=("mug",),
        wording="object",
    ),
    Line("Mixed_Objects_B", "object", different(SET_B), GRIDS_B, 0.03, "different objects"),
)

TASKS = tuple(line_task(line) for line in LINES)
BASIC = tuple(line_task(line, basic=True) for line in LINES)
