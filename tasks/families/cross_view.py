"""Pick * Multi View (CVR) and Basic Position * (EPG): the extreme object as seen from a named side.

Objects lie free on the table. One of four extremes (leftmost, rightmost, farthest, nearest) is
asked for in the words of a viewer: the robot, one opposite, one at the left and one at the right of
the table; in the basic tasks always the robot, a reference for how much of the difficulty lies in
taking a viewpoint. Viewpoints exist in words only; no image shows them. There are three sets of
equal objects and two of seven different ones. Spacings are the official ones, those of the largest
kind where objects differ: the place then tells nothing about what lies there.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Array
from robospa.tasks.families import table
from robospa.tasks.goals.lifting import Lift
from robospa.tasks.instructions import Slots, TaskText
from robospa.tasks.sampling.places import Fits, LayoutError, Mask, pool, walk
from robospa.tasks.sampling.turns import Turnable, turned
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneSample, Task
from robospa.workcell import TABLE_TOP, Workcell

MEANINGS = {"front": "farthest from", "back": "nearest to"}
"""What the extremes in depth mean, said of the viewer (official: front is far)."""

TEXT = TaskText.beside(__file__, "cross_view.toml")

OBJECTS = {1: 3, 2: 4, 3: 5, 4: 6, 5: 7}
"""How many objects lie there; the paper's n counts the at most four extreme ones."""
PIXELS = 60.0
"""Least distance of two different objects' centres in the head image [px]."""
MARGIN = (0.05, 0.05)
LEAD = 0.061
"""Every extreme object leads the next one by this [m] in x and in y, where there is room, whichever
is asked for: if only the asked one led (officially, by 0.06), its place alone would tell it."""
LAYOUTS = 100
"""Layouts that are drawn until the objects lie free of each other in one."""
SHIFT = 0.02
"""A layout's places are moved once more by up to this [m] in each trial, where they fit."""
CHAINS = 256
"""Random walks that the layouts of a level come from."""
STARTS = (
    ((-239, -8), (196, 28), (-166, 92), (-158, -178), (-67, -82), (19, 24), (94, -81)),
    ((-232, -86), (186, -10), (113, 92), (106, -171), (15, -2), (-164, 18), (-69, -104)),
    ((-233, 10), (188, -6), (117, 90), (-166, -174), (-119, 2), (2, -8), (84, -109)),
    ((-232, -4), (198, 28), (-160, 90), (133, -178), (-126, -98), (-42, 12), (82, 14)),
    ((-233, -90), (166, -104), (-40, 81), (-111, -168), (-154, 8), (2, -98), (96, 18)),
    ((-187, -46), (184, -23), (55, 42), (-124, -168), (57, -104), (-64, -59)),
    ((-186, -109), (184, -33), (-115, 34), (118, -172), (-58, -108), (62, -65)),
    ((-187, -40), (185, -35), (-18, 40), (119, -172), (-58, -99), (65, -73)),
    ((-186, -86), (182, -40), (-91, 40), (58, -171), (54, -24), (-66, -105)),
    ((-187, -88), (184, -39), (-43, 42), (96, -170), (-58, -107), (61, -52)),
    ((-187, -58), (167, -113), (-94, 42), (-119, -168), (14, -115), (104, -10)),
    ((-177, -116), (185, -15), (56, 42), (116, -171), (-26, -117), (-106, -10)),
    ((-187, -13), (175, -69), (107, 40), (-111, -170), (42, -115), (-57, -14)),
    ((-187, -113), (177, -26), (-124, 42), (80, -169), (-55, -116), (46, -10)),
    ((-187, -117), (187, -18), (18, 40), (-42, -169), (-116, -13), (89, -118)),
    ((-181, -11), (165, -115), (-49, 41), (35, -169), (-94, -117), (99, -12)),
    ((-195, -117), (180, -67), (115, 49), (104, -179), (-9, 2), (-132, 0), (-62, -125)),
    ((-194, -55), (186, -2), (-113, 49), (-126, -177), (123, -131), (63, -4), (-1, -129)),
    ((-195, -6), (194, -6), (-75, 50), (126, -176), (3, -118), (70, 4), (-120, -128)),
    ((-196, -134), (194, -7), (72, 51), (-69, -181), (122, -134), (-130, -25), (-3, -77)),
    ((-195, -6), (184, -51), (70, 43), (120, -180), (-130, -129), (-2, -127), (-60, -4)),
    ((-191, 0), (189, -1), (52, 51), (-9, -179), (115, -129), (-128, -129), (-68, 5)),
    ((-187, -139), (176, -64), (102, 40), (100, -170), (-154, 0), (-27, 8), (-49, -136)),
    ((-187, -66), (187, 4), (-105, 36), (-116, -172), (27, -137), (154, -141), (50, 2)),
    ((-187, 9), (177, -59), (94, 42), (107, -172), (-44, 6), (-152, -139), (-24, -136)),
    ((-187, -60), (184, 0), (-74, 41), (-113, -171), (16, -139), (55, 9), (145, -139)),
    ((-187, -136), (173, -70), (104, 38), (71, -172), (-57, -136), (-156, 1), (-27, 1)),
    ((-186, -65), (186, 6), (-110, 42), (-115, -171), (28, 10), (13, -134), (144, -133)),
    ((-187, 6), (178, -60), (75, 41), (109, -172), (-153, -137), (-58, 5), (-19, -127)),
)
"""Layouts [mm] where the pools start, the four of EXTREMES first; found by annealing."""

EXTREMES = ("leftmost", "rightmost", "frontmost", "backmost")
"""In the robot's frame: least x, largest x, largest y (far), least y (near)."""
VIEWS = ("robot", "opposite", "left", "right")
SEEN_AS = {
    "robot": EXTREMES,
    "opposite": ("rightmost", "leftmost", "backmost", "frontmost"),
    "left": ("backmost", "frontmost", "leftmost", "rightmost"),
    "right": ("frontmost", "backmost", "rightmost", "leftmost"),
}
"""How a viewer names the four extremes; front is the side away from the viewer."""


@dataclass(frozen=True)
class ObjectSpread:
    """The data of one task: equal objects if there is one asset, else different ones.

    `radius` and `tall` bound the objects [m] in view, where their turns do not. Two of them are
    apart by `spacing`: in x or in y, and in any case. `inset` keeps the origins that far inside the
    region. In the head image centres of different objects are 60 px apart; equal ones, taken to be
    of radius `seen`, do not overlap. `leads` are the levels' least leads in x and y.
    """

    kind: str
    assets: tuple[str, ...]
    what: str
    radius: float
    tall: float
    spacing: tuple[float, float, float]
    inset: float = 0.0
    seen: float = 0.0
    leads: tuple[tuple[float, float], ...] = ((LEAD, LEAD),) * 5

    @property
    def alike(self) -> bool:
        return len(self.assets) == 1

    def allowed(self, workcell: Workcell, x: Array, y: Array) -> Mask:
        """Whether origins are in the official region with the whole object in view."""
        inside = (np.abs(x) <= 0.24 - self.inset) & (y >= -0.225 + self.inset)
        inside &= y <= 0.095 - self.inset
        return inside & workcell.in_view(x, y, self.radius, self.tall, MARGIN)

    def apart(self, workcell: Workcell, points: Array, moved_to: Array, i: int) -> Mask:
        """Whether `moved_to` is far enough from its chain's other places, on table and image."""
        dx = np.abs(points[..., 0] - moved_to[:, None, 0])
        dy = np.abs(points[..., 1] - moved_to[:, None, 1])
        free = ((dx >= self.spacing[0]) | (dy >= self.spacing[1])) & (
            dx**2 + dy**2 >= self.spacing[2] ** 2
        )
        if self.alike:
            left, right, top, bottom = self._box(workcell, points[..., 0], points[..., 1])
            wl, wr, wt, wb = self._box(workcell, moved_to[:, :1], moved_to[:, 1:])
            free &= (left >= wr) | (wl >= right) | (top >= wb) | (wt >= bottom)
        else:
            middle = TABLE_TOP + self.tall / 2
            u, v = workcell.head.pixel(points[..., 0], points[..., 1], middle)
            wu, wv = workcell.head.pixel(moved_to[:, :1], moved_to[:, 1:], middle)
            free &= (u - wu) ** 2 + (v - wv) ** 2 >= PIXELS**2
        free[:, i] = True
        return np.asarray(free.all(axis=1))

    def _box(self, workcell: Workcell, x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
        """Left, right, top and bottom [px] of the upright cylinders that bound the objects."""
        return workcell.head.box(x, y, self.seen, TABLE_TOP, TABLE_TOP + self.tall)


AXES = np.array([0, 0, 1, 1])
SIGNS = np.array([-1.0, 1.0, 1.0, -1.0])
"""For each of EXTREMES the axis along which it leads, and which way."""


def leaders(points: Array) -> tuple[NDArray[np.int64], Array]:
    """Which place each of EXTREMES is in layouts (..., n, 2), and by how much [m] it leads."""
    along = SIGNS * points[..., AXES]
    ordered = np.sort(along, axis=-2)
    return along.argmax(axis=-2), ordered[..., -1, :] - ordered[..., -2, :]


def fits(workcell: Workcell, spread: ObjectSpread, level: int, roles: NDArray[np.int64]) -> Fits:
    """The rule of layouts in which place `roles[chain, e]` is the e-th of EXTREMES.

    It must be so in the head image as well, where perspective could put another object outermost.
    """
    middle = TABLE_TOP + spread.tall / 2
    least = np.array(spread.leads[level - 1])[AXES]

    def rule(points: Array, moved_to: Array, i: int) -> Mask:
        good = spread.allowed(workcell, moved_to[:, 0], moved_to[:, 1])
        good[good] = spread.apart(workcell, points[good], moved_to[good], i)
        moved, asked = points[good], np.broadcast_to(roles, (len(points), 4))[good]
        moved[:, i] = moved_to[good]
        place, lead = leaders(moved)
        u, v = workcell.head.pixel(moved[..., 0], moved[..., 1], middle)
        seen = leaders(np.stack([u, -v], axis=-1))[0]
        good[good] = ((place == asked) & (seen == asked) & (lead >= least)).all(axis=1)
        return np.asarray(good)

    return rule


def _starts(workcell: Workcell, spread: ObjectSpread, level: int) -> list[Array]:
    """Start layouts of the level's size, no object extreme more often than it must be.

    LayoutError if none keeps to the rule.
    """
    count = OBJECTS[level]
    good = []
    for layout in (np.array(places) / 1000 for places in STARTS if len(places) >= count):
        parts = [layout[:count]] if count > 3 else [np.delete(layout[:4], k, 0) for k in range(4)]
        for part in parts:
            roles = leaders(part)[0]
            rule = fits(workcell, spread, level, roles[None])
            whole = len(set(roles.tolist())) == min(count, 4)
            if whole and all(rule(part[None], part[None, i], i).all() for i in range(count)):
                good.append(part)
    if not good:
        raise LayoutError(f"no start layout fits {spread.kind} level {level}; add one to STARTS")
    return good


@cache
def layouts(workcell: Workcell, spread: ObjectSpread, level: int) -> Array:
    """The level's layouts (many, n, 2) [m]; which place is extreme differs between them."""
    good = _starts(workcell, spread, level)
    starts = np.stack([good[k % len(good)] for k in range(CHAINS)])
    found = pool(starts, fits(workcell, spread, level, leaders(starts)[0]))
    return found.reshape(-1, *starts.shape[1:])


@dataclass(frozen=True)
class Facts(table.PickFacts):
    """Target, viewer, and the extreme in the robot's frame and in the viewer's words."""

    extreme: str
    viewpoint: str
    position: str


def draw(
    level: int,
    rng: np.random.Generator,
    workcell: Workcell,
    spread: ObjectSpread,
    views: tuple[str, ...],
) -> SceneSample:
    """A uniform viewpoint of `views`, a layout, what lies where, and one of the objects that are
    extreme there, each equally likely: the scene does not tell which."""
    count = OBJECTS[level]
    view = views[int(rng.integers(len(views)))]
    known = layouts(workcell, spread, level)
    if spread.alike:
        things = [(spread.assets[0], table.draw_params(rng, spread.assets[0]))] * count
    else:
        kinds = [spread.assets[int(i)] for i in rng.permutation(len(spread.assets))[:count]]
        things = [(kind, table.draw_params(rng, kind)) for kind in kinds]

    def lying() -> tuple[tuple[Array, list[int]], list[Turnable]]:
        points = known[int(rng.integers(len(known)))][None].copy()
        walk(rng, points, fits(workcell, spread, level, leaders(points)[0]), SHIFT)
        order = [int(i) for i in rng.permutation(count)]
        return (points[0], order), [
            Turnable(asset, params, (x, y), 0.75 if asset == "block" else math.pi)
            for (asset, params), (x, y) in zip(things, points[0][order].tolist(), strict=True)
        ]

    (points, order), items, yaws = turned(rng, workcell, lying, MARGIN, LAYOUTS)
    roles = leaders(points[None])[0]
    asked = int(rng.choice(np.unique(roles)))
    extreme = int(rng.choice(np.flatnonzero(roles[0] == asked)))
    facts = Facts(
        target=f"object_{order.index(asked)}",
        extreme=EXTREMES[extreme],
        viewpoint=view,
        position=SEEN_AS[view][extreme],
    )
    return SceneSample(table.put_down(items, yaws), facts)


def slots(scene: Scene) -> Slots:
    """What the instruction says: the extreme in the viewer's words, and the viewer."""
    facts = Facts.of(scene)
    position, view = facts.position, facts.viewpoint
    side = position.removesuffix("most")
    kind = "in_depth" if side in MEANINGS else "sideways"
    words = {"position": position, "side": side, "meaning": MEANINGS.get(side, "")}
    return TEXT.slots(f"target.{kind}", f"view.{view}", **words)


def lead(scene: Scene) -> float:
    """By how much [m] the asked object is more extreme than any other."""
    facts = Facts.of(scene)
    k = EXTREMES.index(facts.extreme)
    along = {item.name: float(SIGNS[k] * item.pose.position[AXES[k]]) for item in scene.objects}
    return along.pop(facts.target) - max(along.values())


def spread_task(spread: ObjectSpread, basic: bool = False) -> Task:
    """The CVR task of `spread` or, if `basic`, the EPG one, where the robot is the viewer."""
    kind = spread.kind
    seen, views = ("the robot", VIEWS[:1]) if basic else ("a named side", VIEWS)
    return Task(
        name=f"Basic_Position_{kind}" if basic else table.pick_name(kind, "Multi_View"),
        category="EPG" if basic else "CVR",
        levels={k: Level(min(n, 4), 1, 150) for k, n in OBJECTS.items()},
        draw=lambda level, rng, workcell: draw(level, rng, workcell, spread, views),
        goal=table.lifted(Lift(rise=0.06, closed=True, touching=True)),
        plan=table.pick_target,
        templates=TEXT.templates,
        slots=slots,
        summary=f"Pick the extreme one of 3 to 7 {spread.what} as seen from {seen}.",
        success="the target rose by more than 6 cm, touched by a gripper and carried by a closed "
        "one",
        lead=lead,
    )


SPREADS = (
    ObjectSpread(
        "Sauce_Can",
        ("sauce_can",),
        "equal sauce cans",
        0.0425,
        0.117,
        (0.098, 0.092, 0.103),
        seen=0.0405,
    ),
    ObjectSpread(
        "Seals", ("seal",), "equal seals", 0.0305, 0.0964, (0.094, 0.086, 0.099), seen=0.0270
    ),
    ObjectSpread(
        "Breads",
        ("bread",),
        "equal pieces of bread",
        0.0475,
        0.063,
        (0.112, 0.092, 0.105),
        seen=0.041,
    ),
    ObjectSpread(
        "Mixed_Objects_A",
        ("block", "bread", "seal", "toycar", "phone", "rubikscube", "remote_control"),
        "different objects",
        0.052,
        0.08,
        (0.126, 0.098, 0.118),
        inset=0.052,
        leads=(*((LEAD, LEAD),) * 3, (LEAD, 0.045), (0.025, 0.025)),
    ),
    ObjectSpread(
        "Mixed_Objects_B",
        ("stapler", "can", "soap", "tea_box", "mouse", "playing_cards", "bell"),
        "different objects",
        0.0435,
        0.099,
        (0.118, 0.092, 0.104),
        inset=0.0435,
        leads=(*((LEAD, LEAD),) * 4, (LEAD, 0.04)),
    ),
)

TASKS = tuple(spread_task(spread) for spread in SPREADS)
BASIC = tuple(spread_task(spread, basic=True) for spread in SPREADS)
