"""What the long-horizon tasks share: scattering things on the table, and neutral names.

Sampling is bounded everywhere: a layout that cannot be completed is drawn anew, a given number of
times, and then refused with a sentence. Names give no hint of an object's role.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robospa.geometry import Pose, yaw_rotation
from robospa.tasks import objects
from robospa.tasks.scene import SceneObject
from robospa.tasks.shapes import ObjectModel
from robospa.tasks.task import Draft
from robospa.workcell import TABLE_TOP, Workcell

Point = tuple[float, float]
TRIES_PER_POINT = 100
LAYOUTS = 200


@dataclass(frozen=True)
class Item:
    """An object before it has a name; `role` is how the task's facts call it."""

    role: str
    asset: str
    pose: Pose
    params: Mapping[str, Any] = field(default_factory=dict)
    fixed: bool = False
    appears_at: float | None = None


def named(
    rng: np.random.Generator, items: Sequence[Item]
) -> tuple[tuple[SceneObject, ...], dict[str, str]]:
    """`items` as scene objects "object_0".. in shuffled order, and the name of every role."""
    order = [int(i) for i in rng.permutation(len(items))]
    scene_objects, names = [], {}
    for number, index in enumerate(order):
        item, name = items[index], f"object_{number}"
        names[item.role] = name
        scene_objects.append(
            SceneObject(name, item.asset, item.pose, item.params, item.fixed, item.appears_at)
        )
    return tuple(scene_objects), names


def draw_look(rng: np.random.Generator, asset: str) -> dict[str, int]:
    """Parameters of one of the asset's looks, each equally likely."""
    return {"look": int(rng.integers(objects.looks(asset)))}


def radius(asset: str, params: Mapping[str, Any]) -> float:
    """Radius [m] of the asset's footprint around its origin."""
    model: ObjectModel = objects.object_model(asset, params)
    return model.radius


def standing(point: Point, yaw: float = 0.0, height: float = 0.0) -> Pose:
    """Pose at rest on the table: origin `height` [m] above it, turned by `yaw` [rad] about z."""
    return Pose((point[0], point[1], TABLE_TOP + height), yaw_rotation(yaw))


def apart(point: Point, others: Iterable[Point], distance: float) -> bool:
    """Whether `point` is at least `distance` [m] from all `others`."""
    x, y = point
    for ox, oy in others:  # noqa: SIM110 - crowded layouts ask thousands of times
        if math.hypot(x - ox, y - oy) < distance:
            return False
    return True


def free_point(
    rng: np.random.Generator,
    x: tuple[float, float],
    y: tuple[float, float],
    far: Iterable[tuple[Point, float]],
    tries: int = TRIES_PER_POINT,
    allowed: Callable[[Point], bool] = lambda point: True,
) -> Point | None:
    """A uniform allowed point of the rectangle at least so far [m] from each given one, or None."""
    far = tuple(far)
    for _ in range(tries):
        point = (float(rng.uniform(*x)), float(rng.uniform(*y)))
        if all(apart(point, [other], distance) for other, distance in far) and allowed(point):
            return point
    return None


def in_view(workcell: Workcell, asset: str, params: Mapping[str, Any]) -> Callable[[Point], bool]:
    """Whether the head camera sees the whole asset when it stands at a point."""
    model: ObjectModel = objects.object_model(asset, params)

    def seen(point: Point) -> bool:
        x, y = np.array(point[0]), np.array(point[1])
        return bool(workcell.in_view(x, y, model.radius, model.size[2], (0.0, 0.0)))

    return seen


def middle_in_view(workcell: Workcell, point: Point, height: float) -> bool:
    """Whether the head camera sees what is `height` [m] above the table at a point."""
    x, y = np.array(point[0]), np.array(point[1])
    return bool(workcell.in_view(x, y, 0.0, height, (0.0, 0.0)))


def scatter(
    rng: np.random.Generator,
    count: int,
    x: tuple[float, float],
    y: tuple[float, float],
    distance: float,
    allowed: Callable[[Point], bool] = lambda point: True,
    near_middle: bool = False,
    tries: int = TRIES_PER_POINT,
) -> tuple[Point, ...]:
    """`count` uniform points of the rectangle, pairwise at least `distance` [m] apart.

    With `near_middle` a point with |x| < 0.15 and y > 0 gets a new y between the region's near
    edge and 0 (an official rule: the middle of the table's far half is hard to reach for both
    arms). A layout that is not complete after `tries` draws per point is started again, 200 times
    at most: where points are crowded, few tries are faster than many. Raises RuntimeError if that
    does not do.
    """
    random = rng.random  # what rng.uniform draws, to the bit, at a third of its time
    for _ in range(LAYOUTS):
        points: list[Point] = []
        for _ in range(tries * count):
            px, py = x[0] + (x[1] - x[0]) * random(), y[0] + (y[1] - y[0]) * random()
            if near_middle and abs(px) < 0.15 and py > 0:
                py = y[0] + (0.0 - y[0]) * random()
            if apart((px, py), points, distance) and allowed((px, py)):
                points.append((px, py))
                if len(points) == count:
                    return tuple(points)
    raise RuntimeError(
        f"no layout of {count} points {distance} m apart in x {x}, y {y} after {LAYOUTS} attempts; "
        "widen the region or lower the distance"
    )


def shuffled_scatter(
    rng: np.random.Generator,
    count: int,
    x: tuple[float, float],
    y: tuple[float, float],
    distance: float,
    allowed: Callable[[Point], bool] = lambda point: True,
    near_middle: bool = False,
    tries: int = TRIES_PER_POINT,
) -> tuple[Point, ...]:
    """As `scatter`, but in random order: who was placed first has more places to choose from."""
    points = scatter(rng, count, x, y, distance, allowed, near_middle, tries)
    return tuple(points[int(i)] for i in rng.permutation(count))


def retry(attempt: Callable[[], Draft | None], what: str) -> Draft:
    """The first draft that `attempt` makes in 200 tries; RuntimeError naming `what` if none."""
    for _ in range(LAYOUTS):
        draft = attempt()
        if draft is not None:
            return draft
    raise RuntimeError(f"no free layout of the {what} in {LAYOUTS} draws; skip this seed")


def side(x: float) -> str:
    """The arm that works at `x` [m]: left of the middle the left one, else the right one."""
    return "left" if x < 0 else "right"


def look_phrasings(model: ObjectModel) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """A model's own phrases: those for training sentences, and the last third, held out."""
    cut = len(model.phrases) - max(1, len(model.phrases) // 3)
    return model.phrases[:cut], model.phrases[cut:]
