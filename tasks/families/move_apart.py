"""Move_Blocks_Apart, Move_Playing_Cards_Away, Separate_Fries_Bread: things to two sides.

Blocks: k equal cubes in a narrow column in the middle, coloured in two colours, one of which goes
right, the other left. Cards: k boxes scattered in the middle, turned any way, to go out to either
side. Food: k breads and boxes of fries in a row, each at its slot, kinds shuffled, one of which
goes forward, the other backward. Blocks and food have one thing and one way at level 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.tasks import objects
from robospa.tasks.families import table
from robospa.tasks.goals.conditions import Region
from robospa.tasks.goals.placing import Destination, bring
from robospa.tasks.instructions import NUMBERS, Phrasings, Slots, TaskText, by_count
from robospa.tasks.plan import Skill
from robospa.tasks.sampling import places
from robospa.tasks.sampling.turns import Turnable, free_turns
from robospa.tasks.scene import Scene
from robospa.tasks.task import SceneFacts, SceneSample, Task, Tracker
from robospa.workcell import Workcell

BLOCKS_TEXT = TaskText.beside(__file__, "move_apart_blocks.toml")
CARDS_TEXT = TaskText.beside(__file__, "move_apart_cards.toml")
FOOD_TEXT = TaskText.beside(__file__, "move_apart_food.toml")


COLORS = table.first_colors(7)
TO_RIGHT = {2: 1, 3: 1, 4: 2, 5: 2}
"""How many of the blocks have the first colour, which goes right."""
X, Y, YAW = (-0.06, 0.06), (-0.22, 0.10), 0.75
HALF = (0.014, 0.016)
DISTANCE, GAP = 0.04, 0.003
"""Least distance of centres, and of the cubes' sides [m]."""
RIGHT, LEFT = Region(x=(0.1, math.inf)), Region(x=(-math.inf, -0.1))
PLACE_X = 0.17
PLACE_Y = {1: (-0.05,), 2: (-0.02, -0.14), 3: (0.0, -0.10, -0.20)}
"""Where the expert puts the blocks of one colour, far ones first; not part of the rule."""


@dataclass(frozen=True)
class BlocksFacts(SceneFacts):
    """The blocks of each side, and their colour; None where there is none."""

    right: tuple[str, ...]
    left: tuple[str, ...]
    right_color: str | None
    left_color: str | None


@dataclass(frozen=True)
class Square:
    """A cube's footprint: centre [m], turn [rad] and half edge [m]."""

    x: float
    y: float
    yaw: float
    half: float

    def clear_of(self, other: Square) -> bool:
        """Whether the centres are DISTANCE and the sides GAP apart."""
        dx, dy = other.x - self.x, other.y - self.y
        if math.hypot(dx, dy) <= DISTANCE:
            return False
        turns = (self.yaw, self.yaw + math.pi / 2, other.yaw, other.yaw + math.pi / 2)
        return any(
            abs(dx * math.cos(t) + dy * math.sin(t)) > self._extent(t) + other._extent(t) + GAP
            for t in turns
        )

    def _extent(self, turn: float) -> float:
        return self.half * (abs(math.cos(turn - self.yaw)) + abs(math.sin(turn - self.yaw)))


def _squares(rng: np.random.Generator, count: int, half: float) -> list[Square]:
    for _ in range(places.LAYOUTS):
        found: list[Square] = []
        for _ in range(places.TRIES_PER_POINT * count):
            x, y, yaw = (rng.uniform(*ends) for ends in (X, Y, (-YAW, YAW)))
            square = Square(x, y, yaw, half)
            if all(square.clear_of(other) for other in found):
                found.append(square)
                if len(found) == count:
                    return places.shuffled(rng, found)
    raise places.LayoutError(
        f"no free column of {count} blocks in {places.LAYOUTS} draws; skip this seed"
    )


def _draw_blocks(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Two colours, the first for the right side (level 1: one colour, either side)."""
    first, second = (list(COLORS)[int(i)] for i in rng.permutation(len(COLORS))[:2])
    right = TO_RIGHT[level] if level > 1 else int(rng.integers(2))
    words = [first] * right + [second] * (level - right)
    roles = ["right"] * right + ["left"] * (level - right)
    half = rng.uniform(*HALF)
    items = [
        table.block(role, (square.x, square.y), half, COLORS[word], square.yaw)
        for role, word, square in zip(roles, words, _squares(rng, level, half), strict=True)
    ]
    ours, theirs = first if right else None, second if right < level else None
    return table.sample(rng, items, BlocksFacts, right_color=ours, left_color=theirs)


def _blocks_goal(scene: Scene) -> Tracker:
    facts = BlocksFacts.of(scene)
    parts = [Destination(name, (RIGHT,), (LEFT,)) for name in facts.right]
    parts += [Destination(name, (LEFT,), (RIGHT,)) for name in facts.left]
    return bring(parts, scene.table_top)


def _blocks_plan(scene: Scene) -> tuple[Skill, ...]:
    """Right blocks with the right arm, then left ones with the left arm, far ones first."""
    skills: list[Skill] = []
    facts = BlocksFacts.of(scene)
    for arm, x, names in (("right", PLACE_X, facts.right), ("left", -PLACE_X, facts.left)):
        at = {name: scene.object(name).pose.position for name in names}
        rows = PLACE_Y.get(len(at), ())
        for name, y in zip(sorted(at, key=lambda n: -at[n][1]), rows, strict=True):
            half = float(scene.object(name).params["half"][2])
            skills += table.moved(name, (x, y, scene.table_top + half), arm)
    return tuple(skills)


def _blocks_slots(scene: Scene) -> Slots:
    facts = BlocksFacts.of(scene)
    if scene.level == 1:
        at, color = ("right" if facts.right else "left"), facts.right_color or facts.left_color
        return BLOCKS_TEXT.slots("block", "to", "at", color=color, side=at)
    return BLOCKS_TEXT.slots() | {
        "right": _some(BLOCKS_TEXT, "blocks", len(facts.right), color=facts.right_color),
        "left": _some(BLOCKS_TEXT, "blocks", len(facts.left), color=facts.left_color),
    }


def _some(text: TaskText, entry: str, count: int, **values: object) -> Phrasings:
    entry = f"{entry}.one" if count == 1 else f"{entry}.many"
    return text.phrasings(entry, count=count, word=NUMBERS[count], **values)


BLOCKS = Task(
    name="Move_Blocks_Apart",
    category="OFE",
    levels=table.LEVELS,
    draw=_draw_blocks,
    goal=_blocks_goal,
    plan=_blocks_plan,
    templates=BLOCKS_TEXT.templates,
    slots=_blocks_slots,
    summary="Move the blocks of one colour to the right and those of the other to the left.",
    success=(
        "Every block lies on the table, at least 10 cm from the middle on its colour's side, "
        "and was let go of there."
    ),
)

CARDS_X, CARDS_Y, CARDS_DISTANCE = (-0.20, 0.20), (-0.20, 0.10), 0.15
AWAY = 0.23
"""A box is away at least this far [m] from the middle."""
SIDES = {"left": Region(x=(-math.inf, -AWAY)), "right": Region(x=(AWAY, math.inf))}
AWAY_X, AWAY_Y, SPACING = 0.28, (-0.24, 0.10), 0.08
"""Where the expert puts the boxes of one side, and how far apart [m]; not part of the rule."""


@dataclass(frozen=True)
class CardsFacts(SceneFacts):
    """The boxes, in no order."""

    boxes: tuple[str, ...]


def _draw_cards(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    found = places.scatter_points(rng, level, CARDS_X, CARDS_Y, CARDS_DISTANCE, tries=10)
    points = places.shuffled(rng, found)
    variants = [table.draw_variant(rng, "playing_cards") for _ in points]
    lying = [Turnable("playing_cards", *thing) for thing in zip(variants, points, strict=True)]
    items = [
        table.thing("boxes", box.asset, box.place, box.params, yaw)
        for box, yaw in zip(lying, free_turns(rng, workcell, lying), strict=True)
    ]
    return table.sample(rng, items, CardsFacts)


def _cards_goal(scene: Scene) -> Tracker:
    """Every box far out on either side; the farther side is a diagnostic."""
    both, across = tuple(SIDES.values()), {"left": SIDES["right"], "right": SIDES["left"]}
    boxes = CardsFacts.of(scene).boxes
    parts = [Destination(name, both, (across[table.side_of(scene, name)],)) for name in boxes]
    return bring(parts, scene.table_top)


def _cards_plan(scene: Scene) -> tuple[Skill, ...]:
    """Each box straight out to its own side, the outer ones first, with room between them."""
    skills: list[Skill] = []
    for arm, x in (("left", -AWAY_X), ("right", AWAY_X)):
        names = [name for name in CardsFacts.of(scene).boxes if table.side_of(scene, name) == arm]
        at = {name: scene.object(name).pose.position for name in names}
        rows = _rows(sorted(at[name][1] for name in names))
        places = dict(zip(sorted(names, key=lambda n: at[n][1]), rows, strict=True))
        for name in sorted(names, key=lambda n: -abs(at[n][0])):
            skills += table.moved(name, (x, places[name], scene.table_top), arm)
    return tuple(skills)


def _rows(wanted: list[float]) -> list[float]:
    """The sorted values moved as little as it takes to keep SPACING, inside AWAY_Y."""
    low, high = AWAY_Y
    rows: list[float] = []
    for y in wanted:
        rows.append(max(y, rows[-1] + SPACING) if rows else max(y, low))
    for i in reversed(range(len(rows))):
        rows[i] = min(rows[i], high if i == len(rows) - 1 else rows[i + 1] - SPACING)
    return rows


def _cards_slots(scene: Scene) -> Slots:
    boxes = CardsFacts.of(scene).boxes
    count = len(boxes)
    if count > 1:
        entry = f"boxes.{by_count(count)}"
        return CARDS_TEXT.slots(entry, "out.many", "at.many", count=count, word=NUMBERS[count])
    color = objects.model_of(scene.object(boxes[0])).phrases[0].split()[0]
    return CARDS_TEXT.slots("box", "out.one", "at.one", color=color)


CARDS = Task(
    name="Move_Playing_Cards_Away",
    category="OFE",
    levels=table.LEVELS,
    draw=_draw_cards,
    goal=_cards_goal,
    plan=_cards_plan,
    templates=CARDS_TEXT.templates,
    slots=_cards_slots,
    summary="Move all boxes of playing cards out to the sides of the table.",
    success=(
        "Every box lies on the table, at least 23 cm left or right of the middle, and was let go "
        "of there."
    ),
)

ASSETS = {"bread": "bread", "fries": "french_fries"}
SLOTS_X = {
    1: ((0.0,), 0.215),
    2: ((-0.13, 0.13), 0.08),
    3: ((-0.174, 0.0, 0.174), 0.037),
    4: ((-0.2, -0.06, 0.06, 0.2), 0.011),
    5: ((-0.21, -0.105, 0.0, 0.105, 0.21), 0.004),
}
"""Where each object of the row may lie, from the row's middle: centres and half widths [m]."""
MIDDLE = -0.03
"""The row's middle [m]: that of the head image."""
FIRST = {2: 1, 3: 2, 4: 2, 5: 2}
"""How many objects go forward."""
ROW_Y, BREAD_YAW = (-0.15, -0.10), math.pi / 4
FORWARD, BACKWARD = Region(y=(-0.08, math.inf)), Region(y=(-math.inf, -0.17))
FORWARD_Y, BACKWARD_Y = -0.04, -0.21
"""Where the expert puts things; not part of the rule."""


@dataclass(frozen=True)
class FoodFacts(SceneFacts):
    """What goes forward and what backward, and the kind of food that it is."""

    forward: tuple[str, ...]
    backward: tuple[str, ...]
    forward_kind: str
    backward_kind: str


def _draw_food(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Which kind goes forward is a fair coin, and so is the direction at level 1."""
    kinds = ["bread", "fries"] if rng.random() < 0.5 else ["fries", "bread"]
    first = FIRST[level] if level > 1 else int(rng.integers(2))
    y = rng.uniform(*ROW_Y)
    items = []
    centres, spread = SLOTS_X[level]
    for centre, index in zip(centres, rng.permutation(level), strict=True):
        ahead = int(index) < first
        kind, role = (kinds[0], "forward") if ahead else (kinds[1], "backward")
        variant = table.draw_variant(rng, ASSETS[kind])
        yaw = rng.uniform(-BREAD_YAW, BREAD_YAW) if kind == "bread" else 0.0
        x = MIDDLE + centre + rng.uniform(-spread, spread)
        items.append(table.thing(f"{role} {index}", ASSETS[kind], (x, y), variant, yaw))
    forward, backward = kinds
    return table.sample(rng, items, FoodFacts, forward_kind=forward, backward_kind=backward)


def _food_goal(scene: Scene) -> Tracker:
    facts = FoodFacts.of(scene)
    parts = [Destination(name, (FORWARD,), (BACKWARD,)) for name in facts.forward]
    parts += [Destination(name, (BACKWARD,), (FORWARD,)) for name in facts.backward]
    return bring(parts, scene.table_top, released=True)


def _food_plan(scene: Scene) -> tuple[Skill, ...]:
    """Everything straight forward or backward, from left to right: the arms change once."""
    facts = FoodFacts.of(scene)
    moves = [
        (scene.object(name).pose.position[0], name, y)
        for y, names in ((FORWARD_Y, facts.forward), (BACKWARD_Y, facts.backward))
        for name in names
    ]
    skills: list[Skill] = []
    for x, name, y in sorted(moves):
        skills += table.moved(name, (x, y, scene.table_top), table.side(x))
    return tuple(skills)


def _food_slots(scene: Scene) -> Slots:
    facts = FoodFacts.of(scene)
    if scene.level == 1:
        way = "forward" if facts.forward else "backward"
        kind = facts.forward_kind if facts.forward else facts.backward_kind
        return FOOD_TEXT.slots(f"way.{way}") | {"food": _some(FOOD_TEXT, kind, 1)}
    return FOOD_TEXT.slots() | {
        "first": _some(FOOD_TEXT, facts.forward_kind, len(facts.forward)),
        "second": _some(FOOD_TEXT, facts.backward_kind, len(facts.backward)),
        "ahead": FOOD_TEXT.phrasings("way.forward"),
        "back": FOOD_TEXT.phrasings("way.backward"),
    }


FOOD = Task(
    name="Separate_Fries_Bread",
    category="OFE",
    levels=table.LEVELS,
    draw=_draw_food,
    goal=_food_goal,
    plan=_food_plan,
    templates=FOOD_TEXT.templates,
    slots=_food_slots,
    summary="Move one kind of food forward and the other backward.",
    success=(
        "What goes forward lies at y >= -0.08 m, what goes backward at y <= -0.17 m, all at once, "
        "and both grippers are open."
    ),
)
