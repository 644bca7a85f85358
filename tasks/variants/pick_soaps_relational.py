"""Pick Soaps Relational (RRR): pick the soap bar beside a named one, in a named direction.

Identical soap bars lie in straight rows and columns. The reference is named by its place in the
layout, the target by its direction from there; it is always the next one in that direction.
Front is the side away from the robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from robospa.tasks.geometry import Array
from robospa.tasks.goals.pick import Lift
from robospa.tasks.instructions import words_spatial
from robospa.tasks.instructions.words import Slots
from robospa.tasks.layouts import LayoutError, in_head_view
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import Draft, Level, Task
from robospa.tasks.variants.picking import drawn_yaw, lifted, pick_target
from robospa.tasks.variants.tabletop import draw_look, standing

RADIUS = 0.036
"""Bound of a soap bar's footprint [m]; all of it is in view."""
MARGIN = (0.06, 0.08)
"""Centres are this far inside the head image (official)."""
DRAWS = 200
DIRECTIONS: Mapping[str, tuple[int, int]] = {
    "left": (-1, 0),
    "right": (1, 0),
    "front": (0, 1),
    "back": (0, -1),
    "front_left": (-1, 1),
    "front_right": (1, 1),
    "back_left": (-1, -1),
    "back_right": (1, -1),
}
"""Steps in columns (to the right) and rows (away from the robot)."""


@dataclass(frozen=True)
class Grid:
    """A level's grid [m]: ranges of pitch, jitter of a whole column or row, least gaps, region."""

    count: int
    columns: int
    rows: int
    pitch_x: tuple[float, float]
    pitch_y: tuple[float, float]
    jitter: tuple[float, float]
    gaps: tuple[float, float, float]
    x: tuple[float, float]
    y: tuple[float, float]

    @property
    def cells(self) -> list[tuple[int, int]]:
        """(column, row) of every slot, row by row from the robot."""
        return [(c, r) for r in range(self.rows) for c in range(self.columns)]


_SMALL = (
    (0.09, 0.185), (0.085, 0.17), (0.014, 0.012), (0.0749, 0.064, 0.0686),
    (-0.205, 0.205), (-0.195, 0.035),
)  # fmt: skip
GRIDS = {
    1: Grid(2, 2, 2, *_SMALL),
    2: Grid(3, 2, 2, *_SMALL),
    3: Grid(4, 2, 2, *_SMALL),
    4: Grid(
        6, 3, 2, (0.0943, 0.16), (0.082, 0.16), (0.018, 0.012), (0.0883, 0.0754, 0.081),
        (-0.225, 0.225), (-0.205, 0.045),
    ),
    5: Grid(
        9, 3, 3, (0.0866, 0.132), (0.076, 0.122), (0.016, 0.014), (0.0826, 0.0705, 0.0757),
        (-0.228, 0.228), (-0.215, 0.075),
    ),
}  # fmt: skip


@cache
def weights(level: int) -> Array:
    """How likely each (direction, target slot) is: uniform over directions and over slots.

    Balanced by alternate scaling. The official draw (direction, then reference) favours the
    middle of the grid, so that a guess without reading could beat chance.
    """
    grid = GRIDS[level]
    table = np.array(
        [
            [float((c - dx, r - dy) in grid.cells) for c, r in grid.cells]
            for dx, dy in DIRECTIONS.values()
        ]
    )
    for _ in range(200):
        table /= table.sum(axis=1, keepdims=True) * table.shape[0]
        table /= table.sum(axis=0, keepdims=True) * table.shape[1]
    return table


def _places(grid: Grid, used: list[tuple[int, int]], rng: np.random.Generator) -> Array:
    """Where the used slots lie: (count, 2) [m]; LayoutError if nothing fits."""
    columns, rows = sorted({c for c, _ in used}), sorted({r for _, r in used})
    for _ in range(DRAWS):
        px, py = rng.uniform(*grid.pitch_x), rng.uniform(*grid.pitch_y)
        shift_x = rng.uniform(-grid.jitter[0], grid.jitter[0], len(columns))
        shift_y = rng.uniform(-grid.jitter[1], grid.jitter[1], len(rows))
        cx = {c: c * px + float(s) for c, s in zip(columns, shift_x, strict=True)}
        cy = {r: r * py + float(s) for r, s in zip(rows, shift_y, strict=True)}
        points = np.array([(cx[c], cy[r]) for c, r in used])
        low, high = points.min(axis=0), points.max(axis=0)
        room_x, room_y = grid.x[1] - grid.x[0], grid.y[1] - grid.y[0]
        if high[0] - low[0] > room_x or high[1] - low[1] > room_y:
            continue
        points += (
            rng.uniform(grid.x[0] - low[0], grid.x[1] - high[0]),
            rng.uniform(grid.y[0] - low[1], grid.y[1] - high[1]),
        )
        steps_x, steps_y = np.diff(sorted(cx.values())), np.diff(sorted(cy.values()))
        straight = (steps_x >= grid.gaps[0]).all() and (steps_y >= grid.gaps[1]).all()
        x, y = points.T
        seen = in_head_view(x, y, 0.0, 0.0, MARGIN) & in_head_view(x, y, RADIUS, 0.0)
        if straight and seen.all():
            return points
    raise LayoutError(f"no grid of {len(used)} soap bars fits in {DRAWS} draws; skip this seed")


def _label(grid: Grid, slot: tuple[int, int], used: list[tuple[int, int]]) -> str:
    """Name of a slot in the layout, unique in it: "front_left", "center", "left"..."""
    columns, rows = {c for c, _ in used}, {r for _, r in used}
    side = ("left", "middle", "right") if grid.columns == 3 else ("left", "right")
    depth = ("back", "middle", "front") if grid.rows == 3 else ("back", "front")
    if len(rows) == 1:
        return side[slot[0]]
    if len(columns) == 1:
        return depth[slot[1]]
    if side[slot[0]] == depth[slot[1]] == "middle":
        return "center"
    return f"{depth[slot[1]]}_{side[slot[0]]}"


def draw(level: int, rng: np.random.Generator) -> Draft:
    """Direction and target slot, other soaps at random slots, a straight layout, free yaws."""
    grid = GRIDS[level]
    table = weights(level).ravel()
    pick = min(int(np.searchsorted(np.cumsum(table), rng.random())), len(table) - 1)
    direction = list(DIRECTIONS)[pick // len(grid.cells)]
    target = grid.cells[pick % len(grid.cells)]
    dx, dy = DIRECTIONS[direction]
    reference = (target[0] - dx, target[1] - dy)
    rest = [s for s in grid.cells if s not in (target, reference)]
    used = [target, reference, *(rest[int(i)] for i in rng.permutation(len(rest)))][: grid.count]
    used = [used[int(i)] for i in rng.permutation(len(used))]
    points = _places(grid, used, rng)
    look = draw_look(rng, "soap")
    objects = []
    for i, (x, y) in enumerate(points.tolist()):
        yaw = drawn_yaw(rng, "soap", look, y, math.pi)
        objects.append(SceneObject(f"object_{i}", "soap", standing((x, y), yaw), look))
    facts = {
        "target": f"object_{used.index(target)}",
        "reference": f"object_{used.index(reference)}",
        "relation": direction,
        "reference_label": _label(grid, reference, used),
    }
    return Draft(tuple(objects), facts)


def slots(scene: Scene) -> Slots:
    """What the instruction says: the direction and the reference's place."""
    facts = scene.facts
    return words_spatial.relational(facts["relation"], facts["reference_label"], scene.level)


LEVELS: Mapping[int, Level] = {k: Level(g.count, 1, 150) for k, g in GRIDS.items()}

TASK = Task(
    name="Pick_Soaps_Relational",
    category="RRR",
    levels=LEVELS,
    draw=draw,
    goal=lifted(Lift(rise=0.06, closed=True)),
    plan=pick_target,
    slots=slots,
    summary="Pick the soap bar next to a named one among 2 to 9, in one of eight directions.",
    success="the target rose by more than 6 cm, carried by a closed gripper",
)
