"""Put_Bottles_Dustbin and Place_Bottle_Cup: bottles into the floor's bin, cups on coasters.

The bin stands at the left of a table that stands 0.3 m farther right; only the left arm reaches it.
What the right arm takes is handed over by setting it down in the middle of the table, where the
left arm takes it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from robospa.geometry import Pose
from robospa.tasks import objects
from robospa.tasks.families import chain, table
from robospa.tasks.goals.conditions import Container, Inside, Rests, on_spot
from robospa.tasks.goals.placing import collect
from robospa.tasks.instructions import NUMBERS, Slots, TaskText, by_count
from robospa.tasks.plan import Drop, Pick, Place, Skill
from robospa.tasks.sampling.places import Point, Range, apart, free_point, scatter_points
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task, Tracker
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "dustbin.toml")
CUPS_TEXT = TaskText.beside(__file__, "dustbin_cups.toml")

BIN = Pose((-0.45, 0.0, 0.0))
TABLE_SHIFT = (0.3, 0.0)
CEILING = 0.7
"""Highest origin [m] of a thing in the bin that counts (official), should it be higher; beside a
table at its usual height."""
EXCHANGE = (-0.03, -0.08)
"""Where the right arm leaves a thing for the left one, if that place is free."""
LIFT = 0.12
"""How high the expert lifts a bottle [m]."""


def container(dustbin: SceneObject) -> Container:
    """The inside of the bin."""
    size = objects.model_of(dustbin).size
    rim = min(size[2], CEILING - BIN.position[2])
    return Container(dustbin.pose, (size[0] / 2, size[1] / 2), rim)


def reachable(workcell: Workcell, point: Point) -> bool:
    """Whether the arm on that side can take a thing there."""
    arm = workcell.arms[int(point[0] > 0)]
    return not apart(point, [arm.base], arm.reach)


def discard(scene: Scene, name: str, dustbin: str, exchange: Point = EXCHANGE) -> tuple[Skill, ...]:
    """Bring `name` into the bin; one on the right goes through the hands of both arms."""
    right = scene.object(name).pose.position[0] > 0
    hand_over: tuple[Skill, ...] = (
        Pick(name, lift=LIFT, arm="right"),
        Place(name, (*exchange, scene.table_top), arm="right"),
    )
    throw = (Pick(name, lift=LIFT, arm="left"), Drop(name, into=dustbin, arm="left"))
    return (*hand_over, *throw) if right else throw


X, Y, DISTANCE, MIDDLE = (-0.25, 0.3), (0.03, 0.23), 0.13, 0.05
HALF_HEIGHT = 0.124
"""Of the tallest bottle [m]; what is above may be cut off at the far side."""
LEVELS = {n: Level(candidates=n, subtasks=n, steps=400 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The bin and the bottles."""

    dustbin: str
    bottles: tuple[str, ...]


def _usable(workcell: Workcell, point: Point) -> bool:
    """Off the middle strip, within reach of the arm on that side, a bottle's middle in view."""
    return (
        abs(point[0]) >= MIDDLE
        and reachable(workcell, point)
        and table.point_in_view(workcell, point, HALF_HEIGHT)
    )


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Bottles on the far half but the middle strip; different variants up to level 3."""
    points = scatter_points(rng, level, X, Y, DISTANCE, partial(_usable, workcell))
    count = objects.variant_count("bottle")
    variants = rng.choice(count, size=level, replace=level > min(3, count))
    items = [table.Item("dustbin", "dustbin", BIN, {"look": 0}, fixed=True)]
    for point, variant in zip(points, variants, strict=True):
        items.append(table.thing("bottles", "bottle", point, {"look": int(variant)}))
    return table.sample(rng, items, Facts, TABLE_SHIFT)


def goal(scene: Scene) -> Tracker:
    facts = Facts.of(scene)
    inside = container(scene.object(facts.dustbin))
    return collect(facts.bottles, inside, lost_below=scene.table_top - 0.1)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Left bottles first, then those on the right by way of the exchange place.

    On each side the one nearest to where it goes is first, so that no bottle is carried over one
    that still stands: the lift alone does not clear it.
    """

    def turn(name: str) -> tuple[bool, float]:
        point = scene.object(name).pose.position[:2]
        right = point[0] > 0
        return right, math.dist(point, EXCHANGE if right else BIN.position[:2])

    facts = Facts.of(scene)
    order = sorted(facts.bottles, key=turn)
    return tuple(skill for name in order for skill in discard(scene, name, facts.dustbin))


def _bottle_slots(count: int) -> Slots:
    bottles = f"bottles.{by_count(count)}"
    return TEXT.slots(bottles, "bin", "side", count=count, word=NUMBERS[count])


BOTTLES = Task(
    name="Put_Bottles_Dustbin",
    category="OFE",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=lambda scene: _bottle_slots(len(Facts.of(scene).bottles)),
    summary="Throw all bottles into the dustbin.",
    success="Every bottle is inside the bin's walls, below its rim, and came to rest there.",
)

BOTTLE_COUNT = {1: 1, 2: 2, 3: 3, 4: 3, 5: 3}
CUP_COUNT = {1: 0, 2: 0, 3: 0, 4: 1, 5: 2}
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


@dataclass(frozen=True)
class CupFacts(SceneFacts):
    """The bin, the bottles, the left one first, and from level 4 on cups and their coasters."""

    dustbin: str
    bottle_0: str
    bottle_1: str = ""
    bottle_2: str = ""
    cup_0: str = ""
    cup_1: str = ""
    coaster_0: str = ""
    coaster_1: str = ""

    def all(self, kind: str) -> tuple[str, ...]:
        """Those of a kind, in order."""
        names = [getattr(self, f"{kind}_{i}", "") for i in range(3)]
        return tuple(name for name in names if name)


def _items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[table.Item]:
    items = [table.Item("dustbin", "dustbin", BIN, {"look": 0}, fixed=True)]
    points: list[Point] = []

    def put(role: str, x: Range, y: Range, far: list[tuple[Point, float]]) -> Point:
        asset = role.split("_")[0]
        variant = CUP if asset == "cup" else table.draw_variant(rng, asset)
        wide = table.radius(asset, variant)
        seen = table.in_view(workcell, asset, variant)

        def allowed(point: Point) -> bool:
            if not reachable(workcell, point):
                return False
            if asset == "bottle":
                return table.point_in_view(workcell, point, HALF_HEIGHT)
            return point[0] - wide > TABLE_LEFT + EDGE and seen(point)

        point = free_point(rng, x, y, far, allowed=allowed)
        points.append(point)
        items.append(table.thing(role, asset, point, variant, fixed=asset == "coaster"))
        return point

    right = {1: (), 2: (ALONE_X,)}.get(BOTTLE_COUNT[level], (NEXT_X, LAST_X))
    for i, x in enumerate((LEFT_X, *right)):
        put(f"bottle_{i}", x, BOTTLE_Y, [(p, BOTTLE_DISTANCE) for p in points])
    for i in range(CUP_COUNT[level]):
        cup = put(f"cup_{i}", CUP_X[i], CUP_Y, [(p, CUP_DISTANCE) for p in points])
        far = [(p, PAIR_DISTANCE if p == cup else CUP_DISTANCE) for p in points]
        put(f"coaster_{i}", COASTER_X[i], CUP_Y, far)
    return items


def _station(scene: Scene, step: str) -> chain.Station:
    """A bottle into the bin, or a cup, which counts on any coaster, onto its own; all latches."""
    facts = CupFacts.of(scene)
    bottles, cups, coasters = (facts.all(kind) for kind in ("bottle", "cup", "coaster"))
    if step in "123":
        name = bottles[int(step) - 1]
        inside = container(scene.object(facts.dustbin))
        taken = [(scene.object(n).pose.position[:2], ROOM) for n in (*cups, *coasters)]
        return chain.Station(
            Inside(name, inside, targets=(facts.dustbin,), latched=True),
            discard(scene, name, facts.dustbin, exchange_place(taken)),
        )
    i = "xy".index(step)
    near = on_spot(REACH, -HEIGHT, HEIGHT, Pose(), table.frame_of(scene, coasters[0], "support"))
    arm = table.side_of(scene, cups[i])
    return chain.Station(
        Rests(cups[i], near, grip=GRIP, targets=coasters, latched=True),
        (Pick(cups[i], lift=0.08, arm=arm), Place(cups[i], on=coasters[i], arm=arm)),
    )


def exchange_place(taken: Sequence[tuple[Point, float]]) -> Point:
    """The place nearest to EXCHANGE that keeps its distance [m] from each point of `taken`.

    Where there is none, the one with most room.
    """

    def rating(point: Point) -> tuple[float, float, Point]:
        room = min((_distance(point, other) - far for other, far in taken), default=0.0)
        return min(room, 0.0), -_distance(point, EXCHANGE), point

    steps = range(-8, 9)
    places = [(EXCHANGE[0] + 0.0125 * i, EXCHANGE[1] + 0.0125 * j) for i in steps for j in steps]
    return max(places, key=rating)


def _distance(a: Point, b: Point) -> float:
    return float(((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2) ** 0.5)


def _cup_slots(scene: Scene) -> Slots:
    phrases, cups = _bottle_slots(BOTTLE_COUNT[scene.level]), CUP_COUNT[scene.level]
    words = [f"{word}.{by_count(cups)}" for word in ("cup", "coaster")]
    return phrases | (CUPS_TEXT.slots(*words) if cups else {})


CUPS = chain.ActionChain(
    "Place_Bottle_Cup",
    steps={n: "123"[: BOTTLE_COUNT[n]] + "xy"[: CUP_COUNT[n]] for n in range(1, 6)},
    limits={1: 400, 2: 800, 3: 1200, 4: 1400, 5: 1600},
    facts=CupFacts,
    items=_items,
    station=_station,
    released=range(1, 6),
    radius=0.2,
    turns={"1": 0, "2": 0, "3": 0, "x": 1, "y": 1},
    table_shift=TABLE_SHIFT,
).task(
    lambda level: (CUPS_TEXT if CUP_COUNT[level] else TEXT).templates(level),
    _cup_slots,
    summary="Throw the bottles into the dustbin, then put the cups on the coasters.",
    success=(
        "Every bottle came to rest inside the bin, every cup was let go on a coaster, no more than "
        "3.5 cm off its middle (as far as the level asks), and both grippers are open."
    ),
)
