"""Pick Blocks, Mugs, Pill Bottles and Mixed Objects A, B Distance (SDE): the k-th farthest.

The reference is named, the target is not: it is the k-th farthest from the reference, with k
uniform over the n - 1 ranks. All distances from the reference differ by the level's gap, not only
those beside the asked one, so that nothing in a scene tells which one is asked for. The five sets
of objects also serve the basic tasks that name the target's colour.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from robospa.geometry import Array
from robospa.tasks.colors import NAMED, nearest
from robospa.tasks.families import table
from robospa.tasks.goals.lifting import Lift
from robospa.tasks.instructions import Phrasings, Slots, TaskText, ordinal
from robospa.tasks.objects import object_model
from robospa.tasks.sampling.places import Fits, LayoutError, Mask, keeps_apart, pool, walk
from robospa.tasks.sampling.turns import Turnable, turned
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.shapes import Params
from robospa.tasks.task import Level, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "distance.toml")

Thing = tuple[str, Params | None]
"""Asset and parameters of an object; None for a variant to be drawn."""

CHAINS = 256
"""Random walks that make up the pool; each gives eight layouts."""
SEARCHES = 512
"""Random walks that look for layouts with clear distances, ROUNDS times SWEEPS moves long."""
ROUNDS, SWEEPS = 12, 20
ENOUGH = 64
"""So many of them have to get there, or all rounds have to be over."""
SHIFT = 0.02
"""A layout's places are moved once more by up to this [m] in each trial, where there is room."""
MARGIN = (0.02, 0.02)
"""Whole objects are this far inside the head image."""


COUNTS = (3, 4, 5, 6, 7)


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Where things may lie; the tuples have one value per level.

    `region` is the x and y range [m] of the origins, `radius` and `tall` [m] bound the objects for
    the view, where their turns do not. Origins are at least `apart` [m] from each other and extend
    over at least `extent` (x, y) [m]; distances from the reference differ by `gap` [m]. Layouts are
    found from subsets of the places `starts`.
    """

    counts: tuple[int, ...] = COUNTS
    apart: tuple[float, ...]
    gap: tuple[float, ...]
    region: tuple[tuple[float, float], tuple[float, float]] = ((-0.22, 0.22), (-0.18, 0.08))
    radius: float
    tall: float
    starts: tuple[tuple[float, float], ...]
    extent: tuple[tuple[float, float], ...] = ((0.0, 0.0),) * 5

    @property
    def levels(self) -> dict[int, Level]:
        return {k: Level(count, 1, 150) for k, count in enumerate(self.counts, 1)}


@dataclass(frozen=True)
class ObjectSet:
    """A set of objects and what is drawn with it.

    `things(level, rng)` says what lies at each of the places, the first of which is the
    reference's; `yaw` [rad] bounds the turns. `reference(object)` are the names of the reference
    without article, `noun` is the plain noun of any of the objects.
    """

    name: str
    rules: Rules
    things: Callable[[int, np.random.Generator], Sequence[Thing]]
    reference: Callable[[SceneObject], Phrasings]
    noun: str
    yaw: float = math.pi / 2

    @property
    def what(self) -> str:
        """How many of what lie in its scenes."""
        noun = "different object" if self.noun == "object" else self.noun
        return f"{self.rules.counts[0]} to {self.rules.counts[-1]} {noun}s"


def allowed(workcell: Workcell, rules: Rules, x: Array, y: Array) -> Mask:
    """Whether origins are in the region, with the footprint and the object's axis in view."""
    (left, right), (near, far) = rules.region
    inside = (x >= left) & (x <= right) & (y >= near) & (y <= far)
    return (
        inside & workcell.in_view(x, y, rules.radius, 0.0) & workcell.in_view(x, y, 0.0, rules.tall)
    )


def fits(workcell: Workcell, rules: Rules, level: int) -> Fits:
    """The rule of the level's layouts."""
    least = rules.apart[level - 1]

    def good(points: Array, place: Array, i: int) -> Mask:
        mask = keeps_apart(points, place, i, least)
        return mask & allowed(workcell, rules, place[:, 0], place[:, 1]) if mask.any() else mask

    return good


def starts(rules: Rules, level: int, chains: int) -> Array:
    """(chains, n, 2): random choices of the places to start from."""
    rng = np.random.Generator(np.random.PCG64(level))
    subsets = np.argsort(rng.random((chains, len(rules.starts))), axis=1)
    return np.array(rules.starts)[subsets[:, : rules.counts[level - 1]]]


@cache
def layouts(workcell: Workcell, rules: Rules, level: int) -> Array:
    """The level's layouts (N, n, 2) [m], evenly from all there are."""
    found = np.concatenate(pool(starts(rules, level, CHAINS), fits(workcell, rules, level)))
    return found[[wide(rules, level, points) for points in found]]


def unclear(points: Array, gap: float) -> Array:
    """How much [m] is missing, for layouts (..., n, 2), until all distances from place 0 are clear.

    0 if they differ by at least `gap` [m].
    """
    far = np.sort(distances(points), axis=-1)
    missing: Array = np.maximum(gap - (far[..., 1:] - far[..., :-1]), 0.0).sum(axis=-1)
    return missing


def distances(points: Array) -> Array:
    """(..., n - 1) distances [m] of all places of layouts (..., n, 2) but the first, from it."""
    delta = points[..., 1:, :] - points[..., :1, :]
    x, y = delta[..., 0], delta[..., 1]
    apart: Array = np.sqrt(x * x + y * y)
    return apart


def clearing(workcell: Workcell, rules: Rules, level: int) -> Fits:
    """As `fits`, and no move makes the distances from place 0 less clear than they are."""
    valid, gap = fits(workcell, rules, level), rules.gap[level - 1]

    def good(points: Array, place: Array, i: int) -> Mask:
        mask = valid(points, place, i)
        if mask.any():
            moved, before = points[mask], points[mask]
            moved[:, i] = place[mask]
            mask[mask] = unclear(moved, gap) <= unclear(before, gap)
        return mask

    return good


@cache
def clear_layouts(workcell: Workcell, rules: Rules, level: int) -> Array:
    """Layouts (N, n, 2) [m] in which all distances from place 0, the reference, are clear.

    Few layouts are like that by chance. Walks that never become less clear find some, from each of
    the likelier references of a start; copies of these, half of them mirrored, walk on.
    """
    points = _likelier_references(starts(rules, level, SEARCHES), rules.gap[level - 1])
    for k in range(ROUNDS):
        points = pool(points, clearing(workcell, rules, level), SWEEPS, 1, seed=k)[0]
        found = points[unclear(points, rules.gap[level - 1]) == 0.0]
        if len(found) >= ENOUGH:
            break
    mirrored = found * (-1.0, 1.0)
    seen = allowed(workcell, rules, mirrored[..., 0], mirrored[..., 1]).all(axis=1)
    found = np.concatenate([found, mirrored[seen]])
    if not len(found):
        raise LayoutError(f"no layout of {points.shape[1]} objects has clear distances")
    copies = found[np.arange(CHAINS) % len(found)]
    walked = np.concatenate(pool(copies, clearing(workcell, rules, level)))
    return walked[[wide(rules, level, layout) for layout in walked]]


LIKELY = 3
"""So many of a start's places are tried as the reference."""


def _likelier_references(points: Array, gap: float) -> Array:
    """Layouts (chains, n, 2) turned so that one of the LIKELY clearest places comes first."""
    turned = np.stack([np.roll(points, -k, axis=1) for k in range(points.shape[1])], axis=1)
    best = np.argsort(unclear(turned, gap), axis=1, kind="stable")[:, :LIKELY]
    chain = np.arange(len(points))
    return np.asarray(turned[chain, best[chain, chain % best.shape[1]]])


def wide(rules: Rules, level: int, points: Array) -> bool:
    """Whether a layout (n, 2) has the level's extent."""
    return bool((np.ptp(points, axis=0) >= rules.extent[level - 1]).all())


def shifted(
    rng: np.random.Generator, workcell: Workcell, rules: Rules, level: int, points: Array
) -> Array:
    """The layout (n, 2) after one more sweep of small moves, if that keeps its extent."""
    moved = points[None].copy()
    walk(rng, moved, fits(workcell, rules, level), SHIFT)
    return moved[0] if wide(rules, level, moved[0]) else points


JITTERS = SHIFT * np.repeat(0.5 ** np.arange(6), 2)[:, None, None]
"""How far [m] places are moved together; the first that leaves them apart and clear is taken."""


def jittered(
    rng: np.random.Generator, workcell: Workcell, rules: Rules, level: int, points: Array
) -> Array:
    """A layout (n, 2) with clear distances, all places moved a little, if there is room."""
    count, x, y = len(points), *np.triu_indices(len(points), 1)
    tried = points + JITTERS * (2 * rng.random((len(JITTERS), count, 2)) - 1)
    delta = tried[:, x] - tried[:, y]
    near = (delta[..., 0] ** 2 + delta[..., 1] ** 2).min(axis=1) < rules.apart[level - 1] ** 2
    seen = allowed(workcell, rules, tried[..., 0], tried[..., 1]).all(axis=1)
    wide = (np.ptp(tried, axis=1) >= rules.extent[level - 1]).all(axis=1)
    good = seen & wide & ~near & (unclear(tried, rules.gap[level - 1]) == 0.0)
    return tried[int(np.argmax(good))] if good.any() else points


def put_down(
    rng: np.random.Generator,
    workcell: Workcell,
    places: Callable[[], Array],
    things: Sequence[Thing],
    yaw: float,
) -> tuple[Array, tuple[SceneObject, ...], list[int]]:
    """A layout (n, 2) [m] of `places`, the things there in random order, and each one's place.

    The first layout in which all can be turned so that they are free, whole in view and graspable.
    """
    order = [int(i) for i in rng.permutation(len(things))]
    variants = [things[i][1] or table.draw_variant(rng, things[i][0]) for i in order]

    def lying() -> tuple[Array, list[Turnable]]:
        points = places()
        return points, [
            Turnable(things[i][0], params, (float(points[i][0]), float(points[i][1])), yaw)
            for i, params in zip(order, variants, strict=True)
        ]

    points, items, turns = turned(rng, workcell, lying, MARGIN)
    objects = []
    for k, (item, turn) in enumerate(zip(items, turns, strict=True)):
        height = -object_model(item.asset, item.params).bottom
        pose = table.standing(item.place, turn, height)
        objects.append(SceneObject(f"object_{k}", item.asset, pose, dict(item.params)))
    return points, tuple(objects), order


@dataclass(frozen=True)
class Facts(table.PickFacts):
    """Target, reference, and the target's rank; rank 1 is the farthest."""

    reference: str
    distance_rank: int


def draw(
    level: int, rng: np.random.Generator, workcell: Workcell, family: ObjectSet
) -> SceneSample:
    rules = family.rules
    found = clear_layouts(workcell, rules, level)
    things = family.things(level, rng)
    rank = int(rng.integers(rules.counts[level - 1] - 1)) + 1

    def places() -> Array:
        return jittered(rng, workcell, rules, level, found[int(rng.integers(len(found)))])

    points, objects, order = put_down(rng, workcell, places, things, family.yaw)
    target = 1 + int(np.argsort(-distances(points))[rank - 1])
    facts = Facts(f"object_{order.index(target)}", f"object_{order.index(0)}", rank)
    return SceneSample(objects, facts)


def gap(scene: Scene) -> float:
    """By how much [m] the asked object's distance differs from that of any other."""
    facts = Facts.of(scene)
    places = {item.name: item.pose.position[:2] for item in scene.objects}
    reference = places.pop(facts.reference)
    far = {name: math.dist(place, reference) for name, place in places.items()}
    asked = far.pop(facts.target)
    return min(abs(asked - other) for other in far.values())


def distance_task(family: ObjectSet) -> Task:
    """The task that asks for the k-th farthest from a reference."""

    def slots(scene: Scene) -> Slots:
        names = family.reference(scene.object(Facts.of(scene).reference))
        rank = Facts.of(scene).distance_rank
        number, word = ordinal(rank)
        entry = "rank.first" if rank == 1 else "rank.other"
        phrases = TEXT.slots(entry, "object", number=number, word=word, noun=family.noun)
        return {**phrases, "reference": names}

    return Task(
        name=table.pick_name(family.name, "Distance"),
        category="SDE",
        levels=family.rules.levels,
        draw=lambda level, rng, workcell: draw(level, rng, workcell, family),
        goal=table.lifted(Lift(above=0.82)),
        plan=table.pick_target,
        templates=TEXT.templates,
        slots=slots,
        summary=f"Pick the k-th farthest of {family.what} from a named one.",
        success="the target's origin is higher than 0.82 m while a gripper carries it",
        lead=gap,
    )


BLOCK_COLORS = (
    *("red", "green", "blue", "yellow", "purple"),
    *("orange", "cyan", "pink", "brown", "gray"),
)
"""A level of n blocks has the first n of these colours."""
HALF_EDGES = (
    (0.018, 0.022), (0.0165, 0.0185), (0.015, 0.017), (0.014, 0.016), (0.012, 0.014),
)  # fmt: skip
"""Range of the half edge [m], the same for all blocks of a scene."""


def blocks(level: int, rng: np.random.Generator) -> list[Thing]:
    """Equal cubes of different colours."""
    half = rng.uniform(*HALF_EDGES[level - 1])
    colors = [NAMED[word] for word in BLOCK_COLORS][: BLOCKS.rules.counts[level - 1]]
    order = rng.permutation(len(colors))
    return [("block", {"half": [half] * 3, "color": list(colors[i])}) for i in order]


BLOCKS = ObjectSet(
    "Blocks",
    Rules(
        counts=(3, 6, 8, 9, 10),
        apart=(0.100, 0.090, 0.080, 0.076, 0.068),
        gap=(0.10, 0.08, 0.07, 0.06, 0.05),
        region=((-0.28, 0.28), (-0.18, 0.08)),
        radius=0.032,
        tall=0.044,
        starts=tuple((x, y) for y in (-0.12, 0.04) for x in (-0.2, -0.1, 0.0, 0.1, 0.2)),
        extent=((0.0, 0.0), *((0.22, 0.08),) * 4),
    ),
    blocks,
    lambda item: TEXT.phrasings("colored.block", color=nearest(tuple(item.params["color"]))),
    "block",
    yaw=0.75,
)

MUG_MODELS = {"black": (1, 5), "brown": (0, 2, 4), "yellow": (1, 3), "white": (0, 1), "green": (4,)}
PILL_MODELS = {"orange": (0, 1), "white": (1,), "brown": (2,), "green": (3,)}
"""Looks (their print or cap) of each official colour: as many models as officially."""


def one_unlike(asset: str, models: dict[str, tuple[int, ...]], rng: np.random.Generator,
               count: int) -> list[Thing]:  # fmt: skip
    """`count` models, of which only the first has its colour.

    No model comes twice before all other ones have come once.
    """
    words = list(models)
    word = words[int(rng.integers(len(words)))]
    own = models[word][int(rng.integers(len(models[word])))]
    others = [(w, look) for w in words if w != word for look in models[w]]
    drawn: list[tuple[str, int]] = []
    while len(drawn) < count - 1:
        drawn += [others[i] for i in rng.permutation(len(others))]
    chosen = [(word, own), *(drawn[int(i)] for i in rng.permutation(count - 1))]
    return [(asset, {"look": look, "tint": w}) for w, look in chosen]


def _tinted_names(item: SceneObject) -> Phrasings:
    return TEXT.phrasings(f"colored.{item.asset}", color=item.params["tint"])


STARTS = tuple((x, y) for y, xs in (
    (-0.18, (-0.22, -0.0195, 0.181)), (-0.05, (-0.1197, 0.0807)), (0.08, (-0.22, -0.0195, 0.181)),
) for x in xs)  # fmt: skip
"""Eight places of the region, 0.164 m apart."""

MUGS = ObjectSet(
    "Mugs",
    Rules(
        apart=(0.158, 0.158, 0.155, 0.164, 0.158),
        gap=(0.100, 0.085, 0.075, 0.065, 0.058),
        radius=0.052,
        tall=0.110,
        starts=STARTS,
    ),
    lambda level, rng: one_unlike("mug", MUG_MODELS, rng, COUNTS[level - 1]),
    _tinted_names,
    "mug",
)
PILL_BOTTLES = ObjectSet(
    "Pill_Bottles",
    Rules(
        apart=(0.158, 0.158, 0.155, 0.164, 0.161),
        gap=(0.085, 0.085, 0.075, 0.065, 0.058),
        radius=0.040,
        tall=0.155,
        starts=STARTS,
    ),
    lambda level, rng: one_unlike("pill_bottle", PILL_MODELS, rng, COUNTS[level - 1]),
    _tinted_names,
    "pill bottle",
)


def _mixed(assets: tuple[str, ...], level: int, rng: np.random.Generator) -> list[Thing]:
    return [(assets[int(i)], None) for i in rng.permutation(COUNTS[level - 1])]


MODIFIERS = {"with", "that", "in", "on", "wrapped"}
"""Words that start a modifier behind a noun."""


def _category_names(item: SceneObject) -> Phrasings:
    """Names of a reference by its category, and those of this very object.

    Those with a modifier behind the noun are left out: "the object farthest from the bowl that is
    blue" could be read as a blue object.
    """
    own = table.variant_phrasings(object_model(item.asset, item.params))
    usable = ([p for p in some if not MODIFIERS & set(p.split())] for some in own)
    plain = TEXT.phrasings(f"reference.{item.asset}")
    train, held = (tuple(dict.fromkeys((*a, *b))) for a, b in zip(plain, usable, strict=True))
    return train, tuple(name for name in held if name not in train)


ASSETS_A = ("cup", "bread", "can", "stapler", "bell", "apple", "payment_sign")
ASSETS_B = ("tea_box", "sauce_can", "bowl", "toycar", "fan", "tissue_box", "french_fries")
"""Level k uses the first k + 2."""

PACKED = (
    (-0.218, -0.174), (-0.018, -0.174), (0.182, -0.174), (-0.118, -0.047),
    (0.082, -0.047), (-0.218, 0.08), (-0.018, 0.08), (0.182, 0.08),
)  # fmt: skip
"""Eight places of the region, 0.1616 m apart, with large objects in view."""

MIXED_A = ObjectSet(
    "Mixed_Objects_A",
    Rules(
        apart=(0.161, 0.158, 0.158, 0.158, 0.158),
        gap=(0.025, 0.030, 0.035, 0.042, 0.050),
        radius=0.057,
        tall=0.156,
        starts=PACKED,
    ),
    lambda level, rng: _mixed(ASSETS_A, level, rng),
    _category_names,
    "object",
)
MIXED_B = ObjectSet(
    "Mixed_Objects_B",
    Rules(
        apart=(0.158, 0.158, 0.158, 0.158, 0.161),
        gap=(0.058,) * 5,
        radius=0.065,
        tall=0.12,
        starts=PACKED,
    ),
    lambda level, rng: _mixed(ASSETS_B, level, rng),
    _category_names,
    "object",
)
FAMILIES = (BLOCKS, MUGS, PILL_BOTTLES, MIXED_A, MIXED_B)


TASKS = tuple(distance_task(family) for family in FAMILIES)
