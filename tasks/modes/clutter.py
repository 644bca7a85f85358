"""Clutter: up to ten things on the table that have nothing to do with the task.

The official rules: kind and look are drawn evenly, then up to 100 places; a thing is taken if it
keeps its distance from all others and from what the task needs (`keep_out`), lies on the table,
and, higher than 5 cm, in its far half. It ends with the number asked for, or after 50 things for
which no place was found. One scene in fifty has none at all.

A sentence that is true of a scene stays true of it with clutter: nothing that may be taken for one
of the task's things, or has a colour that the task names, lies about. The official rule of places
is a rectangle around each of the task's things and some of its places; here they follow from scene
and plan, and two rules are ours: a gripper has room around what it takes or presses, and clutter
hides no object of the task from the head camera.
"""

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from robospa.geometry import Array, Pose, to_matrix, yaw_rotation
from robospa.tasks import catalog
from robospa.tasks.colors import LOOK_ALIKES as COLORS_ALIKE
from robospa.tasks.colors import NAMED
from robospa.tasks.objects import assets, object_model, variant_count
from robospa.tasks.objects.build import PALETTE, points_of
from robospa.tasks.plan import Place
from robospa.tasks.sampling.places import Mask
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.shapes import ObjectModel, Params
from robospa.workcell import WORKCELL

NONE_AT_ALL = 0.02
MOST_FAILURES, PLACES = 50, 100
X, Y = (-0.59, 0.59), (-0.34, 0.34)
"""Where middles are drawn, relative to the middle of the table [m]."""
EDGE = (0.6, 0.34)
"""How far things may reach from the middle of the table [m]."""
BETWEEN = 0.01
"""Least room [m] between two things of the clutter."""


@dataclass(frozen=True)
class ClutterKind:
    """A kind of thing: the parameters of each of its looks, and whether nothing can move it."""

    asset: str
    looks: Sequence[Params]
    fixed: bool = False


def own_kinds(scene: Scene) -> tuple[ClutterKind, ...]:
    """The kinds of the built-in library that may lie about in `scene`."""
    return tuple(
        ClutterKind(asset, [{"look": look} for look in range(variant_count(asset))])
        for asset in candidates(scene)
    )


def clutter(
    scene: Scene, rng: np.random.Generator, most: int, kinds: Sequence[ClutterKind] | None = None
) -> tuple[SceneObject, ...]:
    """At most `most` things of `kinds` (default: those of the library) on the table of `scene`."""
    if rng.random() < NONE_AT_ALL:
        return ()
    kinds = own_kinds(scene) if kinds is None else kinds
    colors, taken = colors_asked(scene), keep_out(scene)
    placed: list[SceneObject] = []
    circles: list[tuple[float, float, float]] = []
    failures = 0
    while kinds and len(placed) < most and failures < MOST_FAILURES:
        kind = kinds[int(rng.integers(len(kinds)))]
        params = kind.looks[int(rng.integers(len(kind.looks)))]
        x, y, yaw = (rng.uniform(*r, PLACES) for r in (X, Y, (-math.pi, math.pi)))
        x, y = x + scene.table_shift[0], y + scene.table_shift[1]
        model = object_model(kind.asset, params)
        fits = _on_table(scene, x, y, model) & _apart(x, y, model, circles)
        fits[fits] = taken.free(x[fits], y[fits], model, scene.table_top)
        first = int(fits.argmax())
        if not fits[first] or (colors and color_words(" ".join(model.phrases)) & colors):
            failures += 1
            continue
        circles.append((float(x[first]), float(y[first]), model.radius))
        at = (float(x[first]), float(y[first]), scene.table_top - model.bottom)
        pose = Pose(at, yaw_rotation(float(yaw[first])))
        name = f"clutter_{len(placed)}"
        placed.append(SceneObject(name, kind.asset, pose, params, fixed=kind.fixed))
    return tuple(placed)


def look_alikes(scene: Scene, rng: np.random.Generator, most: int) -> tuple[SceneObject, ...]:
    """At most `most` things that may be taken for one of the scene's, and are none: only kinds
    that it does not have, so its sentence stays true of it."""
    present = {item.asset for item in scene.everything}
    alike = sorted(taken_kinds(scene) - present - FURNITURE)
    looks = [(asset, range(variant_count(asset))) for asset in alike]
    kinds = [ClutterKind(asset, [{"look": n} for n in numbers]) for asset, numbers in looks]
    found = clutter(scene, rng, most, kinds)
    return tuple(replace(item, name=f"look_alike_{n}") for n, item in enumerate(found))


def _on_table(scene: Scene, x: Array, y: Array, model: ObjectModel) -> Mask:
    """Where a thing reaches over no edge and, if it is tall, not into the near half."""
    x, y = x - scene.table_shift[0], y - scene.table_shift[1]
    on = (np.abs(x) + model.radius <= EDGE[0]) & (np.abs(y) + model.radius <= EDGE[1])
    return np.asarray(on & (y >= model.radius) if model.size[2] > TALL else on)


def _apart(
    x: Array, y: Array, model: ObjectModel, circles: list[tuple[float, float, float]]
) -> Mask:
    if not circles:
        return np.ones(len(x), dtype=bool)
    cx, cy, radius = np.array(circles).T
    apart = np.hypot(x[:, None] - cx, y[:, None] - cy) >= radius + model.radius + BETWEEN
    return np.asarray(apart.all(axis=1))


FURNITURE = frozenset(
    {
        "block", "cover", "display_stand", "dustbin", "electronic_scale", "garbage", "microwave",
        "mug_rack", "pad", "phone_stand", "t_block", "tray", "wooden_block",
    }
)  # fmt: skip
"""Assets that are never clutter: parts of a task's furniture, and plain blocks and markers."""

LOOK_ALIKES: tuple[frozenset[str], ...] = tuple(
    frozenset(words.split())
    for words in (
        "bottle pill_bottle perfume glue sauce_can",
        "can sauce_can cup mug",
        "cup mug cover table_trash_bin",
        "bowl plate bread_basket kitchen_pot",
        "plate tray coaster pad display_stand electronic_scale",
        "dustbin table_trash_bin bread_basket",
        "block wooden_block t_block rubikscube tea_box coffee_box tissue_box playing_cards soap",
        "tea_box coffee_box tissue_box playing_cards french_fries",
        "phone remote_control electronic_scale",
        "phone_stand payment_sign mug_rack display_stand",
        "bell alarm_clock",
        "bread hamburger bread_basket",
        "garbage apple",
    )
)
"""Kinds that may be taken for each other, or that one word covers (a box of tea is a box)."""

COLOR_WORDS = frozenset(PALETTE) | frozenset(NAMED)
ALSO_ALIKE = (("gold", "yellow"), ("cream", "beige", "white"), ("grey", "gray", "silver"))
"""Words of the object library's colours beside those that `robospa.tasks.colors` tells apart."""


def candidates(scene: Scene) -> tuple[str, ...]:
    """Assets that clutter of `scene` may be, sorted."""
    taken = FURNITURE | taken_kinds(scene)
    return tuple(a for a in assets() if a not in taken)


def taken_kinds(scene: Scene) -> frozenset[str]:
    """Assets that the scene is about, and what may be taken for them."""
    present = frozenset(item.asset for item in scene.objects)
    return present.union(*(group for group in LOOK_ALIKES if group & present))


def colors_asked(scene: Scene) -> frozenset[str]:
    """Words for the objects' colours and for what looks alike, where a task names things by colour.

    None for other tasks.
    """
    if not any("color" in fact for fact in scene.facts):
        return frozenset()
    phrases = [" ".join(object_model(o.asset, o.params).phrases) for o in scene.objects]
    words = frozenset().union(*map(color_words, phrases))
    alike = (group for group in (*COLORS_ALIKE, *ALSO_ALIKE) if words & set(group))
    return words.union(*alike)


@cache
def color_words(text: str) -> frozenset[str]:
    """Words for colours in `text`."""
    return frozenset(w for w in COLOR_WORDS if re.search(rf"\b{w}\b", text))


TALL = 0.05
"""Higher things [m] keep farther away, and off the near half of the table (official)."""
GAP = 0.005
"""Added to the radius of a piece of clutter against a task's rectangles (official) [m]."""
ROOM, ROOM_TALL = 0.015, 0.055
"""Further room around a task's things for fingers, and for the hand beside tall clutter [m]."""
IN_FRONT = 0.08
"""How far [m] the room beside tall clutter reaches towards the robot, whose hands come from there.
"""

_SIGNS = np.array(list(itertools.product((-1.0, 1.0), (-1.0, 1.0), (0.0, 1.0))))


@dataclass(frozen=True)
class KeepOut:
    """Oriented rectangles on the table, and how far each task object reaches in the head's picture.

    `centres` (N, 2) [m], `axes` (N, 2, 2) with the rectangles' x and y axes as rows, `halves`
    (N, 2) [m]. `boxes` (M, 4) are left, right, top and bottom [px] of objects whose nearest point
    is at `nearest` (M,) [m].
    """

    centres: Array
    axes: Array
    halves: Array
    boxes: Array
    nearest: Array

    def free(self, x: Array, y: Array, model: ObjectModel, table_top: float) -> Mask:
        """At which places (K,) [m] a piece of clutter keeps its distance and hides nothing."""
        tall = model.size[2] > TALL
        reach = model.radius + GAP + (ROOM_TALL if tall else ROOM)
        away = np.stack([x, y], axis=1)[:, None] - self.centres
        free = self._outside(away, reach)
        if tall:
            away[..., 1] += IN_FRONT
            free &= self._outside(away, reach)
        left, right, top, bottom = WORKCELL.head.box(
            x, y, model.radius, table_top, table_top + model.size[2]
        )
        one, two, three, four = self.boxes.T
        apart = (left[:, None] > two) | (right[:, None] < one)
        apart |= (top[:, None] > four) | (bottom[:, None] < three)
        apart |= y[:, None] - model.radius > self.nearest
        return np.asarray(free & apart.all(axis=1))

    def _outside(self, away: Array, reach: float) -> Mask:
        local = np.abs(np.einsum("nij,knj->kni", self.axes, away)) - self.halves
        beyond = np.maximum(local, 0.0)
        return np.asarray(((beyond**2).sum(axis=2) >= reach**2).all(axis=1))


Rectangle = tuple[tuple[float, float], Array, tuple[float, float]]
"""Centre, axes and half sizes."""


def _circle(x: float, y: float, radius: float) -> Rectangle:
    return (x, y), np.eye(2), (radius, radius)


def keep_out(scene: Scene) -> KeepOut:
    """Where no clutter of `scene` may lie; nothing of it depends on which object is asked for,
    beyond the places to which the plan carries things."""
    found: list[Rectangle] = []
    boxes, nearest = [], []
    for item in scene.objects:
        model = object_model(item.asset, item.params)
        turn = to_matrix(item.pose.rotation)
        half = footprint(model)
        x, y, _ = item.pose.position
        found.append(((x, y), turn[:2, :2].T, half))
        found += _swing(item.pose, model)
        corners = _corners(item, model, half)
        column, row = WORKCELL.head.pixel(*corners.T)
        boxes.append((column.min(), column.max(), row.min(), row.max()))
        nearest.append(corners[:, 1].min())
    for skill in catalog.task(scene.task).plan(scene):
        if isinstance(skill, Place):
            x, y, _ = skill.position
            if skill.on is not None:
                x, y, _ = scene.object(skill.on).pose.position
            moved = scene.object(skill.object)
            found.append(_circle(x, y, object_model(moved.asset, moved.params).radius))
    centres, axes, halves = map(np.array, zip(*found, strict=True))
    return KeepOut(centres, axes, halves, np.array(boxes), np.array(nearest))


def footprint(model: ObjectModel) -> tuple[float, float]:
    """Half sizes [m] of an upright box around the origin that holds the model."""
    x, y, _ = model.size
    if model.radius > math.hypot(x, y) / 2 + 1e-3:  # the origin is not in the middle
        return model.radius, model.radius
    return x / 2, y / 2


def _swing(pose: Pose, model: ObjectModel) -> list[Rectangle]:
    if model.hinge is None:
        return []
    points = np.concatenate([points_of(shape) for shape in model.hinge.shapes])
    x, y, _ = pose.apply(model.hinge.point)
    return [_circle(x, y, float(np.hypot(*(points - model.hinge.point)[:, :2].T).max()))]


def _corners(item: SceneObject, model: ObjectModel, half: tuple[float, float]) -> Array:
    """(8, 3) corners [m] of an object's box in the world."""
    local = _SIGNS * (*half, model.size[2]) + (0.0, 0.0, model.bottom)
    return np.asarray(local @ to_matrix(item.pose.rotation).T + item.pose.position)
