"""Tasks of several kinds of action, one after the other: a level asks for the first of them.

A step is a letter, and a `Station` says what it means. The order is asked for, but not enforced.
"""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from robospa.tasks.families.table import Item, frame_of, presses, sample, side, side_of
from robospa.tasks.goals.checklist import CHAIN, Checklist, Subtask, by_turns
from robospa.tasks.goals.conditions import Condition
from robospa.tasks.instructions import Slots, Templates
from robospa.tasks.plan import Pick, Place, Press, Skill
from robospa.tasks.sampling.places import NoRoom, Point, Range, retry
from robospa.tasks.sampling.turns import Turnable, free_beside
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Params
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

Region = tuple[Range, Range, float]
"""x and y [m] and the largest turn about z [rad] of a thing."""
TRIES = 60
"""Places that are looked at for a thing."""
LIFT = 0.09
"""How high things are lifted between two places on the table [m]."""


@dataclass(frozen=True)
class Station:
    """What a step asks for, and what the expert does; `at_once`: for all steps of its letter.

    A `tool` is an object that is only used for it.
    """

    subtask: Subtask
    skills: tuple[Skill, ...]
    at_once: bool = False
    tool: str = ""


@dataclass(frozen=True)
class ActionChain:
    """A chain of actions. `steps` are the letters of each level, `limits` its step limits.

    `items` draws a level's things or raises NoRoom; their roles are the fields of `facts`. Both
    grippers have to be open at the end at the levels `released`. A thing is held within
    `radius` [m] of its origin. Letters in `turns` share a turn. The expert ends with `end`.
    """

    name: str
    steps: Mapping[int, str]
    limits: Mapping[int, int]
    facts: type[SceneFacts]
    items: Callable[[int, np.random.Generator, Workcell], Sequence[Item]]
    station: Callable[[Scene, str], Station]
    released: Container[int] = ()
    radius: float = 0.12
    turns: Mapping[str, int] = field(default_factory=dict)
    end: tuple[Skill, ...] = ()
    table_shift: tuple[float, float] = (0.0, 0.0)

    def task(
        self,
        templates: Callable[[int], Templates],
        slots: Callable[[Scene], Slots],
        summary: str,
        success: str,
    ) -> Task:
        """The task with these words."""
        levels = {
            n: Level(len(set(steps.lower())), len(steps), self.limits[n])
            for n, steps in self.steps.items()
        }
        return Task(
            name=self.name,
            category="CAC",
            levels=levels,
            draw=self.draw,
            goal=self.goal,
            plan=self.plan,
            templates=templates,
            slots=slots,
            summary=summary,
            success=success,
        )

    def draw(self, level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
        items = retry(
            lambda: self.items(level, rng, workcell), f"objects of {self.name} level {level}"
        )
        return sample(rng, items, self.facts, self.table_shift)

    def goal(self, scene: Scene) -> Checklist:
        steps = self.steps[scene.level]
        stations = {step: self.station(scene, step) for step in dict.fromkeys(steps)}
        return Checklist(
            [stations[step].subtask for step in steps],
            scene.level in self.released,
            self.radius,
            early=by_turns([self.turns.get(step, i) for i, step in enumerate(steps)]),
            tools={s.tool: steps.index(step) for step, s in stations.items() if s.tool},
            figures=CHAIN,
        )

    def plan(self, scene: Scene) -> tuple[Skill, ...]:
        skills: list[Skill] = []
        steps = self.steps[scene.level]
        for i, step in enumerate(steps):
            station = self.station(scene, step)
            if not station.at_once or step not in steps[:i]:
                skills += station.skills
        return (*skills, *self.end)


def pressing_arm(scene: Scene, name: str) -> str:
    """The arm on the side of an object's press point."""
    pose = scene.object(name).pose
    return side(pose.apply(frame_of(scene, name, "press").position)[0])


def click(scene: Scene, name: str) -> Station:
    """A click of the closed gripper on the object's side."""
    return Station(presses(scene, name, closed=True), (Press(name, arm=side_of(scene, name)),))


def there(place: Place, condition: Condition) -> Station:
    """A thing brought to its place, where `condition` holds."""
    return Station(condition, (Pick(place.object, LIFT, place.arm), place))


def back(scene: Scene, place: Place, condition: Condition) -> Station:
    """The same thing back where it was at the start, where `condition` holds."""
    at = scene.object(place.object).pose.position
    return there(Place(place.object, at, arm=place.arm), condition)


def placed(
    rng: np.random.Generator,
    workcell: Workcell,
    thing: tuple[str, Params],
    region: Region,
    others: Sequence[tuple[Turnable, float, float]],
    gap: float,
    off_middle: float = 0.0,
) -> tuple[Turnable, float]:
    """A place and a turn, whole in view, free of `others` (thing, turn, least distance [m]).

    Footprints are `gap` [m] apart, |x| is at least `off_middle` [m]. NoRoom if none is found.
    """
    x, y, most = region
    for _ in range(TRIES):
        point: Point = (rng.uniform(*x), rng.uniform(*y))
        item, turn = Turnable(*thing, point), rng.uniform(-most, most)
        apart = all(math.dist(point, other.place) >= least for other, _, least in others)
        free = apart and abs(point[0]) >= off_middle
        if free and free_beside(workcell, item, turn, [(o, t) for o, t, _ in others], gap):
            return item, turn
    raise NoRoom(f"no free place of a {thing[0]}")
