"""What tasks put on the table: items with neutral names, variants, colours, poses, and the view."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from operator import itemgetter

import numpy as np

from robospa.action_space import ARMS
from robospa.geometry import Pose, Vec3, yaw_rotation
from robospa.tasks import objects
from robospa.tasks.colors import NAMED, stands_out
from robospa.tasks.goals.counters import PRESS_BOX, PressCounter
from robospa.tasks.goals.lifting import Lift, PickTracker
from robospa.tasks.instructions import Phrasings
from robospa.tasks.objects import model_of
from robospa.tasks.plan import Pick, Place, Skill
from robospa.tasks.sampling.places import LayoutError, Point
from robospa.tasks.sampling.turns import Turnable
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.shapes import Color, ObjectModel, Params
from robospa.tasks.task import Level, SceneFacts, SceneSample, Tracker
from robospa.workcell import TABLE_TOP, Workcell

COLORS: dict[str, Color] = {
    word: NAMED[word]
    for word in (
        *("red", "green", "blue", "yellow", "cyan", "magenta"),
        *("orange", "purple", "white", "black", "brown", "pink"),
    )
}
"""Linear RGB by word; a task uses the first few (official order)."""

ORDERED = {**dict(list(COLORS.items())[:4]), "purple": NAMED["purple"]}
"""The colours of tasks that ask for blocks in a fixed order of colours."""

LEVELS = {n: Level(candidates=n, subtasks=n, steps=200 * n) for n in range(1, 6)}
"""Levels of most tasks: as many subtasks as things."""
TRIES = 60


def first_colors(count: int) -> dict[str, Color]:
    """The first `count` of COLORS."""
    return dict(list(COLORS.items())[:count])


def drawn_color(rng: np.random.Generator, low: float = 0.0, high: float = 1.0) -> list[float]:
    """A random linear RGB that is not the table's, each part uniform in `low`..`high`.

    LayoutError if 60 draws are like the table, which happens to none of 10^60 scenes.
    """
    for _ in range(TRIES):
        r, g, b = (round(float(c), 4) for c in rng.uniform(low, high, 3))
        if stands_out((r, g, b)):
            return [r, g, b]
    raise LayoutError(f"{TRIES} random colours all looked like the table; skip this seed")


@dataclass(frozen=True)
class Item:
    """An object before it has a name; `role` is how the task's facts call it, "" if they do not."""

    role: str
    asset: str
    pose: Pose
    params: Params = field(default_factory=dict)
    fixed: bool = False
    appears_at: float | None = None


def block(
    role: str,
    point: Point,
    half: float | Vec3,
    color: Sequence[float],
    yaw: float = 0.0,
    fixed: bool = False,
    top: float = TABLE_TOP,
) -> Item:
    """A block of `half` sizes [m], a cube if that is a number, at height `top` [m]."""
    x, y, z = half if isinstance(half, tuple) else (half, half, half)
    params = {"half": [x, y, z], "color": list(color)}
    return Item(role, "block", Pose((*point, top + z), yaw_rotation(yaw)), params, fixed)


def sample(
    rng: np.random.Generator,
    items: Sequence[Item],
    facts: type[SceneFacts],
    shift: tuple[float, float] = (0.0, 0.0),
    **more: object,
) -> SceneSample:
    """The scene of `items`, called "object_0".. in shuffled order, and its `facts`: a field has the
    name of the item of that role; a tuple has those of several, and of roles "FIELD N" by N. `more`
    are the other fields."""
    order = [int(i) for i in rng.permutation(len(items))]
    scene_objects = tuple(
        SceneObject(f"object_{n}", item.asset, item.pose, item.params, item.fixed, item.appears_at)
        for n, item in enumerate(items[i] for i in order)
    )
    found: dict[str, list[tuple[int, str]]] = {known.name: [] for known in fields(facts)}
    for i, item in enumerate(items):
        role, _, place = item.role.partition(" ")
        found.setdefault(role, []).append((int(place or 0), f"object_{order.index(i)}"))
    for known in fields(facts):
        own = [name for _, name in sorted(found[known.name], key=itemgetter(0))]
        if str(known.type).startswith("tuple"):
            more.setdefault(known.name, tuple(own))
        elif own:
            more[known.name] = own[0]
    return SceneSample(scene_objects, facts(**more), shift)


def draw_variant(
    rng: np.random.Generator, asset: str, some: Sequence[int] | None = None
) -> dict[str, int]:
    """Parameters of one of the asset's variants (of `some` of them), each equally likely."""
    some = range(objects.variant_count(asset)) if some is None else some
    return {"look": int(some[int(rng.integers(len(some)))])}


def radius(asset: str, params: Params) -> float:
    """Radius [m] of the asset's footprint around its origin."""
    return objects.object_model(asset, params).radius


def standing(point: Point, yaw: float = 0.0, height: float = 0.0) -> Pose:
    """Pose at rest on the table: origin `height` [m] above it, turned by `yaw` [rad] about z."""
    return Pose((point[0], point[1], TABLE_TOP + height), yaw_rotation(yaw))


def thing(
    role: str,
    asset: str,
    point: Point,
    params: Params,
    turn: float = 0.0,
    fixed: bool = False,
    height: float = 0.0,
) -> Item:
    """A thing at rest on the table, see `standing`."""
    return Item(role, asset, standing(point, turn, height), params, fixed)


def in_view(workcell: Workcell, asset: str, params: Params) -> Callable[[Point], bool]:
    """Whether the head camera sees the whole asset when it stands at a point."""
    model = objects.object_model(asset, params)
    return lambda point: point_in_view(workcell, point, model.size[2], model.radius)


def point_in_view(workcell: Workcell, point: Point, height: float, radius: float = 0.0) -> bool:
    """Whether the head camera sees what is up to `height` [m] above the table around a point."""
    x, y = np.array(point[0]), np.array(point[1])
    return bool(workcell.in_view(x, y, radius, height, (0.0, 0.0)))


def side(x: float) -> str:
    """The arm that works at `x` [m]: left of the middle the left one, else the right one."""
    return "left" if x < 0 else "right"


def side_of(scene: Scene, name: str) -> str:
    """The arm on whose side an object starts."""
    return side(scene.object(name).pose.position[0])


def frame_of(scene: Scene, name: str, frame: str) -> Pose:
    """The named frame of an object, in the object's own frame."""
    return objects.model_of(scene.object(name)).frames[frame]


BOXES: Mapping[str, Vec3] = {"can": (0.03, 0.03, 0.04), "bell": (0.025, 0.025, 0.03)}
"""Half sizes [m] of the box around the press point in which a touch counts, where not usual."""


def presses(scene: Scene, name: str, closed: bool = False) -> PressCounter:
    """Counts presses of an object, at its official contact point; with `closed` only while the
    gripper on its side is closed."""
    arm = ARMS.index(side_of(scene, name)) if closed else None
    box = BOXES.get(scene.object(name).asset, PRESS_BOX)
    return PressCounter(name, frame_of(scene, name, "touched"), box, arm)


def moved(name: str, to: Vec3, arm: str, lift: float = 0.08) -> tuple[Pick, Place]:
    """The skills that bring an object to a place [m, world], lifted by so much [m]."""
    return Pick(name, lift=lift, arm=arm), Place(name, to, arm=arm)


def variant_phrasings(model: ObjectModel) -> Phrasings:
    """A model's own phrases: those for training sentences, and the last third, held out."""
    cut = len(model.phrases) - max(1, len(model.phrases) // 3)
    return model.phrases[:cut], model.phrases[cut:]


@dataclass(frozen=True)
class PickFacts(SceneFacts):
    """What the pick tasks have in common."""

    target: str


def pick_name(kind: str, family: str) -> str:
    """The official name: ("Cups", "Canonical") -> "Pick_Cups_Canonical"; the letter of a set of
    mixed objects comes last.
    """
    head, _, letter = kind.rpartition("_")
    return f"Pick_{head}_{family}_{letter}" if letter in ("A", "B") else f"Pick_{kind}_{family}"


def lifted(lift: Lift) -> Callable[[Scene], Tracker]:
    """The goal that the scene's target is picked as `lift` says of a table at its usual height."""

    def goal(scene: Scene) -> Tracker:
        above = None if lift.above is None else lift.above + scene.table_rise
        names = tuple(o.name for o in scene.objects)
        models = {o.name: model_of(o) for o in scene.objects}
        middles = {n: (0.0, 0.0, m.bottom + m.size[2] / 2) for n, m in models.items()}
        target = PickFacts.of(scene).target
        return PickTracker(target, names, replace(lift, above=above), middles)

    return goal


def pick_target(scene: Scene) -> tuple[Skill, ...]:
    """The plan: pick the target."""
    return (Pick(PickFacts.of(scene).target),)


def put_down(items: Sequence[Turnable], yaws: Sequence[float]) -> tuple[SceneObject, ...]:
    """`items` on the table, turned by `yaws` [rad], as "object_0", "object_1", ..."""
    return tuple(
        SceneObject(
            f"object_{k}",
            item.asset,
            standing(item.place, yaw, item.params["half"][2] if "half" in item.params else 0.0),
            item.params,
        )
        for k, (item, yaw) in enumerate(zip(items, yaws, strict=True))
    )


BLOCK_HALF = 0.015
"""Half an edge [m] of a block among mixed objects."""
BLOCK_COLORS = ("red", "blue", "green", "yellow", "purple", "black")


def draw_params(rng: np.random.Generator, asset: str) -> dict[str, object]:
    """One of the variants of `asset`; for a block among mixed objects one of six colours."""
    if asset == "block":
        color = NAMED[BLOCK_COLORS[int(rng.integers(len(BLOCK_COLORS)))]]
        return {"half": [BLOCK_HALF] * 3, "color": list(color)}
    return dict(draw_variant(rng, asset))
