"""What has to be remembered: what was seen and is hidden, or what a long sentence says.

In four tasks something is shown, and after 2.0 s a wall or covers hide it; before that, motion
fails for good.

Blocks: k blocks of different colours on a stand at the back; 2 k blocks on the table, among them
one of each colour shown. Objects: k objects of different kinds in a row on a stand at the back, and
one like each of them on the table, all fixed. Orientation: k pairs of T-shaped blocks, one in a far
and one in a near row, each turned by a quarter turn or none, partners differently.

Colour cover: k blocks of different colours in a row, under equal covers that are opened in the
asked order of colours. Staplers: k fixed staplers in a row, any variant and turn, and a count from
1 to 5 for each; one press too many cannot be made good.
"""

import math
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Pose, yaw_rotation
from robospa.tasks import objects
from robospa.tasks.colors import NAMED
from robospa.tasks.families import in_order, table
from robospa.tasks.families.chain import pressing_arm
from robospa.tasks.goals.checklist import PressCounts
from robospa.tasks.goals.conditions import Region
from robospa.tasks.goals.memory import AfterCue, Cover, OrientationTarget, restore, uncover
from robospa.tasks.goals.placing import gather
from robospa.tasks.instructions import (
    NUMBERS,
    Phrasings,
    Slots,
    TaskText,
    by_count,
    color_orders,
    ordinal,
)
from robospa.tasks.plan import Home, Pick, Place, Press, Skill, Wait
from robospa.tasks.sampling.places import Area, Point, candidates, scatter, shuffled
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.text import listed
from robospa.workcell import TABLE_TOP, Workcell

BLOCKS_TEXT = TaskText.beside(__file__, "memory_wall_blocks.toml")
OBJECTS_TEXT = TaskText.beside(__file__, "memory_wall_objects.toml")
TURNED_TEXT = TaskText.beside(__file__, "memory_wall_orientation.toml")

HIDDEN_AT = 2.0
"""When the wall, or a cover, appears [s]."""
WALL, WALL_COLOR = "wall", (1.0, 0.9, 0.9)
WALL_HALF = (0.34, 0.005, 0.205)
WALL_Z = TABLE_TOP + WALL_HALF[2]
STAND_Z, STAND_TOP = 0.82, 0.83
"""Heights of a stand's centre and upper face [m]."""
HOLD_STILL = Wait(HIDDEN_AT + 0.2)
"""What the expert begins with."""
SHOWN_X = 0.18
"""Largest |x| [m] of what is shown on a stand."""


def wall(y: float, half_x: float = WALL_HALF[0]) -> table.Item:
    """The wall across the table at `y` [m]; it stands there from HIDDEN_AT on."""
    params = {"half": [half_x, *WALL_HALF[1:]], "color": list(WALL_COLOR)}
    pose = Pose((0.0, y, WALL_Z))
    return table.Item(WALL, "block", pose, params, fixed=True, appears_at=HIDDEN_AT)


def stand(y: float, half: tuple[float, float, float]) -> table.Item:
    """A flat gray stand over the table at `y` [m]: white is seen on it, and black."""
    params = {"half": list(half), "color": list(NAMED["gray"])}
    return table.Item("", "block", Pose((0.0, y, STAND_Z)), params, fixed=True)


def noun_of(item: SceneObject) -> str:
    """What a reader calls `item` if it is the wall or the stand; empty for everything else.

    Both are blocks to the simulator, of which scenes have no name that tells their role.
    """
    if item.asset != "block" or not item.fixed:
        return ""
    color = tuple(item.params["color"])
    if item.appears_at is not None and color == WALL_COLOR:
        return "wall"
    return "stand" if item.pose.position[2] == STAND_Z and color == NAMED["gray"] else ""


def row(count: int, most: float) -> tuple[float, ...]:
    """x of `count` things evenly from -most to most; the middle for a single one."""
    if count == 1:
        return (0.0,)
    return tuple(-most + 2 * most * i / (count - 1) for i in range(count))


def levels(candidates: int) -> dict[int, Level]:
    """The five levels, with so many candidates for each subtask."""
    return {n: Level(candidates * n, subtasks=n, steps=50 + 200 * n) for n in range(1, 6)}


HALF = 0.015
BLOCKS_STAND = stand(0.20, (0.26, 0.055, 0.01))
AREA, MIDDLE, DISTANCE, TRIES = Area((-0.25, 0.25), (-0.10, 0.08)), 0.04, 0.06, 100
NEAR = Region((-0.26, 0.26), (-1.0, -0.11))
"""Where the shown blocks have to go, and no others may be."""
GOAL_Y, GOAL_X = -0.18, 0.16
"""Where the expert puts them."""


@dataclass(frozen=True)
class WallFacts(SceneFacts):
    """The colours shown, the blocks of these colours, all other blocks, and the wall."""

    colors: tuple[str, ...]
    targets: tuple[str, ...]
    others: tuple[str, ...]
    wall: str


def _draw_blocks(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Colours on the stand; the same and as many others on the table, all places alike."""
    colors = shuffled(rng, list(table.COLORS))[: 2 * level]
    shape, radius = (2 * level, TRIES), HALF * math.sqrt(2)
    propose = candidates(workcell, AREA, shape, radius, 2 * HALF, MIDDLE)
    points = shuffled(rng, scatter(rng, propose, DISTANCE))
    items = [wall(0.12), BLOCKS_STAND]
    for color, x in zip(colors[:level], row(level, SHOWN_X), strict=True):
        at, rgb = (x, BLOCKS_STAND.pose.position[1]), table.COLORS[color]
        items.append(table.block("", at, HALF, rgb, fixed=True, top=STAND_TOP))
    for i, (color, point) in enumerate(zip(colors, points, strict=True)):
        role = "targets" if i < level else "others"
        items.append(table.block(role, point, HALF, table.COLORS[color]))
    return table.sample(rng, items, WallFacts, colors=tuple(colors[:level]))


def _blocks_goal(scene: Scene) -> AfterCue:
    facts = WallFacts.of(scene)
    return AfterCue(gather(facts.targets, facts.others, NEAR), [facts.wall])


def _blocks_plan(scene: Scene) -> tuple[Skill, ...]:
    """Hold still, then bring the blocks of each side to the nearest free place of the strip."""
    targets = WallFacts.of(scene).targets
    targets = tuple(sorted(targets, key=lambda n: scene.object(n).pose.position[0]))
    skills: list[Skill] = [HOLD_STILL]
    for name, x in zip(targets, row(len(targets), GOAL_X), strict=True):
        skills += table.moved(name, (x, GOAL_Y, scene.table_top + HALF), table.side_of(scene, name))
    return (*skills, Home())


def _blocks_slots(scene: Scene) -> Slots:
    count = len(WallFacts.of(scene).targets)
    return BLOCKS_TEXT.slots("wall", f"blocks.{by_count(count)}", "strip", word=NUMBERS[count])


BLOCKS = Task(
    name="Observe_Blocks_Move_Memory",
    category="MIP",
    levels=levels(candidates=2),
    draw=_draw_blocks,
    goal=_blocks_goal,
    plan=_blocks_plan,
    templates=BLOCKS_TEXT.templates,
    slots=_blocks_slots,
    summary="Remember the colours shown and bring the blocks of these colours near the robot.",
    success=(
        "After the wall has come, the blocks of all colours that were shown lie in the strip "
        "nearest to the robot and both grippers are open; moving before, or bringing another block "
        "there, fails for good."
    ),
)

KINDS = ("bread", "stapler", "can", "playing_cards", "bell")
OBJECTS_STAND = stand(0.15, (0.24, 0.05, 0.01))
SHOWN_TURN = math.pi / 4
TABLE_AREA, OFF_MIDDLE, APART = Area((-0.27, 0.27), (-0.21, -0.05)), 0.05, 0.10


@dataclass(frozen=True)
class ObjectsFacts(SceneFacts):
    """Objects and kinds in the order shown, and the wall."""

    order: tuple[str, ...]
    kinds: tuple[str, ...]
    wall: str


def _draw_objects(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    kinds = shuffled(rng, KINDS)[:level]
    things = [(kind, in_order.clickable(rng, kind)) for kind in kinds]
    turns = dict.fromkeys(in_order.TURNS, math.pi)
    places = in_order.laid_out(rng, workcell, TABLE_AREA, OFF_MIDDLE, APART, things, turns)
    items = [wall(0.05, 0.32), OBJECTS_STAND]
    for (kind, variant), x, place in zip(things, row(level, SHOWN_X), places, strict=True):
        turn = rng.uniform(-SHOWN_TURN, SHOWN_TURN) if kind == "bread" else 0.0
        pose = Pose((x, OBJECTS_STAND.pose.position[1], STAND_TOP), yaw_rotation(turn))
        items.append(table.Item("", kind, pose, variant, fixed=True))
        items.append(table.Item("order", kind, table.standing(*place), variant, fixed=True))
    return table.sample(rng, items, ObjectsFacts, kinds=tuple(kinds))


def _objects_goal(scene: Scene) -> AfterCue:
    """The objects on the table in the order of the stand, after the wall has come.

    One that is touched when its turn comes is clicked (official).
    """
    facts = ObjectsFacts.of(scene)
    return AfterCue(in_order.in_order(scene, facts.order, standing=True), [facts.wall])


def _objects_slots(scene: Scene) -> Slots:
    count = len(ObjectsFacts.of(scene).order)
    return OBJECTS_TEXT.slots("wall", f"objects.{by_count(count)}", word=NUMBERS[count])


OBJECTS = Task(
    name="Observe_Objects_Click_Memory",
    category="MIP",
    levels=levels(candidates=1),
    draw=_draw_objects,
    goal=_objects_goal,
    plan=lambda scene: (HOLD_STILL, *in_order.clicks(scene, ObjectsFacts.of(scene).order)),
    templates=OBJECTS_TEXT.templates,
    slots=_objects_slots,
    summary="Remember the row of objects shown and click the same ones in that order.",
    success=(
        "After the wall has come, the objects on the table were clicked in the order in which they "
        "were shown from left to right, the gripper on their side being closed; moving before "
        "fails for good."
    ),
)

TURNS = (0.0, -math.pi / 2, math.pi, math.pi / 2)
"""Up, right, down, left: where the bar of the T points, seen from the robot."""
FAR_Y, FAR_X, NEAR_Y, NEAR_X = 0.18, 0.20, -0.10, 0.21
LOW = 0.014
"""A turned block is lower than this [m] above the table (official: z < 0.77, from 0.756 on)."""
FULL_TURN = 0.2
"""Only this far [m] from the middle or more can the expert make half a turn at once."""


@dataclass(frozen=True)
class TurnedFacts(SceneFacts):
    """Both rows, how the far and the near blocks lie (indices of TURNS), and the wall."""

    near: tuple[str, ...]
    far: tuple[str, ...]
    turns: tuple[int, ...]
    start: tuple[int, ...]
    wall: str


def _draw_turned(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Two rows; a near block never lies as its partner does. All blocks of a row look alike."""
    shown = [int(i) for i in rng.integers(4, size=level)]
    start = [(turn + int(rng.integers(1, 4))) % 4 for turn in shown]
    far_kind = int(rng.integers(2))
    variant = int(rng.integers(objects.variant_count("t_block")))
    items = [wall(0.10)]
    for role, most, y, kind, turns in (
        ("far", FAR_X, FAR_Y, far_kind, shown),
        ("near", NEAR_X, NEAR_Y, 1 - far_kind, start),
    ):
        look = {"look": variant, "kind": kind}
        for x, turn in zip(row(level, most), turns, strict=True):
            items.append(table.thing(role, "t_block", (x, y), look, TURNS[turn]))
    return table.sample(rng, items, TurnedFacts, turns=tuple(shown), start=tuple(start))


def _turned_goal(scene: Scene) -> AfterCue:
    facts = TurnedFacts.of(scene)
    wanted = [
        OrientationTarget(name, yaw_rotation(TURNS[turn]), scene.table_top + LOW)
        for name, turn in zip(facts.near, facts.turns, strict=True)
    ]
    return AfterCue(restore(wanted, facts.far), [facts.wall])


def _turned_plan(scene: Scene) -> tuple[Skill, ...]:
    """Hold still, then turn the near blocks from left to right.

    Where the wrist cannot, half a turn is made of two quarters.
    """
    skills: list[Skill] = [HOLD_STILL]
    facts = TurnedFacts.of(scene)
    for name, start, turn in zip(facts.near, facts.start, facts.turns, strict=True):
        place, arm = scene.object(name).pose.position, table.side_of(scene, name)
        half = (turn - start) % 4 == 2 and abs(place[0]) < FULL_TURN
        for way in ((start + 1) % 4, turn) if half else (turn,):
            skills.append(Pick(name, lift=0.08, arm=arm))
            skills.append(Place(name, place, yaw=TURNS[way], arm=arm))
    return (*skills, Home())


def _turned_slots(scene: Scene) -> Slots:
    count = len(TurnedFacts.of(scene).near)
    some = "one" if count == 1 else "many"
    entries = (f"{slot}.{some}" for slot in ("wall", "near", "far"))
    return TURNED_TEXT.slots(*entries, word=NUMBERS[count])


ORIENTATION = Task(
    name="Remember_Orientation_Restore",
    category="MIP",
    levels=levels(candidates=2),
    draw=_draw_turned,
    goal=_turned_goal,
    plan=_turned_plan,
    templates=TURNED_TEXT.templates,
    slots=_turned_slots,
    summary="Remember how the far blocks lie and turn the near ones the same way.",
    success=(
        "After the wall has come, every near block lies within 3 cm of its place and 15 degrees of "
        "its partner's direction, and both grippers are open; moving before fails for good."
    ),
)


COUNTS_TEXT = TaskText.beside(__file__, "memory_counts.toml")

STAPLER_ROWS = {
    1: (0.0,),
    2: (-0.24, 0.24),
    3: (-0.24, 0.0, 0.24),
    4: (-0.24, -0.08, 0.08, 0.24),
    5: (-0.24, -0.12, 0.0, 0.12, 0.24),
}
"""x of the staplers [m]."""
STAPLERS_Y = (-0.03, 0.04)
"""Range of the row's y [m]: nearer to the robot, the outer staplers would not be in view."""
MOST = 5


@dataclass(frozen=True)
class CountsFacts(SceneFacts):
    """The staplers from left to right, and how often each is pressed."""

    row: tuple[str, ...]
    counts: tuple[int, ...]


def _draw_counts(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    y = rng.uniform(*STAPLERS_Y)
    items = []
    for x in STAPLER_ROWS[level]:
        turn, look = rng.uniform(-math.pi, math.pi), table.draw_variant(rng, "stapler")
        items.append(table.thing("row", "stapler", (x, y), look, turn, fixed=True))
    counts = tuple(int(n) for n in rng.integers(1, MOST + 1, level))
    return table.sample(rng, items, CountsFacts, counts=counts)


def _counts_goal(scene: Scene) -> PressCounts:
    """The row from left to right with its counts; grippers need not be closed (official)."""
    facts = CountsFacts.of(scene)
    return PressCounts([table.presses(scene, name) for name in facts.row], facts.counts)


def _counts_plan(scene: Scene) -> tuple[Skill, ...]:
    facts = CountsFacts.of(scene)
    names = (name for name, n in zip(facts.row, facts.counts, strict=True) for _ in range(n))
    return tuple(Press(name, arm=pressing_arm(scene, name)) for name in names)


def _counts_slots(scene: Scene) -> Slots:
    counts = CountsFacts.of(scene).counts
    if len(counts) == 1:
        return COUNTS_TEXT.slots("stapler") | {"times": _times(counts[0])}
    words = [_times(n)[0][0] for n in counts]
    ranks = [f"the {ordinal(i)[1]} {word}" for i, word in enumerate(words, 1)]
    places = [f"number {i} {word}" for i, word in enumerate(words, 1)]
    each = [f"the {ordinal(i)[1]} one {word}" for i, word in enumerate(words, 1)]
    return COUNTS_TEXT.slots("row") | {
        "counts": (
            (listed(ranks), ", ".join(ranks)),
            (listed(places), ", ".join(places), listed(each)),
        )
    }


def _times(count: int) -> Phrasings:
    return COUNTS_TEXT.phrasings(f"times.{by_count(count)}", count=count, word=NUMBERS[count])


COUNTS = Task(
    name="Press_Stapler_Memory",
    category="MIP",
    levels=table.LEVELS,
    draw=_draw_counts,
    goal=_counts_goal,
    plan=_counts_plan,
    templates=COUNTS_TEXT.templates,
    slots=_counts_slots,
    summary="Press each stapler of the row as often as asked.",
    success=(
        "Every stapler was touched by a gripper near its press point exactly as often as asked, "
        "with at least 0.1 s without a touch between presses."
    ),
)


COVER_TEXT = TaskText.beside(__file__, "memory_cover.toml")

COVER_COLORS = table.first_colors(10)
COVER_ROWS = {
    1: (0.0,),
    2: (-0.20, 0.20),
    3: (-0.20, 0.0, 0.20),
    4: (-0.20, -0.0667, 0.0667, 0.20),
    5: (-0.27, -0.145, -0.02, 0.105, 0.23),
}
"""x of the blocks [m]."""
COVER_Y, COVER_HALF = -0.18, 0.02
BEHIND = 0.13
"""An opened cover's place lies this far [m] behind its block, away from the robot."""
OPEN_BELOW = 0.005
"""An opened cover's origin is lower than this [m]."""


@dataclass(frozen=True)
class CoverFacts(SceneFacts):
    """Colours, covers and blocks in the order in which covers are opened."""

    colors: tuple[str, ...]
    covers: tuple[str, ...]
    blocks: tuple[str, ...]


def _draw_cover(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    chosen = shuffled(rng, list(COVER_COLORS))[:level]
    order = tuple(shuffled(rng, chosen))
    items = []
    for color, x in zip(chosen, COVER_ROWS[level], strict=True):
        at, turn, rgb = (x, COVER_Y), order.index(color), COVER_COLORS[color]
        items.append(table.block(f"blocks {turn}", at, COVER_HALF, rgb, fixed=True))
        pose = table.standing(at)
        items.append(table.Item(f"covers {turn}", "cover", pose, appears_at=HIDDEN_AT))
    return table.sample(rng, items, CoverFacts, colors=order)


def _open_places(scene: Scene) -> dict[str, Point]:
    """Where each cover goes, in the asked order."""
    facts = CoverFacts.of(scene)
    at = (scene.object(block).pose.position for block in facts.blocks)
    return {cover: (x, y + BEHIND) for cover, (x, y, _) in zip(facts.covers, at, strict=True)}


def _cover_goal(scene: Scene) -> AfterCue:
    below = scene.table_top + OPEN_BELOW
    return uncover([Cover(name, place, below) for name, place in _open_places(scene).items()])


def _cover_plan(scene: Scene) -> tuple[Skill, ...]:
    skills: list[Skill] = [Wait(HIDDEN_AT + 0.6)]
    for name, (x, y) in _open_places(scene).items():
        skills += table.moved(name, (x, y, scene.table_top), table.side(x))
    return (*skills, Home())


def _cover_slots(scene: Scene) -> Slots:
    colors = CoverFacts.of(scene).colors
    if len(colors) == 1:
        return COVER_TEXT.slots("where", "block", color=colors[0])
    return COVER_TEXT.slots("where") | {"order": color_orders(colors)}


COVER = Task(
    name="Remember_Color_Cover",
    category="MIP",
    levels=levels(candidates=1),
    draw=_draw_cover,
    goal=_cover_goal,
    plan=_cover_plan,
    templates=COVER_TEXT.templates,
    slots=_cover_slots,
    summary="Remember the colours under the covers and open them in the asked order.",
    success=(
        "After the covers have appeared, each was put 13 cm behind its block in the asked order; "
        "moving before, opening one too early or moving an opened one fails for good."
    ),
)
