"""What tasks put on the table: items with neutral names, looks, poses, and what is in view."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from robospa.geometry import Pose, yaw_rotation
from robospa.tasks import objects
from robospa.tasks.sampling.places import Point
from robospa.tasks.scene import SceneObject
from robospa.tasks.shapes import ObjectModel, Params
from robospa.workcell import TABLE_TOP, Workcell


@dataclass(frozen=True)
class Item:
    """An object before it has a name; `role` is how the task's facts call it."""

    role: str
    asset: str
    pose: Pose
    params: Params = field(default_factory=dict)
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
    return {"look": int(rng.integers(objects.look_count(asset)))}


def radius(asset: str, params: Params) -> float:
    """Radius [m] of the asset's footprint around its origin."""
    model: ObjectModel = objects.object_model(asset, params)
    return model.radius


def standing(point: Point, yaw: float = 0.0, height: float = 0.0) -> Pose:
    """Pose at rest on the table: origin `height` [m] above it, turned by `yaw` [rad] about z."""
    return Pose((point[0], point[1], TABLE_TOP + height), yaw_rotation(yaw))


def in_view(workcell: Workcell, asset: str, params: Params) -> Callable[[Point], bool]:
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


def side(x: float) -> str:
    """The arm that works at `x` [m]: left of the middle the left one, else the right one."""
    return "left" if x < 0 else "right"


def look_phrasings(model: ObjectModel) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """A model's own phrases: those for training sentences, and the last third, held out."""
    cut = len(model.phrases) - max(1, len(model.phrases) // 3)
    return model.phrases[:cut], model.phrases[cut:]
