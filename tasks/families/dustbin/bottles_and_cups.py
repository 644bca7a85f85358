"""Place_Bottle_Cup: bottles into the bin beside the table, then cups onto coasters.

Draw: one bottle on the left, up to two on the right, from level 4 on a cup and a coaster, at
level 5 two of each; the table stands 0.3 m farther right, the bin on the floor at its left.
Success: every bottle came to rest in the bin, every cup was put on a coaster, both grippers open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robospa.geometry import Pose
from robospa.tasks.families.action_chain.stations import frame_of
from robospa.tasks.families.dustbin import bottles as only_bottles
from robospa.tasks.families.dustbin.bottles import HALF_HEIGHT
from robospa.tasks.families.dustbin.floor_bin import (
    BIN,
    TABLE_SHIFT,
    container,
    discard,
    exchange_place,
    reachable,
)
from robospa.tasks.families.tabletop import (
    Item,
    draw_look,
    in_view,
    middle_in_view,
    named,
    radius,
    side,
    standing,
)
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.parts import Inside, Part, Rests, on_spot
from robospa.tasks.goals.repeat import ActionCounter
from robospa.tasks.instructions.grammar import Slots, Templates
from robospa.tasks.instructions.text import TaskText, by_count
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.sampling.places import Point, free_point, retry
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "bottles_and_cups.toml")

BOTTLES = {1: 1, 2: 2, 3: 3, 4: 3, 5: 3}
CUPS = {1: 0, 2: 0, 3: 0, 4: 1, 5: 2}

BOTTLE_Y = (0.05, 0.22)
LEFT_X, NEXT_X, LAST_X = (-0.28, -0.12), (0.08, 0.18), (0.18, 0.30)
ALONE_X = (0.12, 0.28)
"""Where a single bottle on the right stands."""
BOTTLE_DISTANCE, CUP_DISTANCE, PAIR_DISTANCE = 0.1265, 0.1095, 0.1
TABLE_LEFT = -0.3
CUP_X, COASTER_X = ((0.15, 0.25), (-0.30, -0.15)), ((-0.05, 0.10), (-0.10, 0.05))
CUP_Y = (-0.2, 0.05)
EDGE = 0.01
"""Room [m] between a cup and the table's edge."""
REACH, HEIGHT = 0.035, 0.015
"""Largest offset [m] of a cup from the middle of its coaster, in the plane and in height."""
GRIP = (0.0, 0.0, 0.085)
"""Where a cup is held [m, its frame]: at its rim."""
CUP = {"look": 0}
"""All cups are of the one official model."""
ROOM = 0.105
"""Distance [m] of the place of the hand-over from cups and coasters: a bottle that is set down 1 cm
off stands beside the coaster (radius 5.4 cm), not on its edge, from where it falls."""

LEVELS = {
    n: Level(candidates=BOTTLES[n] + CUPS[n], subtasks=n, steps=steps)
    for n, steps in {1: 400, 2: 800, 3: 1200, 4: 1400, 5: 1600}.items()
}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The bin, the bottles, and from level 4 on cups and their coasters."""

    dustbin: str
    bottle_0: str
    bottle_1: str = ""
    bottle_2: str = ""
    cup_0: str = ""
    cup_1: str = ""
    coaster_0: str = ""
    coaster_1: str = ""

    @property
    def bottles(self) -> tuple[str, ...]:
        """The bottles, the left one first."""
        return _there(self.bottle_0, self.bottle_1, self.bottle_2)

    @property
    def cups(self) -> tuple[str, ...]:
        """The cups."""
        return _there(self.cup_0, self.cup_1)

    @property
    def coasters(self) -> tuple[str, ...]:
        """The coasters, in the order of the cups."""
        return _there(self.coaster_0, self.coaster_1)


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Bottles on the far half, cups and coasters on the near one."""
    return retry(lambda: _draw(level, rng, workcell), f"objects of Place_Bottle_Cup level {level}")


def _draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample | None:
    items = [Item("dustbin", "dustbin", BIN, {"look": 0}, fixed=True)]
    points: list[Point] = []

    def put(
        role: str, x: tuple[float, float], y: tuple[float, float], far: list[tuple[Point, float]]
    ) -> Point | None:
        asset = role.split("_")[0]
        look = CUP if asset == "cup" else draw_look(rng, asset)
        wide = radius(asset, look)
        seen = in_view(workcell, asset, look)

        def allowed(point: Point) -> bool:
            if not reachable(workcell, point):
                return False
            if asset == "bottle":
                return middle_in_view(workcell, point, HALF_HEIGHT)
            return point[0] - wide > TABLE_LEFT + EDGE and seen(point)

        point = free_point(rng, x, y, far, allowed=allowed)
        if point is not None:
            points.append(point)
            items.append(Item(role, asset, standing(point), look, fixed=asset == "coaster"))
        return point

    right = {1: (), 2: (ALONE_X,)}.get(BOTTLES[level], (NEXT_X, LAST_X))
    for i, x in enumerate((LEFT_X, *right)):
        if put(f"bottle_{i}", x, BOTTLE_Y, [(p, BOTTLE_DISTANCE) for p in points]) is None:
            return None
    for i in range(CUPS[level]):
        cup = put(f"cup_{i}", CUP_X[i], CUP_Y, [(p, CUP_DISTANCE) for p in points])
        if cup is None:
            return None
        far = [(p, PAIR_DISTANCE if p == cup else CUP_DISTANCE) for p in points]
        if put(f"coaster_{i}", COASTER_X[i], CUP_Y, far) is None:
            return None
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(**names), TABLE_SHIFT)


def _there(*names: str) -> tuple[str, ...]:
    return tuple(name for name in names if name)


def goal(scene: Scene) -> Checklist:
    """Bottles in the bin, then cups on coasters, any cup on any coaster; everything latches."""
    facts = Facts.of(scene)
    inside = container(scene.object(facts.dustbin))
    parts: list[ActionCounter | Part] = [
        Inside(name, facts.dustbin, inside) for name in facts.bottles
    ]
    turns = [0] * len(parts)
    for name in facts.cups:
        near = on_spot(REACH, -HEIGHT, HEIGHT, Pose(), frame_of(scene, facts.coasters[0]))
        parts.append(Rests(name, facts.coasters, near, latched=True, grip=GRIP))
        turns.append(1)
    return Checklist(parts, released=True, radius=0.2, may_fall=inside.over, turns=turns)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """The left bottle, those on the right through the middle, then each cup to its own coaster."""
    facts = Facts.of(scene)
    cups, coasters = facts.cups, facts.coasters
    taken = [(scene.object(name).pose.position[:2], ROOM) for name in (*cups, *coasters)]
    middle = exchange_place(taken)
    skills: list[Skill] = []
    for name in facts.bottles:
        skills += discard(scene, name, facts.dustbin, middle)
    for cup, coaster in zip(cups, coasters, strict=True):
        arm = side(scene.object(cup).pose.position[0])
        skills += [Pick(cup, lift=0.08, arm=arm), Place(cup, on=coaster, arm=arm)]
    return tuple(skills)


def slots(scene: Scene) -> Slots:
    """Phrasings for bottles, bin, cups and coasters."""
    phrases, cups = only_bottles.bottle_slots(BOTTLES[scene.level]), CUPS[scene.level]
    return phrases | (
        TEXT.slots(*(f"{w}.{by_count(cups)}" for w in ("cup", "coaster"))) if cups else {}
    )


def templates(level: int) -> Templates:
    """Bottles alone up to level 3, cups too from level 4 on."""
    return (TEXT if CUPS[level] else only_bottles.TEXT).templates(level)


TASK = Task(
    name="Place_Bottle_Cup",
    category="CAC",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=templates,
    slots=slots,
    summary="Throw the bottles into the dustbin, then put the cups on the coasters.",
    success=(
        "Every bottle came to rest inside the bin, every cup was let go on a coaster, no more than "
        "3.5 cm off its middle (as far as the level asks), and both grippers are open."
    ),
)
