"""Find things by name: policies, robots, worlds, dialects, tasks, objects and scene modes are entry
points.

A package adds one by a line in its pyproject.toml, ours and others' alike:

    [project.entry-points."robospa.policies"]
    mine = "my_package.policy:create"
"""

import difflib
import importlib
from collections.abc import Collection
from importlib import metadata
from typing import Any

from robospa.extras import EXTRAS, remedy

POLICIES = "robospa.policies"
"""Functions that make a policy, called with the options of `robospa serve --arg`."""
ROBOTS = "robospa.robots"
"""Objects of `robospa.harness.robots.embodiment.Embodiment`."""
WORLDS = "robospa.worlds"
"""Objects of `robospa.harness.worlds.WorldKind`."""
DIALECTS = "robospa.dialects"
"""Objects of `robospa.clients.dialect.Dialect`: servers that speak something else than ours."""
ASSETS = "robospa.assets"
"""Asset packs: maps from the name of an asset to its `robospa.tasks.objects.build.Asset`."""
PACKS = "robospa.packs"
"""Functions without arguments that open a `robospa.tasks.packs.Pack`: a world of objects."""
SCENE_MODES = "robospa.scene_modes"
"""Functions `robospa.tasks.modes.Mode`."""
TASKS = "robospa.tasks"
"""Objects of `robospa.tasks.task.Task`."""


class UnknownName(Exception):
    """Nothing goes by that name; the message says what does."""


def load(path: str) -> Any:
    """What is found at `module:name`; raises UnknownName."""
    module, _, name = path.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except Exception as error:  # whatever a module does while it is imported
        package = str(getattr(error, "name", "")).partition(".")[0]
        if path.startswith("robospa.") and package in EXTRAS:
            raise UnknownName(f"{package} is not installed; {remedy(package)}") from error
        kind = (
            "" if isinstance(error, ImportError | AttributeError) else f"{type(error).__name__}: "
        )
        raise UnknownName(f"cannot load {path!r}: {kind}{error}") from error


def names(group: str) -> tuple[str, ...]:
    """What goes by name in `group`, sorted; imports nothing of it."""
    return tuple(sorted({point.name for point in metadata.entry_points(group=group)}))


def module_of(group: str, name: str) -> str:
    """The module in which `find` looks, without loading it; "" if nothing is called `name`."""
    points = metadata.entry_points(group=group)
    return next((point.value.partition(":")[0] for point in points if point.name == name), "")


def find(group: str, name: str, what: str) -> Any:
    """The object called `name` in `group`; `what` is what a person calls one, such as "policy".

    Raises UnknownName, with near matches and all that exists.
    """
    for point in metadata.entry_points(group=group):
        if point.name == name:
            return load(point.value)
    known = names(group)
    listed = ", ".join(known) or "none (is robospa installed?)"
    raise UnknownName(f"no {what} {name!r}; {did_you_mean(name, known)}known are {listed}")


def did_you_mean(name: str, known: Collection[str]) -> str:
    """The question "did you mean NAME? " about the nearest of `known`; empty if none is near."""
    near = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {near[0]}? " if near else ""
