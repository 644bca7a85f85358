"""Canonical position indexing: objects in straight rows and columns, one counted from named sides.

Shared by Pick_*_Canonical (CPI) and Basic_Ordinal_* (SOI): a `Grid` says where a level's objects
stand, a `Line` of the task says what they are. The counting directions are drawn, or fixed for
the basic tasks. A seed whose grid does not fit in bounded work is refused (LayoutError).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from robospa.geometry import Array
from robospa.tasks.families.picking import lifted, pick_name, pick_target
from robospa.tasks.families.tabletop import draw_look, standing
from robospa.tasks.goals.pick import Lift
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText
from robospa.tasks.instructions.words import ordinal
from robospa.tasks.layouts import LayoutError
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import Draft, Draw, Level, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "instructions.toml")

Thing = tuple[str, Mapping[str, Any]]
"""Asset and parameters."""
Things = Callable[[np.random.Generator, int], Sequence[Thing]]
"""Draws what stands on the `count` cells, in any order."""


class Layout(Protocol):
    """Where the objects of a level stand."""

    @property
    def rows(self) -> int: ...

    @property
    def columns(self) -> int: ...

    def places(
        self, rng: np.random.Generator, workcell: Workcell
    ) -> Callable[[int, int], tuple[float, float]]:
        """A drawn grid: place [m] of object `k` on cell `cell` (row by row from the robot)."""
        ...


@dataclass(frozen=True)
class Grid:
    """A grid of a level [m]: pitch, range of its centre, half range of each object's jitter.

    Some official centres let the near row (and the outer columns of four) leave the head image;
    `y` and, with four columns, `pitch_x` are chosen so that every object is seen. `x` is the
    official range; the part of it in which all is in view is used. `radius` and `tall` bound the
    objects for that.
    """

    rows: int
    columns: int
    pitch_x: float
    pitch_y: float
    x: tuple[float, float]
    y: tuple[float, float]
    jitter: tuple[float, float]
    radius: float = 0.06
    tall: float = 0.12

    def centre_x(self, y: float, workcell: Workcell) -> tuple[float, float]:
        """Where the centre may be when it is at `y`, so that the near row is in view."""
        near = y - (self.rows - 1) / 2 * self.pitch_y - self.jitter[1]
        half = (self.columns - 1) / 2 * self.pitch_x + self.jitter[0]
        footprint, axis = (
            workcell.view_span(near, self.radius),
            workcell.view_span(near, 0.0, self.tall),
        )
        low = max(self.x[0], footprint[0] + half, axis[0] + half)
        high = min(self.x[1], footprint[1] - half, axis[1] - half)
        if low > high:
            raise ValueError(f"no room in view for {self.columns} columns at y = {y}")
        return low, high

    def places(
        self, rng: np.random.Generator, workcell: Workcell
    ) -> Callable[[int, int], tuple[float, float]]:
        """Centre and jitter of every object, uniform."""
        centre_y = float(rng.uniform(*self.y))
        centre_x = float(rng.uniform(*self.centre_x(centre_y, workcell)))
        jitter = rng.uniform(-1, 1, (self.rows * self.columns, 2)) * self.jitter

        def place(k: int, cell: int) -> tuple[float, float]:
            row, column = divmod(cell, self.columns)
            x = centre_x + (column - (self.columns - 1) / 2) * self.pitch_x + float(jitter[k, 0])
            y = centre_y + (row - (self.rows - 1) / 2) * self.pitch_y + float(jitter[k, 1])
            return x, y

        return place


DRAWS = 96
"""Grids that are drawn at once; the first that fits is taken."""
BATCHES = 200


@dataclass(frozen=True)
class GapGrid:
    """A grid [m] with drawn pitches that is drawn again until its gaps do.

    `gaps`: least x distance of neighbours in a row and least distance of the means of
    neighbouring rows. `keep_out`: x, y and radius of a disc that holds no object's centre.
    """

    rows: int
    columns: int
    pitch_x: tuple[float, float]
    pitch_y: tuple[float, float]
    x: tuple[float, float]
    y: tuple[float, float]
    jitter_x: float
    jitter_y: tuple[float, float]
    gaps: tuple[float, float]
    keep_out: tuple[float, float, float]
    radius: float
    tall: float

    def places(
        self, rng: np.random.Generator, workcell: Workcell
    ) -> Callable[[int, int], tuple[float, float]]:
        """The first grid that keeps its gaps, uniform among those that do; LayoutError if none."""
        for _ in range(BATCHES):
            x, y = self._drawn(rng)
            good = np.flatnonzero(self._fits(x, y, workcell))
            if len(good):
                xs, ys = x[good[0]].ravel().tolist(), y[good[0]].ravel().tolist()
                return lambda k, cell: (xs[cell], ys[cell])
        raise LayoutError(f"no grid fits in {BATCHES * DRAWS} draws; skip this seed")

    def _drawn(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """x and y of many grids, each (DRAWS, rows, columns)."""
        shape = (DRAWS, self.rows, self.columns)
        pitch_x, pitch_y, centre_x, centre_y = (
            rng.uniform(low, high, (DRAWS, 1, 1))
            for low, high in (self.pitch_x, self.pitch_y, self.x, self.y)
        )
        column = np.arange(self.columns) - (self.columns - 1) / 2
        row = (np.arange(self.rows) - (self.rows - 1) / 2)[:, None]
        x = centre_x + column * pitch_x + rng.uniform(-self.jitter_x, self.jitter_x, shape)
        y = centre_y + row * pitch_y + rng.uniform(*self.jitter_y, shape)
        return x, y

    def _fits(self, x: Array, y: Array, workcell: Workcell) -> Array:
        free = np.hypot(x - self.keep_out[0], y - self.keep_out[1]) >= self.keep_out[2]
        seen = workcell.in_view(x, y, self.radius) & workcell.in_view(x, y, 0.0, self.tall)
        every = (free & seen & workcell.in_reach(x, y)).all(axis=(1, 2))
        columns = (np.diff(x, axis=2) >= self.gaps[0]).all(axis=(1, 2))
        rows = (np.diff(y.mean(axis=2), axis=1) >= self.gaps[1]).all(axis=1)
        return np.asarray(every & columns & rows)


def alike(asset: str) -> Things:
    """All objects the same: one look for the scene."""

    def things(rng: np.random.Generator, count: int) -> Sequence[Thing]:
        return [(asset, draw_look(rng, asset))] * count

    return things


def different(assets: Sequence[str]) -> Things:
    """The first `count` of `assets`, one each, in random order."""

    def things(rng: np.random.Generator, count: int) -> Sequence[Thing]:
        drawn = [assets[int(a)] for a in rng.permutation(count)]
        return [(asset, draw_look(rng, asset)) for asset in drawn]

    return things


@dataclass(frozen=True)
class Line:
    """The data of one task: `kind` is what its objects are called in the task's name.

    Objects stand straight; those of `sideways` show their narrow side, across which a far one is
    grasped. `steady` is how far [m] the others may move up or down. `wording` is the set of
    templates: "noun", or "object" where everything is called an object (not in the basic tasks).
    """

    kind: str
    noun: str
    things: Things
    layouts: Mapping[int, Layout]
    steady: float
    what: str
    sideways: tuple[str, ...] = ()
    wording: str = "noun"


def drawer(line: Line, fixed: bool) -> Draw:
    """The draw of `line`: the grid, what stands where, and a uniform cell to count to.

    Directions are uniform too, or, if `fixed`, left to right and far to near.
    """

    def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> Draft:
        grid = line.layouts[level]
        count = grid.rows * grid.columns
        place = grid.places(rng, workcell)
        cells = [int(c) for c in rng.permutation(count)]
        objects = []
        for k, (asset, params) in enumerate(line.things(rng, count)):
            yaw = math.pi / 2 if asset in line.sideways else 0.0
            height = params["half"][2] if "half" in params else 0.0
            pose = standing(place(k, cells[k]), yaw, height)
            objects.append(SceneObject(f"object_{k}", asset, pose, params))
        row, column = int(rng.integers(grid.rows)), int(rng.integers(grid.columns))
        from_right, from_far = False, True
        if not fixed:
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

    return draw


def line_task(line: Line, basic: bool = False) -> Task:
    """The CPI task of `line` or, if `basic`, the SOI one with its fixed directions."""

    def slots(scene: Scene) -> Slots:
        facts = scene.facts
        number, word = ordinal(facts["column"])
        a, b = facts["column_direction"].split("_to_")
        said = {
            **TEXT.slots("viewer", f"noun.{line.noun}"),
            "column": TEXT.phrasings("rank", number=number, word=word),
            "column_direction": TEXT.phrasings("column_direction", a=a, b=b),
        }
        if "row" in facts:
            number, word = ordinal(facts["row"])
            a, b = facts["row_direction"].split("_to_")
            most = {"near": "nearest", "far": "farthest"}
            said["row"] = TEXT.phrasings("rank", number=number, word=word)
            said["row_direction"] = TEXT.phrasings(
                "row_direction", a=a, b=b, most_a=most[a], most_b=most[b]
            )
        return said

    wording = "noun" if basic else line.wording
    counted = ", counted from the left and from the far side" if basic else ""
    return Task(
        name=f"Basic_Ordinal_{line.kind}" if basic else pick_name(line.kind, "Canonical"),
        category="SOI" if basic else "CPI",
        levels={k: Level(g.rows * g.columns, 1, 150) for k, g in line.layouts.items()},
        draw=drawer(line, basic),
        goal=lifted(Lift(rise=0.04, steady=line.steady)),
        plan=pick_target,
        templates=lambda level: TEXT.templates(level, wording),
        slots=slots,
        summary=f"Pick the one at a counted place of a grid of 3 to 12 {line.what}{counted}.",
        success="the target rose by more than 4 cm while all others are within "
        f"{100 * line.steady:g} cm of their height",
    )
