"""Scene modes: what may be changed in a scene that its task has drawn.

A task draws the same objects in every mode. A mode is a function of the drawn scene; what it adds
at random comes from generators of its own, one for each part that it varies ("table height",
"lights"), so that no part depends on another. Modes are entry points in the group
`robospa.scene_modes`: a new one is one function and one line (docs/adding-a-scene-mode.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from robospa.geometry import Pose
from robospa.registry import SCENE_MODES, UnknownName, find, names
from robospa.tasks.scene import Scene, SceneObject

Part = Callable[[str], np.random.Generator]
"""The generator of a part of a scene, by the part's name: the same name gives the same draws."""
Mode = Callable[[Scene, Part], Scene]
"""The scene that a mode makes of a drawn one."""


def modes() -> tuple[str, ...]:
    """Names of all installed scene modes."""
    return names(SCENE_MODES)


@cache
def mode(name: str) -> Mode:
    """The scene mode called `name`; ValueError, listing what exists, if there is none."""
    try:
        found: Mode = find(SCENE_MODES, name, "scene mode")
    except UnknownName as error:
        raise ValueError(str(error)) from error
    return found


def with_table_raised(scene: Scene, rise: float) -> Scene:
    """The scene with its table, and all that is on or over it, higher by `rise` [m].

    What stands on the floor stays there.
    """

    def raised(item: SceneObject) -> SceneObject:
        x, y, z = item.pose.position
        if z < scene.table_top / 2:
            return item
        return replace(item, pose=Pose((x, y, z + rise), item.pose.rotation))

    objects = tuple(raised(item) for item in scene.objects)
    return replace(scene, objects=objects, table_rise=scene.table_rise + rise)
