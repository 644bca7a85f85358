"""Pick Blocks Size (GAC): among cubes of different sizes, pick the one of the named size rank.

All cubes of a scene share one colour; rank 1 is the largest. Rank, place, name and order of the
cubes are independent, so only size tells the target.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from robospa.tasks.geometry import Array, Pose, yaw_rotation
from robospa.tasks.goals.pick import Lift
from robospa.tasks.instructions import words_spatial
from robospa.tasks.instructions.words import Slots
from robospa.tasks.layouts import Area, Mask, Points, in_head_view, scatter, spread
from robospa.tasks.scene import TABLE_TOP, Scene, SceneObject
from robospa.tasks.task import Draft, Level, Task
from robospa.tasks.variants.picking import lifted, pick_target

HALF_EDGES = (
    (0.032, 0.033),
    (0.027, 0.028),
    (0.022, 0.023),
    (0.017, 0.018),
    (0.014, 0.015),
    (0.009, 0.010),
)
"""Range of the half edge [m] of each rank."""
DISC = ((0.0, -0.12), 0.015)
"""No block lies within this squared radius [m2] of this point."""
TRIES = 40


def _tight_row(points: Points) -> bool:
    """Three blocks in one tight row, left to right: too hard to get between."""
    row = sorted(points)
    pairs = list(itertools.pairwise(row))
    return all(b[0] - a[0] < 0.13 and abs(b[1] - a[1]) < 0.035 for a, b in pairs)


def _wide(x: float, y: float) -> Callable[[Points], bool]:
    return lambda ps: spread([p[0] for p in ps]) >= x and spread([p[1] for p in ps]) >= y


@dataclass(frozen=True)
class Layout:
    """How the blocks of a level are scattered [m, rad].

    A block's first candidate comes from `first`, later ones from `redraw`; `margin` is added to
    the two half edges for the least centre distance; |x| below `band` is refused.
    """

    first: Area
    redraw: Area
    margin: float
    band: float
    yaw: float
    accept: Callable[[Points], bool] = lambda points: True


_BOX = Area((-0.22, 0.22), (-0.15, 0.10), True)
LAYOUTS = {
    1: Layout(_BOX, Area((-0.25, 0.25), (-0.01, 0.11), True), 0.055, 0.04, 0.6),
    2: Layout(
        Area((-0.27, 0.27), (-0.15, 0.10), True),
        Area((-0.22, 0.22), (-0.01, 0.11), True),
        0.055,
        0.04,
        0.6,
        lambda points: not _tight_row(points),
    ),
    3: Layout(_BOX, _BOX, 0.04, 0.02, 0.35, _wide(0.14, 0.03)),
    4: Layout(_BOX, _BOX, 0.08, 0.02, 0.35, _wide(0.15, 0.04)),
    5: Layout(_BOX, Area((-0.31, 0.31), (-0.02, 0.13), True), 0.052, 0.035, 0.6, _wide(0.24, 0.08)),
}


def draw(level: int, rng: np.random.Generator) -> Draft:
    """Blocks of the first n ranks in random order, scattered, and a uniform target rank."""
    count = LEVELS[level].candidates
    layout = LAYOUTS[level]
    ranks = [int(r) + 1 for r in rng.permutation(count)]
    halves = [float(rng.uniform(*HALF_EDGES[r - 1])) for r in ranks]
    color = [round(float(c), 4) for c in rng.random(3)]
    edge = np.array(halves)[:, None]

    def propose(rng: np.random.Generator) -> tuple[Array, Array, Mask]:
        x, y = layout.redraw.draw(rng, (count, TRIES))
        x[:, :1], y[:, :1] = layout.first.draw(rng, (count, 1))
        (dx, dy), square = DISC
        usable = (np.abs(x) >= layout.band) & ((x - dx) ** 2 + (y - dy) ** 2 >= square)
        return x, y, usable & in_head_view(x, y, edge * 1.42, edge * 2)

    apart = [[a + b + layout.margin for b in halves] for a in halves]
    points = scatter(rng, propose, apart, layout.accept)
    yaws = rng.uniform(-layout.yaw, layout.yaw, count)
    objects = tuple(
        SceneObject(
            f"object_{i}",
            "block",
            Pose((points[i][0], points[i][1], TABLE_TOP + halves[i]), yaw_rotation(float(yaws[i]))),
            {"half": [halves[i]] * 3, "color": color},
        )
        for i in range(count)
    )
    target = int(rng.integers(count))
    return Draft(objects, {"target": f"object_{target}", "size_rank": ranks[target]})


def slots(scene: Scene) -> Slots:
    """What the instruction says: which block."""
    return words_spatial.size(int(scene.facts["size_rank"]), len(scene.objects))


LEVELS: Mapping[int, Level] = {k: Level(k + 1, 1, 150) for k in range(1, 6)}

TASK = Task(
    name="Pick_Blocks_Size",
    category="GAC",
    levels=LEVELS,
    draw=draw,
    goal=lifted(Lift(above=0.82)),
    plan=pick_target,
    slots=slots,
    summary="Pick the block of the named size rank among 2 to 6 blocks of one colour.",
    success="the target's centre is higher than 0.82 m while a gripper carries it",
)
