"""Canonical position indexing: objects in straight rows and columns, one counted from named sides.

Shared by Pick_*_Canonical (CPI) and Basic_Ordinal_* (SOI): a `Grid` says where a level's objects
stand, a `Line` of the task says what they are. The counting directions are drawn, or fixed for
the basic tasks. A seed whose grid does not fit in bounded work is refused (LayoutError).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from robospa.tasks.families.picking import PickFacts, lifted, pick_name, pick_target
from robospa.tasks.families.tabletop import draw_look, standing
from robospa.tasks.goals.pick import Lift
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText, ordinal
from robospa.tasks.sampling.grid import GridLayout
from robospa.tasks.sampling.places import retry
from robospa.tasks.sampling.turns import Turnable, between
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.shapes import Params
from robospa.tasks.task import Draw, Level, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "instructions.toml")

Thing = tuple[str, Params]
"""Asset and parameters."""
Things = Callable[[np.random.Generator, int], Sequence[Thing]]
"""Draws what stands on the `count` cells, in any order."""


def alike(asset: str) -> Things:
    """All objects the same: one look for the scene."""

    def things(rng: np.random.Generator, count: int) -> Sequence[Thing]:
        return [(asset, draw_look(rng, asset))] * count

    return things


def different(assets: Sequence[str]) -> Things:
    """The first `count` of `assets`, one each, in random order."""

    def things(rng: np.random.Generator, count: int) -> Sequence[Thing]:
        drawn = [assets[int(a)] for a in rng.permutation(count)]
        return [(asset, _look(rng, asset)) for asset in drawn]

    return things


LOOKS: Mapping[str, tuple[int, ...]] = {"alarm_clock": (2,), "phone_stand": (1, 2, 3, 4, 5)}
"""Looks that are used, where not all: official models, no clock too wide to be taken from afar."""


def _look(rng: np.random.Generator, asset: str) -> dict[str, int]:
    looks = LOOKS.get(asset)
    return {"look": int(rng.choice(looks))} if looks else draw_look(rng, asset)


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
    layouts: Mapping[int, GridLayout]
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
class Facts(PickFacts):
    """Target, and its column and row, counted from 1 in the directions; no row in a single line."""

    column: int
    column_direction: str
    row: int = 0
    row_direction: str = ""


def drawer(line: Line, fixed: bool) -> Draw:
    """The draw of `line`: the grid, what stands where, and a uniform cell to count to.

    Directions are uniform too, or, if `fixed`, left to right and far to near.
    """

    def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
        grid = line.layouts[level]
        count = grid.rows * grid.columns
        things = line.things(rng, count)

        def lying() -> tuple[list[int], list[tuple[Turnable, float]]] | None:
            place = grid.places(rng, workcell)
            cells = [int(c) for c in rng.permutation(count)]
            items = [
                (
                    Turnable(asset, params, place(k, cells[k])),
                    line.turn(asset, cells[k] % grid.columns >= grid.columns / 2),
                )
                for k, (asset, params) in enumerate(things)
            ]
            free = all(between(a, b) >= 0.0 for a, b in combinations(items, 2))
            return (cells, items) if free else None

        cells, items = retry(lying, f"grid of {count} {line.noun}s")
        objects = []
        for k, (item, yaw) in enumerate(items):
            height = item.params["half"][2] if "half" in item.params else 0.0
            pose = standing(item.place, yaw, height)
            objects.append(SceneObject(f"object_{k}", item.asset, pose, item.params))
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
        return SceneSample(tuple(objects), facts)

    return draw


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
