"""Kinds of worlds by name: sapien, official and what else is an entry point of `robospa.worlds`.

A run, its workers and its bundle name the kind of their world; the `WorldKind` answers what they
ask of it. A world that is no entry point is named by `module:factory` and is one of which nothing
is known.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from robospa.harness.clock.policy_clock import FIXED_RATE, steps_of
from robospa.harness.settings import EvaluationSettings, SettingsError
from robospa.registry import WORLDS, UnknownName, find, load, names
from robospa.results.records.manifest import LayoutSettings
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from robospa.harness.world import World

SAPIEN_NAME = "sapien"
TASK_PARTS = "robospa.harness.trial:task_parts"
SPOKEN_PARTS = "robospa.harness.official.sentences:spoken_parts"
"""The suite's trials with the sentences of a RoboSPA checkout."""
Parts = tuple[str, dict[str, object]]
"""`module:function` of what finds a trial's scene, goal and sentence, and its other arguments."""


class WorldKind:
    """A kind of world: its `name`, the `factory` (`module:name`) that opens one, and what a run has
    to know before it does. These answers are those of a factory of which nothing is known."""

    draws = False
    """Whether the factory takes `render`: True draws, False does not, None when first needed."""
    shared = False
    """Whether a worker may hold several by itself."""

    def __init__(self, name: str, factory: str) -> None:
        self.name, self.factory = name, factory

    def check(self, settings: EvaluationSettings) -> None:
        """Called first: SettingsError for what this world cannot do."""
        simulation = settings.simulation
        if simulation.assets is not None:
            raise SettingsError("assets are for the official world: add --world official")
        if simulation.robot_assets != "builtin":
            raise SettingsError(
                f"robot_assets {simulation.robot_assets} goes with world official alone: no other "
                "result was had with such pictures"
            )

    def arguments(self, settings: EvaluationSettings) -> dict[str, object]:
        """The factory's keyword arguments, as they stand in the run's manifest."""
        if settings.timing.action_rate is None:
            return {}
        return {"action_steps": steps_of(settings.timing, settings.simulation.control)}

    def parts(self, settings: EvaluationSettings, keys: Sequence[TrialKey]) -> Parts:
        """What finds the scene, goal and sentence of one of `keys`; raises SettingsError. Sentences
        of a checkout are read here, once: workers get them as data."""
        folder, own = settings.selection.instructions, settings.simulation.parts
        if folder is None:
            return own or TASK_PARTS, {}
        if own is not None:
            raise SettingsError("parts has scenes and sentences of its own: leave it out")
        from robospa.harness.official.sentences import read_checkout

        return SPOKEN_PARTS, {"sentences": read_checkout(folder, {key.variant for key in keys})}

    def layout(self, arguments: Mapping[str, object]) -> tuple[LayoutSettings | None, list[str]]:
        """What `arguments` of the parts add to the settings in a manifest, and warnings."""
        return None, []

    def open(self, arguments: Mapping[str, object], render: bool | None = None) -> World:
        """A world; `render`, if it is not None, replaces what `arguments` say of drawing."""
        drawing = {} if render is None or not self.draws else {"render": render}
        opened: World = load(self.factory)(**{**arguments, **drawing})
        return opened


class SapienKind(WorldKind):
    """Simulators of our own: several in a process, all controls and clocks."""

    draws = True
    shared = True

    def check(self, settings: EvaluationSettings) -> None:
        super().check(settings)
        if (world := settings.simulation.world) != self.name:
            raise SettingsError(f"--world {world}: {self.name} takes no options")

    def arguments(self, settings: EvaluationSettings) -> dict[str, object]:
        """Whether it draws (when first needed), and how actions are executed."""
        control = settings.simulation.control
        if settings.timing.action_rate is None:
            return {"render": None, "control": control}
        steps = steps_of(settings.timing, control)
        return {"render": None, "control": FIXED_RATE, "action_steps": steps}


SAPIEN = SapienKind(SAPIEN_NAME, "robospa.harness.sim.sapien_world:SapienWorld")
"""The benchmark's own simulator, assets and rules."""


def world_kind(world: str) -> WorldKind:
    """The kind that `world` names: by an entry point's name, with options after ":" or "?", or by
    `module:factory`. Raises UnknownName."""
    name = re.split("[:?]", world, maxsplit=1)[0]
    if name in names(WORLDS) or ":" not in world:
        kind = find(WORLDS, name, "world")
        if not isinstance(kind, WorldKind):
            raise UnknownName(f"the entry point {name!r} of {WORLDS} is no WorldKind")
        return kind
    return WorldKind(world, world)


def open_world(
    world: str, arguments: Mapping[str, object] | None = None, render: bool | None = None
) -> World:
    """A world of the kind that `world` names; see `WorldKind.open`."""
    return world_kind(world).open(arguments or {}, render)
