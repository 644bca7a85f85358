"""Pick Mixed Objects Canonical A (CPI): pick the object in the named row and column of a grid.

Different objects stand in straight rows and columns. Row and column are counted from a named
side, so the same object has several names; what it is plays no part.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robospa.tasks.goals.pick import Lift
from robospa.tasks.instructions import words_spatial
from robospa.tasks.instructions.words import Slots
from robospa.tasks.layouts import view_span
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import Draft, Level, Task
from robospa.tasks.variants.picking import lifted, pick_target
from robospa.tasks.variants.tabletop import draw_look, standing

ASSETS = (
    "rubikscube", "alarm_clock", "mouse", "stapler", "bell", "hamburger",
    "toycar", "playing_cards", "mug", "phone", "glue", "seal",
)  # fmt: skip
"""A level uses the first n, one each."""
RADIUS, TALL = 0.06, 0.12
"""Bounds of footprint and height [m], for the view."""
SIDEWAYS = ("alarm_clock",)
"""All objects stand straight; these show their narrow side, across which a far one is grasped."""


@dataclass(frozen=True)
class Grid:
    """A grid of a level [m]: pitch, range of its centre, half range of each object's jitter.

    The official centre lets the near row (and the outer columns of four) leave the head image;
    `y` and, with four columns, `pitch_x` are chosen so that every object is seen. `x` is the
    official range; the part of it in which all is in view is used.
    """

    rows: int
    columns: int
    pitch_x: float
    pitch_y: float
    x: tuple[float, float]
    y: tuple[float, float]
    jitter: tuple[float, float]

    def centre_x(self, y: float) -> tuple[float, float]:
        """Where the centre may be when it is at `y`, so that the near row is in view."""
        near = y - (self.rows - 1) / 2 * self.pitch_y - self.jitter[1]
        half = (self.columns - 1) / 2 * self.pitch_x + self.jitter[0]
        footprint, axis = view_span(near, RADIUS), view_span(near, 0.0, TALL)
        low = max(self.x[0], footprint[0] + half, axis[0] + half)
        high = min(self.x[1], footprint[1] - half, axis[1] - half)
        if low > high:
            raise ValueError(f"no room in view for {self.columns} columns at y = {y}")
        return low, high


GRIDS = {
    1: Grid(1, 3, 0.156, 0.0, (-0.12, 0.08), (-0.125, -0.01), (0.015, 0.02)),
    2: Grid(2, 3, 0.156, 0.125, (-0.10, 0.06), (-0.105, -0.085), (0.012, 0.01)),
    3: Grid(2, 4, 0.150, 0.125, (-0.05, -0.02), (-0.058, -0.045), (0.006, 0.01)),
    4: Grid(3, 3, 0.156, 0.125, (-0.08, 0.02), (-0.048, -0.038), (0.012, 0.006)),
    5: Grid(3, 4, 0.145, 0.125, (-0.04, -0.02), (-0.048, -0.043), (0.0015, 0.001)),
}


def draw(level: int, rng: np.random.Generator) -> Draft:
    """The grid, which object stands where, and a uniform cell counted in uniform directions."""
    grid = GRIDS[level]
    count = grid.rows * grid.columns
    centre_y = float(rng.uniform(*grid.y))
    centre_x = float(rng.uniform(*grid.centre_x(centre_y)))
    jitter = rng.uniform(-1, 1, (count, 2)) * grid.jitter
    cells = [int(c) for c in rng.permutation(count)]
    assets = [ASSETS[int(a)] for a in rng.permutation(count)]
    objects = []
    for k, cell in enumerate(cells):
        row, column = divmod(cell, grid.columns)
        x = centre_x + (column - (grid.columns - 1) / 2) * grid.pitch_x + float(jitter[k, 0])
        y = centre_y + (row - (grid.rows - 1) / 2) * grid.pitch_y + float(jitter[k, 1])
        pose = standing((x, y), math.pi / 2 if assets[k] in SIDEWAYS else 0.0)
        objects.append(SceneObject(f"object_{k}", assets[k], pose, draw_look(rng, assets[k])))
    row, column = int(rng.integers(grid.rows)), int(rng.integers(grid.columns))
    from_right, from_far = bool(rng.integers(2)), bool(rng.integers(2))
    facts: dict[str, object] = {
        "target": f"object_{cells.index(row * grid.columns + column)}",
        "column": grid.columns - column if from_right else column + 1,
        "column_direction": "right_to_left" if from_right else "left_to_right",
    }
    if grid.rows > 1:
        facts["row"] = grid.rows - row if from_far else row + 1
        facts["row_direction"] = "far_to_near" if from_far else "near_to_far"
    return Draft(tuple(objects), facts)


def slots(scene: Scene) -> Slots:
    """What the instruction says: column and, with more than one row, row."""
    facts = scene.facts
    return words_spatial.canonical(
        facts["column"], facts["column_direction"], facts.get("row"), facts.get("row_direction")
    )


LEVELS: Mapping[int, Level] = {k: Level(g.rows * g.columns, 1, 150) for k, g in GRIDS.items()}

TASK = Task(
    name="Pick_Mixed_Objects_Canonical_A",
    category="CPI",
    levels=LEVELS,
    draw=draw,
    goal=lifted(Lift(rise=0.04, steady=0.03)),
    plan=pick_target,
    slots=slots,
    summary="Pick the object at a counted row and column of a grid of 3 to 12 different objects.",
    success="the target rose by more than 4 cm while all others are within 3 cm of their height",
)
