"""The definition of a task: figures per level, facts, and pure functions of its scene."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Protocol, Self

import numpy as np

from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.instructions import Phrasings, Templates
from robospa.tasks.plan import Skill
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot
from robospa.trial import BASIC, CATEGORIES, SPATIAL
from robospa.workcell import Workcell


@dataclass(frozen=True)
class SceneFacts:
    """What a task drew besides the objects: a frozen dataclass that `draw` writes and `of` reads.

    Fields are strings, numbers, and tuples of them. In the scene they are plain JSON values. A
    field at its default is left out, so that what only some levels have needs a default that says
    "there is none" ("" or 0).
    """

    def to_json(self) -> dict[str, object]:
        """Plain JSON values by field, without those at their default."""
        values = {f.name: (getattr(self, f.name), f.default) for f in fields(self)}
        return {
            name: _plain(value) for name, (value, default) in values.items() if value != default
        }

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """The facts of a scene; what the class has no field for is left out."""
        known = {f.name: scene.facts[f.name] for f in fields(cls) if f.name in scene.facts}
        return cls(**{name: _frozen(value) for name, value in known.items()})


def _plain(value: object) -> object:
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _frozen(value: Any) -> Any:
    return tuple(_frozen(item) for item in value) if isinstance(value, list | tuple) else value


class Tracker(Protocol):
    """A goal as a state machine over snapshots; see `robospa.tasks.goals`.

    `start` is called once with the settled scene, `update` at 50 Hz of simulated time from the
    first action on.

    `needs_contacts` asks for `Snapshot.contacts`; without `roles` grasp attempts are not recorded.
    """

    total: int
    needs_contacts: bool

    @property
    def roles(self) -> Mapping[str, ObjectRole]:
        """The objects of the goal and its distractors, by name."""

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Events that hold before the first action."""

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Events of this instant."""

    def diagnostics(self) -> Mapping[str, object]:
        """JSON values for the record: how the goal was met or missed."""


@dataclass(frozen=True)
class SceneSample:
    """A task's random draw for a seed: objects, facts and, rarely, a shifted table [m]."""

    objects: tuple[SceneObject, ...]
    facts: SceneFacts
    table_shift: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Level:
    """`candidates` is the paper's n, `subtasks` its T, `steps` the limit in policy actions."""

    candidates: int
    subtasks: int
    steps: int


Draw = Callable[[int, np.random.Generator, Workcell], SceneSample]
"""A level's draw. Scenes are the same for every robot: there is one workcell."""


@dataclass(frozen=True)
class Task:
    """A base task. `draw`, `goal`, `plan`, `templates` and `slots` are pure functions.

    `templates(level)` are the sentences with slots, `slots(scene)` gives for every slot of them the
    phrasings that may fill it: `{slot: (train phrasings, held-out phrasings)}`, each a non-empty
    tuple.
    """

    name: str
    category: str
    levels: Mapping[int, Level]
    draw: Draw
    goal: Callable[[Scene], Tracker]
    plan: Callable[[Scene], tuple[Skill, ...]]
    templates: Callable[[int], Templates]
    slots: Callable[[Scene], Mapping[str, Phrasings]]
    summary: str
    success: str
    lead: Callable[[Scene], float] | None = None
    """By how much [m] what is asked for is ahead of what comes closest; None where nothing is."""

    def __post_init__(self) -> None:
        if self.category not in (known := (*CATEGORIES, *BASIC)):
            raise ValueError(f"{self.name}: no category {self.category!r} in {', '.join(known)}")

    @property
    def dimension(self) -> str:
        """ "spatial", "procedural" or "basic" (the appendix's references, outside the 280)."""
        if self.category in BASIC:
            return "basic"
        return "spatial" if self.category in SPATIAL else "procedural"
