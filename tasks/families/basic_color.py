"""Basic Color (CBG): pick the object of the named colour, from the sets of the distance tasks.

Same objects, numbers and layouts as there; every object of a scene has a colour of its own, and
the colour alone names the target.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from robospa.geometry import Array
from robospa.tasks.colors import nearest
from robospa.tasks.families import distance
from robospa.tasks.families.table import PickFacts, lifted, pick_target
from robospa.tasks.goals.lifting import Lift
from robospa.tasks.instructions import Slots, TaskText
from robospa.tasks.scene import Scene
from robospa.tasks.task import SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "basic_color.toml")

COLORS = ("red", "green", "blue", "yellow", "orange", "purple", "pink", "black", "brown")
"""Colours of modelled objects that nobody takes for one another. White is left out: the table and
the inside of a mug are white."""

Colored = Callable[[int, np.random.Generator], tuple[list[distance.Thing], list[str]]]
"""What lies at each place of a level's scene, and the colour words."""


def blocks(level: int, rng: np.random.Generator) -> tuple[list[distance.Thing], list[str]]:
    """The blocks of the distance task."""
    things = distance.blocks(level, rng)
    return things, [nearest((params or {})["color"]) for _, params in things]


def alike(asset: str) -> Colored:
    """Objects of one kind in different colours."""

    def draw(level: int, rng: np.random.Generator) -> tuple[list[distance.Thing], list[str]]:
        words = [COLORS[int(i)] for i in rng.permutation(len(COLORS))[: distance.COUNTS[level - 1]]]
        return [(asset, {"look": 0, "tint": word}) for word in words], words

    return draw


BROWN_BREAD = 5
"""The look of bread with the darkest crust."""


def mixed(
    kinds: Sequence[str],
    natural: Mapping[str, tuple[str, ...]] = MappingProxyType({}),
    never: Sequence[str] = (),
) -> Colored:
    """One object each of the level's first `kinds`, in different colours.

    `natural` are the colours of things that exist in few colours, the most restricted first;
    `never` are colours that a detail of another object of the set would show as well.
    """

    def draw(level: int, rng: np.random.Generator) -> tuple[list[distance.Thing], list[str]]:
        assets = [kinds[int(i)] for i in rng.permutation(distance.COUNTS[level - 1])]
        shuffled = [COLORS[int(i)] for i in rng.permutation(len(COLORS))]
        free = [word for word in shuffled if word not in never]
        chosen: dict[str, str] = {}
        for asset, some in natural.items():
            if asset in assets:
                chosen[asset] = next(word for word in free if word in some)
                free.remove(chosen[asset])
        kept = {word for some in natural.values() if len(some) == 1 for word in some}
        rest = iter(word for word in free if word not in kept)
        words = [chosen.get(asset) or next(rest) for asset in assets]
        things: list[distance.Thing] = [
            (asset, {"look": BROWN_BREAD} if asset == "bread" else {"look": 0, "tint": word})
            for asset, word in zip(assets, words, strict=True)
        ]
        return things, words

    return draw


@dataclass(frozen=True)
class Facts(PickFacts):
    """Target and its colour word."""

    color: str


def color_task(family: distance.ObjectSet, colored: Colored) -> Task:
    """The task that names the target of `family` by its colour."""
    rules = family.rules

    def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
        found = distance.layouts(workcell, rules, level)
        things, words = colored(level, rng)

        def places() -> Array:
            return distance.shifted(
                rng, workcell, rules, level, found[int(rng.integers(len(found)))]
            )

        _, objects, order = distance.put_down(rng, workcell, places, things, family.yaw)
        target = int(rng.integers(len(objects)))
        return SceneSample(objects, Facts(f"object_{target}", words[order[target]]))

    def slots(scene: Scene) -> Slots:
        return TEXT.slots("target", color=Facts.of(scene).color, noun=family.noun)

    return Task(
        name=f"Basic_Color_{family.name}",
        category="CBG",
        levels=rules.levels,
        draw=draw,
        goal=lifted(Lift(above=0.82)),
        plan=pick_target,
        templates=TEXT.templates,
        slots=slots,
        summary=f"Pick the one of the named colour among {family.what}.",
        success="the target's origin is higher than 0.82 m while a gripper carries it",
    )


NATURAL_A = {"bread": ("brown",), "apple": ("red", "green", "yellow")}
TASKS = (
    color_task(distance.BLOCKS, blocks),
    color_task(distance.MUGS, alike("mug")),
    color_task(distance.PILL_BOTTLES, alike("pill_bottle")),
    color_task(distance.MIXED_A, mixed(distance.ASSETS_A, NATURAL_A)),
    color_task(distance.MIXED_B, mixed(distance.ASSETS_B, never=("yellow",))),  # fries, any carton
)
