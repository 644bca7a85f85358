"""Scene modes: what may be changed in a scene that its task has drawn.

A task draws the same objects in every mode. A mode is a function of the drawn scene; what it adds
at random comes from generators of its own, one for each part that it varies ("table height",
"lights"), so that no part depends on another. Modes are entry points in the group
`robospa.scene_modes`: a new one is one function and one line (docs/adding-a-scene-mode.md).

A mode whose parts can be chosen is asked for by them: "randomized:light,clutter=5" varies the
lights and puts at most five things on the table, and nothing else. Every choice has one canonical
name, which stands in trial keys and records.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Protocol, runtime_checkable

import numpy as np

from robospa.geometry import Pose, Vec3
from robospa.registry import SCENE_MODES, UnknownName, find, names
from robospa.tasks.scene import Scene, SceneObject

Part = Callable[[str], np.random.Generator]
"""The generator of a part of a scene, by the part's name: the same name gives the same draws."""
Mode = Callable[[Scene, Part], Scene]
"""The scene that a mode makes of a drawn one."""


@runtime_checkable
class ModeOfParts(Protocol):
    """A mode that varies several parts, of which some can be chosen."""

    def __call__(self, scene: Scene, part: Part) -> Scene:
        """The scene that the mode makes of `scene`."""

    def chosen(self, parts: str) -> Mode:
        """The mode of these parts alone, as in "light,clutter=5"; ValueError if that is wrong."""

    @property
    def parts(self) -> str:
        """The chosen parts in their canonical form; empty for all at their usual strengths."""

    @property
    def tangible(self) -> str:
        """Canonical name of the mode that has the same bodies in the same places."""


def modes() -> tuple[str, ...]:
    """Names of all installed scene modes."""
    return names(SCENE_MODES)


@cache
def mode(name: str) -> Mode:
    """The scene mode called `name`, such as "clean" or "randomized:light,clutter=5".

    ValueError, listing what exists, if there is none, or if it has no such parts.
    """
    base, colon, parts = name.partition(":")
    try:
        found: Mode = find(SCENE_MODES, base, "scene mode")
    except UnknownName as error:
        raise ValueError(str(error)) from error
    if not callable(found):
        raise ValueError(f"entry point {base!r} of {SCENE_MODES} leads to no function of a scene")
    if not colon:
        return found
    if not isinstance(found, ModeOfParts):
        raise ValueError(f"scene mode {base!r} has no parts to choose, so {name!r} means nothing")
    return found.chosen(parts)


def canonical(name: str) -> str:
    """The one spelling of a scene mode's name: parts in their order, usual strengths left out.

    Raises ValueError as `mode` does.
    """
    found, base = mode(name), name.partition(":")[0]
    parts = found.parts if isinstance(found, ModeOfParts) else ""
    return f"{base}:{parts}" if parts else base


def tangible(name: str) -> str:
    """The mode with the same bodies in the same places as mode `name`, and the usual looks.

    What can be done in one can be done in the other: "randomized-seen" has the bodies of
    "randomized", "randomized:light" those of "clean". A mode that does not say is its own.
    """
    found = mode(name)
    return found.tangible if isinstance(found, ModeOfParts) else canonical(name)


def for_training(name: str) -> str:
    """The mode of training scenes that goes with a mode of evaluation; most are their own.

    "randomized:light" has "randomized-seen:light": textures that evaluation never shows.
    """
    base, colon, parts = canonical(name).partition(":")
    seen = f"{base}-seen"
    return f"{seen if seen in modes() else base}{colon}{parts}"


def shifted(item: SceneObject, by: Vec3) -> SceneObject:
    """`item` moved by a vector [m]."""
    x, y, z = (a + b for a, b in zip(item.pose.position, by, strict=True))
    return replace(item, pose=Pose((x, y, z), item.pose.rotation))


def with_table_raised(scene: Scene, rise: float) -> Scene:
    """The scene with its table and all objects higher by `rise` [m].

    What stands on the floor, too, as officially: a bin would else stick out beside a lower table.
    """
    return replace(
        scene,
        objects=tuple(shifted(item, (0.0, 0.0, rise)) for item in scene.objects),
        clutter=tuple(shifted(item, (0.0, 0.0, rise)) for item in scene.clutter),
        table_rise=scene.table_rise + rise,
    )


def clean(scene: Scene, part: Part) -> Scene:
    """`scene` itself."""
    return scene
