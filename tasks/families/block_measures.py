"""Pick Blocks Size, Height, Length and Area (GAC): pick the block of the named rank in a measure.

All blocks of a scene share one colour and differ in one measure only; rank 1 is the largest. Rank,
place, name and order of the blocks are independent, so only the measure tells the target. Length is
along a block's own x, which but for its turn is from left to right: the shortest blocks are wider
than long. Area is that of the square base; all blocks of a scene are equally high there.
"""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Array, Pose, Vec3, yaw_rotation
from robospa.tasks.families.table import PickFacts, drawn_color, lifted, pick_target
from robospa.tasks.goals.lifting import Lift
from robospa.tasks.instructions import Slots, TaskText, ordinal
from robospa.tasks.sampling.places import Area, Mask, Points, Range, scatter, wide
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import Level, SceneSample, Task
from robospa.workcell import TABLE_TOP, FixedCamera, Workcell

TEXT = TaskText.beside(__file__, "block_measures.toml")

WORDS = {
    "size": ("size", "big each block is", "largest", "smallest"),
    "height": ("height", "tall each block is", "tallest", "shortest"),
    "length": ("length", "long each block is from left to right", "longest", "shortest"),
    "area": ("base area", "much table each block covers", "largest base", "smallest base"),
}
"""How a measure of blocks is called, how it is looked at, and its two ends."""

DISC = ((0.0, -0.12), 0.015)
"""No block lies within this squared radius [m2] of this point."""
LEVELS: Mapping[int, Level] = {k: Level(k + 1, 1, 150) for k in range(1, 6)}


@dataclass(frozen=True)
class Facts(PickFacts):
    """Target, and its rank in the one measure that differs; rank 1 is the largest."""

    size_rank: int = 0
    height_rank: int = 0
    length_rank: int = 0
    area_rank: int = 0

    @property
    def rank(self) -> int:
        """The rank that is asked for, in the measure of the scene."""
        return self.size_rank or self.height_rank or self.length_rank or self.area_rank


def tight_row(points: Points) -> bool:
    """Three blocks in one tight row, left to right: too hard to get between."""
    pairs = list(itertools.pairwise(sorted(points)))
    return all(b[0] - a[0] < 0.13 and abs(b[1] - a[1]) < 0.035 for a, b in pairs)


@dataclass(frozen=True)
class BlockLayout:
    """How the blocks of a level are scattered [m, rad].

    A block's first candidate comes from `first`, later ones from `redraw`; `margin` is added to
    the two blocks' room for the least centre distance; |x| below `band` is refused. A block has
    `tries` candidates before the layout is begun anew.
    """

    first: Area
    redraw: Area
    margin: float
    band: float
    yaw: float
    accept: Callable[[Points], bool] = lambda points: True
    tries: int = 40


_BOX = Area((-0.22, 0.22), (-0.15, 0.10), True)
LAYOUTS = {
    1: BlockLayout(_BOX, Area((-0.25, 0.25), (-0.01, 0.11), True), 0.055, 0.04, 0.6),
    2: BlockLayout(
        Area((-0.27, 0.27), (-0.15, 0.10), True),
        Area((-0.22, 0.22), (-0.01, 0.11), True),
        0.055,
        0.04,
        0.6,
        lambda points: not tight_row(points),
    ),
    3: BlockLayout(_BOX, _BOX, 0.04, 0.02, 0.35, wide(0.14, 0.03)),
    4: BlockLayout(_BOX, _BOX, 0.08, 0.02, 0.35, wide(0.15, 0.04)),
    5: BlockLayout(
        _BOX, Area((-0.31, 0.31), (-0.02, 0.13), True), 0.052, 0.035, 0.6, wide(0.24, 0.08)
    ),
}
"""Those of the tasks about size and area."""

FRONT_TRIES = 160
_FRONT = Area((-0.25, 0.25), (-0.15, 0.05), True)


def front(margin: float, yaw: float, x: float, y: float = 0.0) -> BlockLayout:
    """A level's layout of the tasks about height and length, extending over at least `x`, `y`."""
    return BlockLayout(_FRONT, _FRONT, margin, 0.02, yaw, wide(x, y), tries=FRONT_TRIES)


@dataclass(frozen=True)
class Measure:
    """One measure of blocks, and what follows from it.

    `ranges(level)` are the values [m] of ranks 1, 2, ...; `shared` are ranges of values that all
    blocks of a scene have in common; `half(value, shared, level)` makes the half sizes of a block.
    `room` [m] of a block enters the least centre distances, `seen` (radius, height) [m] the view.
    `visible(camera, points, halves)` refuses layouts in which a block hides another.
    """

    word: str
    ranges: Callable[[int], tuple[Range, ...]]
    half: Callable[[float, tuple[float, ...], int], Vec3]
    room: Callable[[Vec3], float]
    seen: Callable[[Vec3], tuple[float, float]]
    shared: tuple[Range, ...] = ()
    visible: Callable[[FixedCamera, Points, list[Vec3]], bool] = lambda camera, points, halves: True


def diagonal(half: Vec3) -> float:
    """Half the diagonal [m] of a block's base."""
    return math.hypot(half[0], half[1])


def draw(
    level: int, rng: np.random.Generator, workcell: Workcell, measure: Measure, layout: BlockLayout
) -> SceneSample:
    """Blocks of the first n ranks in random order, scattered, and a uniform target rank."""
    ranges = measure.ranges(level)
    count = len(ranges)
    ranks = [int(r) + 1 for r in rng.permutation(count)]
    values = [rng.uniform(*ranges[r - 1]) for r in ranks]
    color = drawn_color(rng)
    shared = tuple(rng.uniform(*r) for r in measure.shared)
    halves = [measure.half(v, shared, level) for v in values]
    radius, height = (np.array(c)[:, None] for c in zip(*map(measure.seen, halves), strict=True))

    def propose(rng: np.random.Generator) -> tuple[Array, Array, Mask]:
        x, y = layout.redraw.draw(rng, (count, layout.tries))
        x[:, :1], y[:, :1] = layout.first.draw(rng, (count, 1))
        (dx, dy), square = DISC
        usable = (np.abs(x) >= layout.band) & ((x - dx) ** 2 + (y - dy) ** 2 >= square)
        return x, y, usable & workcell.in_view(x, y, radius, height)

    rooms = [measure.room(h) for h in halves]
    points = scatter(
        rng,
        propose,
        [[a + b + layout.margin for b in rooms] for a in rooms],
        lambda points: layout.accept(points) and measure.visible(workcell.head, points, halves),
    )
    yaws = rng.uniform(-layout.yaw, layout.yaw, count)
    objects = tuple(
        SceneObject(
            f"object_{i}",
            "block",
            Pose(
                (points[i][0], points[i][1], TABLE_TOP + halves[i][2]), yaw_rotation(float(yaws[i]))
            ),
            {"half": list(halves[i]), "color": color},
        )
        for i in range(count)
    )
    target = int(rng.integers(count))
    rank = {f"{measure.word}_rank": ranks[target]}
    return SceneSample(objects, Facts(f"object_{target}", **rank))


def rank_task(measure: Measure, layouts: Mapping[int, BlockLayout]) -> Task:
    """The task that asks for a block by its rank in `measure`."""
    word = measure.word

    def slots(scene: Scene) -> Slots:
        rank, count = Facts.of(scene).rank, len(scene.objects)
        if count == 2:
            which = "larger" if rank == 1 else "smaller"
        else:
            which = "first" if rank == 1 else "other"
        number, spelled = ordinal(rank)
        said = zip(("measure", "how", "most", "least"), WORDS[word], strict=True)
        fixed: Slots = {slot: ((text,), (text,)) for slot, text in said}
        return fixed | TEXT.slots(f"block.{word}.{which}", number=number, word=spelled)

    return Task(
        name=f"Pick_Blocks_{word.capitalize()}",
        category="GAC",
        levels=LEVELS,
        draw=lambda level, rng, workcell: draw(level, rng, workcell, measure, layouts[level]),
        goal=lifted(Lift(above=0.82)),
        plan=pick_target,
        templates=TEXT.templates,
        slots=slots,
        summary=f"Pick the block of the named {word} rank among 2 to 6 blocks of one colour.",
        success="the target's centre is higher than 0.82 m while a gripper carries it",
    )


def _bands(*least: float) -> tuple[Range, ...]:
    """Ranges [m] of each rank, a millimetre wide."""
    return tuple((low, round(low + 0.001, 3)) for low in least)


HALF_EDGES = _bands(0.032, 0.027, 0.022, 0.017, 0.014, 0.009)
HALF_HEIGHTS = _bands(0.077, 0.060, 0.045, 0.032, 0.021, 0.012)
HALF_LENGTHS = _bands(0.044, 0.033, 0.024, 0.017, 0.012, 0.009)
HALF_BASES = _bands(0.032, 0.027, 0.022, 0.017, 0.012, 0.009)
HALF_SIDE = (0.0155, 0.0165)
"""The two other half sizes [m] of blocks of different height or length, the same in a scene."""
BASE_HALF_HEIGHT = {1: 0.029, 2: 0.027, 3: 0.025, 4: 0.022, 5: 0.020}

HEIGHT_LAYOUTS = {
    1: front(0.04, 0.35, 0.10),
    2: front(0.07, 0.35, 0.12, 0.02),
    3: front(0.07, 0.35, 0.14, 0.03),
    4: front(0.08, 0.35, 0.15, 0.04),
    5: front(0.07, 0.35, 0.18, 0.05),
}
LENGTH_LAYOUTS = {
    1: front(0.045, 0.30, 0.11),
    2: front(0.045, 0.30, 0.13, 0.02),
    3: front(0.045, 0.30, 0.14, 0.03),
    4: front(0.045, 0.35, 0.15, 0.04),
    5: front(0.045, 0.30, 0.18, 0.05),
}


def none_hidden(camera: FixedCamera, points: Points, halves: list[Vec3]) -> bool:
    """Whether the camera sees the top of every block past all blocks that stand before it."""
    blocks = sorted(zip(points, halves, strict=True), key=lambda b: b[0][1])
    return not any(_hides(camera.position, a, b) for a, b in itertools.combinations(blocks, 2))


def _hides(
    eye: Vec3, near: tuple[tuple[float, float], Vec3], far: tuple[tuple[float, float], Vec3]
) -> bool:
    """Whether the line of sight to the middle of `far`'s top meets `near`'s bounding cylinder."""
    (x, y), half = far
    (nx, ny), near_half = near
    radius = diagonal(near_half)
    part = (ny + radius - eye[1]) / (y - eye[1])  # where the line passes the cylinder's far side
    if part > 1 or abs(eye[0] + part * (x - eye[0]) - nx) > radius + half[0]:
        return False
    top = TABLE_TOP + 2 * half[2]
    return eye[2] + part * (top - eye[2]) < TABLE_TOP + 2 * near_half[2]


SIZE = Measure(
    "size",
    ranges=lambda level: HALF_EDGES[: LEVELS[level].candidates],
    half=lambda edge, shared, level: (edge, edge, edge),
    room=lambda half: half[0],
    seen=lambda half: (half[0] * 1.42, half[0] * 2),
)
HEIGHT = Measure(
    "height",
    ranges=lambda level: HALF_HEIGHTS[: LEVELS[level].candidates],
    shared=(HALF_SIDE, HALF_SIDE),
    half=lambda height, shared, level: (shared[0], shared[1], height),
    room=diagonal,
    # Every block keeps the view of the tallest: its height must not tell where it may stand.
    seen=lambda half: (diagonal(half), 2 * HALF_HEIGHTS[0][1]),
    visible=none_hidden,
)
LENGTH = Measure(
    "length",
    ranges=lambda level: HALF_LENGTHS[: LEVELS[level].candidates],
    shared=(HALF_SIDE, HALF_SIDE),
    half=lambda length, shared, level: (length, shared[0], shared[1]),
    room=diagonal,
    seen=lambda half: (diagonal(half), 2 * half[2]),
)
AREA = Measure(
    "area",
    # Level 4 leaves the biggest base out, as the official scenes do.
    ranges=lambda level: HALF_BASES[1:] if level == 4 else HALF_BASES[: LEVELS[level].candidates],
    half=lambda base, shared, level: (base, base, BASE_HALF_HEIGHT[level]),
    room=lambda half: half[0],
    seen=lambda half: (diagonal(half), 2 * half[2]),
)

TASKS = (
    rank_task(SIZE, LAYOUTS),
    rank_task(HEIGHT, HEIGHT_LAYOUTS),
    rank_task(LENGTH, LENGTH_LAYOUTS),
    rank_task(AREA, LAYOUTS),
)
