"""Pick * Relational (RRR): pick the object beside a named one, in a named direction.

Objects lie in straight rows and columns. The reference is named by its place in the layout, the
target by its direction from there; it is always the next one in that direction. Front is the side
away from the robot. There are three sets of equal objects (tea boxes, cans, soap bars) and two of
nine different ones; spacings and pitches are the official ones.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from robospa.geometry import Array
from robospa.tasks.families import table
from robospa.tasks.goals.lifting import Lift
from robospa.tasks.instructions import Slots, TaskText
from robospa.tasks.sampling.grid import StraightLines
from robospa.tasks.sampling.turns import Turnable, turned
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "relational.toml")

MARGIN = (0.06, 0.08)
"""Centres are this far inside the head image (official)."""
EDGE = (0.02, 0.02)
"""Whole objects are this far inside."""
LAYOUTS = 200
"""Layouts that are drawn until the objects lie free of each other in one."""
_ALONG = {"left": (-1, 0), "right": (1, 0), "front": (0, 1), "back": (0, -1)}
DIRECTIONS: Mapping[str, tuple[int, int]] = _ALONG | {
    f"{depth}_{side}": (_ALONG[side][0], _ALONG[depth][1])
    for depth in ("front", "back")
    for side in ("left", "right")
}
"""Steps in columns (to the right) and rows (away from the robot)."""


@dataclass(frozen=True)
class SlotGrid:
    """A level's slots: how many are used, and ranges [m] that all tasks share.

    `jitter` is that of a whole column or row, `scale` the factor on the spacings of the objects.
    """

    count: int
    columns: int
    rows: int
    jitter: tuple[float, float]
    x: tuple[float, float]
    y: tuple[float, float]
    scale: float

    @property
    def cells(self) -> list[tuple[int, int]]:
        """(column, row) of every slot, row by row from the robot."""
        return [(c, r) for r in range(self.rows) for c in range(self.columns)]


_SMALL = (2, 2, (0.014, 0.012), (-0.205, 0.205), (-0.195, 0.035), 0.78)
SHAPES = {
    1: SlotGrid(2, *_SMALL),
    2: SlotGrid(3, *_SMALL),
    3: SlotGrid(4, *_SMALL),
    4: SlotGrid(6, 3, 2, (0.018, 0.012), (-0.225, 0.225), (-0.205, 0.045), 0.92),
    5: SlotGrid(9, 3, 3, (0.016, 0.014), (-0.228, 0.228), (-0.215, 0.075), 0.86),
}

Pitches = tuple[tuple[float, float], tuple[float, float]]
Spacing = tuple[float, float, float]
"""Least distance [m] of columns, of rows and of any two objects."""


@dataclass(frozen=True)
class SpacedKind:
    """One kind of object and its official spacing; yaws are uniform in +-`half_range` [rad]."""

    asset: str
    spacing: Spacing
    half_range: float = math.pi


@dataclass(frozen=True)
class Crowd:
    """The data of one task. With one family all objects look alike, else each is of another one.

    `pitches`: ranges of the distances of columns and of rows [m] on 2 x 2, 3 x 2 and 3 x 3 slots.
    Any two objects keep apart by their spacing, and are turned so that they do not touch. `wording`
    is the set of templates: "noun" or, for the official sentences about soap, "soap".
    """

    kind: str
    noun: str
    families: tuple[SpacedKind, ...]
    pitches: tuple[Pitches, ...]
    what: str
    wording: str = "noun"

    @property
    def alike(self) -> bool:
        return len(self.families) == 1


@cache
def weights(level: int) -> Array:
    """How likely each (direction, target slot) is: uniform over directions and over slots.

    Balanced by alternate scaling. The official draw (direction, then reference) favours the
    middle of the grid, so that a guess without reading could beat chance.
    """
    shape = SHAPES[level]
    chances = np.array(
        [
            [float((c - dx, r - dy) in shape.cells) for c, r in shape.cells]
            for dx, dy in DIRECTIONS.values()
        ]
    )
    for _ in range(200):
        chances /= chances.sum(axis=1, keepdims=True) * chances.shape[0]
        chances /= chances.sum(axis=0, keepdims=True) * chances.shape[1]
    return chances


def _places(
    workcell: Workcell,
    crowd: Crowd,
    shape: SlotGrid,
    families: Sequence[SpacedKind],
    used: list[tuple[int, int]],
    rng: np.random.Generator,
) -> Array:
    """Where the used slots lie: (count, 2) [m]; LayoutError if nothing fits."""
    pitch = crowd.pitches[shape.columns + shape.rows - 4]
    gap_x, gap_y = (round(shape.scale * max(f.spacing[k] for f in families), 4) for k in (0, 1))
    lines = StraightLines(pitch, shape.jitter, (gap_x, gap_y), shape.x, shape.y)
    spacing = np.array([f.spacing[2] for f in families]) * (shape.scale if crowd.alike else 1.0)
    least = np.maximum(spacing[:, None], spacing)  # of each two centres
    np.fill_diagonal(least, 0.0)
    return lines.places(
        rng,
        used,
        least,
        lambda at: bool(workcell.in_view(at[:, 0], at[:, 1], 0.0, 0.0, MARGIN).all()),
    )


def _label(shape: SlotGrid, slot: tuple[int, int], used: list[tuple[int, int]]) -> str:
    """Name of a slot in the layout, unique in it: "front_left", "center", "left"..."""
    columns, rows = {c for c, _ in used}, {r for _, r in used}
    side = ("left", "middle", "right") if shape.columns == 3 else ("left", "right")
    depth = ("back", "middle", "front") if shape.rows == 3 else ("back", "front")
    if len(rows) == 1:
        return side[slot[0]]
    if len(columns) == 1:
        return depth[slot[1]]
    if side[slot[0]] == depth[slot[1]] == "middle":
        return "center"
    return f"{depth[slot[1]]}_{side[slot[0]]}"


@dataclass(frozen=True)
class Facts(table.PickFacts):
    """Target, its direction from the reference, and the name of the reference's place."""

    reference: str
    relation: str
    reference_label: str


def label_in(scene: Scene, name: str) -> str:
    """How the place of an object is called in the layout of `scene`, whose lines are straight."""
    at = {item.name: item.pose.position for item in scene.objects}
    x, y = [sorted({round(p[k], 4) for p in at.values()}) for k in (0, 1)]
    cells = {n: (x.index(round(p[0], 4)), y.index(round(p[1], 4))) for n, p in at.items()}
    return _label(SHAPES[scene.level], cells[name], list(cells.values()))


def draw(level: int, rng: np.random.Generator, workcell: Workcell, crowd: Crowd) -> SceneSample:
    """Direction and target slot, other slots, a straight layout, turns."""
    shape = SHAPES[level]
    cells, chances = shape.cells, weights(level).ravel()
    pick = min(int(np.searchsorted(np.cumsum(chances), rng.random())), len(chances) - 1)
    direction = list(DIRECTIONS)[pick // len(cells)]
    target = cells[pick % len(cells)]
    dx, dy = DIRECTIONS[direction]
    reference = (target[0] - dx, target[1] - dy)
    rest = [s for s in cells if s not in (target, reference)]
    others = [rest[int(i)] for i in rng.permutation(len(rest))]
    # Three in a corner shape: a diagonal never asks for the corner, so the other directions
    # have to, in two of three scenes; else a guesser would leave the corner out.
    corner = shape.count == 3 and all(a != b for a, b in zip(target, others[0], strict=True))
    if corner and rng.random() < 1 / 3:
        others.reverse()
    used = [target, reference, *others][: shape.count]
    used = [used[int(i)] for i in rng.permutation(len(used))]
    families = crowd.families * len(used)
    if not crowd.alike:
        order = rng.permutation(len(crowd.families))[: len(used)]
        families = tuple(crowd.families[int(i)] for i in order)
    families = families[: len(used)]
    params = [table.draw_params(rng, f.asset) for f in families[: 1 if crowd.alike else None]]
    params = params * (len(families) if crowd.alike else 1)

    def lying() -> tuple[None, list[Turnable]]:
        points = _places(workcell, crowd, shape, families, used, rng).tolist()
        return None, [
            Turnable(family.asset, own, (x, y), family.half_range)
            for family, own, (x, y) in zip(families, params, points, strict=True)
        ]

    _, items, yaws = turned(rng, workcell, lying, EDGE, LAYOUTS)
    facts = Facts(
        target=f"object_{used.index(target)}",
        reference=f"object_{used.index(reference)}",
        relation=direction,
        reference_label=_label(shape, reference, used),
    )
    return SceneSample(table.put_down(items, yaws), facts)


def _slots(scene: Scene, noun: str) -> Slots:
    """Phrasings for the target's direction and for the place of the reference.

    From level 2 on an axis neighbour is "directly" there (official wording); from level 4 on a
    diagonal neighbour is "immediately" there, because another object may lie further out on the
    same side.
    """
    facts = Facts.of(scene)
    side, label = (text.replace("_", "-") for text in (facts.relation, facts.reference_label))
    how = ""
    if "-" in side:
        how = "immediately " if scene.level >= 4 else ""
    elif scene.level >= 2:
        how = "directly "
    where = label.replace("-", " ")
    at = {"left": "on the left", "right": "on the right", "center": "in the center"}.get(
        where, f"at the {where}"
    )
    plain = TEXT.phrasings(f"noun.{noun}")[0][0]
    return TEXT.slots("convention", f"noun.{noun}") | {
        "relation": TEXT.phrasings("relation", how=how, side=side),
        "reference": TEXT.phrasings("reference", label=label, at=at, noun=plain),
    }


def crowd_task(crowd: Crowd) -> Task:
    """The RRR task of `crowd`."""
    return Task(
        name=table.pick_name(crowd.kind, "Relational"),
        category="RRR",
        levels={k: Level(s.count, 1, 150) for k, s in SHAPES.items()},
        draw=lambda level, rng, workcell: draw(level, rng, workcell, crowd),
        goal=table.lifted(Lift(rise=0.06, closed=True)),
        plan=table.pick_target,
        templates=lambda level: TEXT.templates(level, crowd.wording),
        slots=lambda scene: _slots(scene, crowd.noun),
        summary=f"Pick the one next to a named one among 2 to 9 {crowd.what}, in one of eight "
        "directions.",
        success="the target rose by more than 6 cm, carried by a closed gripper",
    )


TEA_BOX = SpacedKind("tea_box", (0.108, 0.090, 0.098))
CAN = SpacedKind("can", (0.102, 0.088, 0.095))
SOAP = SpacedKind("soap", (0.096, 0.082, 0.088))
STAPLER = SpacedKind("stapler", (0.118, 0.092, 0.104))
TOYCAR = SpacedKind("toycar", (0.098, 0.086, 0.090))
SEAL = SpacedKind("seal", (0.094, 0.086, 0.088))
BELL = SpacedKind("bell", (0.090, 0.090, 0.086))
BLOCK = SpacedKind("block", (0.095, 0.095, 0.095), half_range=0.75)
CUBE = SpacedKind("rubikscube", (0.094, 0.094, 0.092))
MOUSE = SpacedKind("mouse", (0.100, 0.082, 0.090))
CARDS = SpacedKind("playing_cards", (0.090, 0.078, 0.084))
REMOTE = SpacedKind("remote_control", (0.124, 0.078, 0.104))


def _pitches(*least: tuple[float, float]) -> tuple[Pitches, ...]:
    """Those with these least distances; the largest are the same for all objects."""
    largest = ((0.185, 0.17), (0.16, 0.16), (0.132, 0.122))
    return tuple(((a, c), (b, d)) for (a, b), (c, d) in zip(least, largest, strict=True))


CROWDS = (
    Crowd(
        kind="Tea_Box",
        noun="tea_box",
        families=(TEA_BOX,),
        pitches=_pitches((0.0902, 0.085), (0.1054, 0.0888), (0.0969, 0.0814)),
        what="equal tea boxes",
    ),
    Crowd(
        kind="Cans",
        noun="can",
        families=(CAN,),
        pitches=_pitches((0.09, 0.085), (0.0998, 0.087), (0.0917, 0.0797)),
        what="equal cans",
    ),
    Crowd(
        kind="Soaps",
        noun="soap_bar",
        families=(SOAP,),
        pitches=_pitches((0.09, 0.085), (0.0943, 0.082), (0.0866, 0.076)),
        what="equal soap bars",
        wording="soap",
    ),
    Crowd(
        kind="Mixed_Objects_A",
        noun="object",
        families=(BLOCK, CAN, SOAP, STAPLER, TEA_BOX, TOYCAR, SEAL, CUBE, BELL),
        pitches=_pitches((0.098, 0.085), (0.1146, 0.0934), (0.1055, 0.0857)),
        what="different objects",
    ),
    Crowd(
        kind="Mixed_Objects_B",
        noun="object",
        families=(MOUSE, CARDS, REMOTE, CAN, SOAP, STAPLER, TOYCAR, SEAL, BELL),
        pitches=_pitches((0.1027, 0.085), (0.1201, 0.0906), (0.1106, 0.0831)),
        what="different objects",
    ),
)

TASKS = tuple(crowd_task(crowd) for crowd in CROWDS)
