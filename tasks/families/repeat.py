"""Press_Stapler_Repeat, Click_Bell_Repeat, Lift_Pot_Repeat, Lift_Fan_Repeat: so many times.

The level is the count. Stapler: one fixed stapler, any yaw, in the middle of the table. Bell: one
fixed bell, left or right of the middle. A press counts when a touch begins, after 0.1 s without
one. Pot and fan: a pot with two handles, on both of which it has to hang, or a light fan; up and
back to where it was.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robospa.tasks import objects
from robospa.tasks.families import table
from robospa.tasks.families.chain import pressing_arm
from robospa.tasks.goals import counters
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.instructions import NUMBERS, Slots, TaskText, acting_arm, by_count
from robospa.tasks.plan import Press, RaiseLower, Skill
from robospa.tasks.sampling.places import Range
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, Task
from robospa.workcell import Workcell

STAPLER_TEXT = TaskText.beside(__file__, "repeat_stapler.toml")
BELL_TEXT = TaskText.beside(__file__, "repeat_bell.toml")
LIFT_TEXT = TaskText.beside(__file__, "repeat_lift.toml")

LEVELS = {n: Level(candidates=1, subtasks=n, steps=200 * n) for n in range(1, 6)}


def _task(
    name: str,
    facts: type[SceneFacts],
    thing: Callable[[np.random.Generator, Workcell], table.Item],
    counter: Callable[[Scene, str], counters.ActionCounter],
    expert: Callable[[Scene, str], tuple[Skill, ...]],
    text: TaskText,
    slots: Callable[[Scene], Slots],
    summary: str,
    success: str,
    figures: Sequence[str] = counters.FIGURES,
    radius: float = 0.12,
) -> Task:
    """The task to do what `counter` counts with the only `thing` as often as the level says.

    Subtask i is count i + 1, latched. Success latches at the last one asked for, so one press too
    many cannot happen, and it needs no retreat (official).
    """

    def goal(scene: Scene) -> Checklist:
        counts = [counter(scene, scene.objects[0].name)] * _count(scene)
        return Checklist(counts, radius=radius, figures=figures)

    return Task(
        name=name,
        category="RPF",
        levels=LEVELS,
        draw=lambda level, rng, cell: table.sample(rng, [thing(rng, cell)], facts, count=level),
        goal=goal,
        plan=lambda scene: expert(scene, scene.objects[0].name),
        templates=text.templates,
        slots=slots,
        summary=summary,
        success=success,
    )


def _count(scene: Scene) -> int:
    return int(scene.facts["count"])


def _words(text: TaskText, count: int, own: Sequence[str], many: str) -> Slots:
    if count == 1:
        return text.slots(*own)
    return text.slots(*own, f"times.{by_count(count)}", many, count=count, word=NUMBERS[count])


X, Y = (-0.2, 0.2), (-0.1, 0.05)


@dataclass(frozen=True)
class StaplerFacts(SceneFacts):
    """The stapler, and how often it is pressed."""

    stapler: str
    count: int


def _stapler(rng: np.random.Generator, workcell: Workcell) -> table.Item:
    point, turn = (rng.uniform(*X), rng.uniform(*Y)), rng.uniform(-math.pi, math.pi)
    look = table.draw_variant(rng, "stapler")
    return table.thing("stapler", "stapler", point, look, turn, fixed=True)


PRESS_STAPLER = _task(
    "Press_Stapler_Repeat",
    StaplerFacts,
    _stapler,
    table.presses,
    lambda scene, name: (Press(name, arm=pressing_arm(scene, name)),) * _count(scene),
    STAPLER_TEXT,
    lambda scene: _words(STAPLER_TEXT, _count(scene), ["stapler"], "presses"),
    "Press the stapler the given number of times.",
    "The stapler was touched by a gripper near its press point as often as asked, with at least "
    "0.1 s without a touch between presses.",
)

BELL_FAR, BELL_Y, BELL_MIDDLE = 0.25, (-0.2, 0.0), 0.05
HOVER = 0.045
"""How far the expert rises between clicks [m]."""


@dataclass(frozen=True)
class BellFacts(SceneFacts):
    """The bell, and how often it is clicked."""

    bell: str
    count: int


def _bell(rng: np.random.Generator, workcell: Workcell) -> table.Item:
    """One bell in view and off the middle strip; left and right are equally likely."""
    variant = table.draw_variant(rng, "bell")
    model = objects.object_model("bell", variant)
    y = rng.uniform(*BELL_Y)
    low, high = workcell.view_span(y, model.radius, model.size[2])
    if rng.random() < 0.5:
        x = rng.uniform(max(-BELL_FAR, low), -BELL_MIDDLE)
    else:
        x = rng.uniform(BELL_MIDDLE, min(BELL_FAR, high))
    return table.thing("bell", "bell", (x, y), variant, fixed=True)


def _bell_slots(scene: Scene) -> Slots:
    words = _words(BELL_TEXT, _count(scene), ["bell", "closed"], "clicks")
    return words | acting_arm(table.side_of(scene, scene.objects[0].name))


CLICK_BELL = _task(
    "Click_Bell_Repeat",
    BellFacts,
    _bell,
    lambda scene, name: table.presses(scene, name, closed=True),
    lambda scene, name: (Press(name, hover=HOVER, arm=table.side_of(scene, name)),) * _count(scene),
    BELL_TEXT,
    _bell_slots,
    "Click the bell the given number of times.",
    "The bell was touched near its top, by a gripper and with the gripper on its side closed, as "
    "often as asked, with at least 0.1 s without a touch between clicks.",
)

UP = 0.82
"""A lifted pot's origin is higher than this [m, world]."""
DOWN, ASIDE = (-0.03, 0.07), 0.08
"""A pot is down between these heights over its first one, and this near to its place [m]."""
FAN_UP, FAN_WAY, FAN_TURN = 0.05, 0.04, 0.05
"""Rise [m] of a lifted fan; errors in each coordinate [m] and quaternion component at home."""
THING_RADIUS = 0.2
"""A gripper that is not open and this near [m] to the origin holds the thing."""


@dataclass(frozen=True)
class LiftFacts(SceneFacts):
    """What is lifted, and how often."""

    thing: str
    count: int


def _lift_task(
    name: str,
    asset: str,
    x: Range,
    y: Range,
    yaw: float,
    rise: float,
    tests: Callable[[Scene, str], tuple[counters.PoseTest, counters.PoseTest]],
    both: bool,
    success: str,
    variants: Sequence[int] | None = None,
) -> Task:
    """The task to lift an `asset`, which the expert lifts by `rise` [m] with `both` arms or one.

    `tests` are those of being up and of being back.
    """

    def item(rng: np.random.Generator, workcell: Workcell) -> table.Item:
        at, turn = (rng.uniform(*x), rng.uniform(*y)), rng.uniform(-yaw, yaw)
        return table.thing("thing", asset, at, table.draw_variant(rng, asset, variants), turn)

    def expert(scene: Scene, thing: str) -> tuple[Skill, ...]:
        arms = ("left", "right") if both else (table.side_of(scene, thing),)
        return (RaiseLower(thing, rise, _count(scene), arms),)

    own = [f"thing.{name}", f"hands.{name}"]
    return _task(
        f"Lift_{name.capitalize()}_Repeat",
        LiftFacts,
        item,
        lambda scene, thing: counters.CycleCounter(thing, *tests(scene, thing), THING_RADIUS),
        expert,
        LIFT_TEXT,
        lambda scene: _words(LIFT_TEXT, _count(scene), own, "lifts"),
        f"Lift the {name} and put it back, the given number of times.",
        success,
        ("lifts", "released", "drops"),
        THING_RADIUS,
    )


def _pot_tests(scene: Scene, name: str) -> tuple[counters.PoseTest, counters.PoseTest]:
    handles = [table.frame_of(scene, name, arm).position for arm in ("left", "right")]
    up = counters.held_up(name, UP + scene.table_rise, handles)
    return up, counters.put_down(name, DOWN, ASIDE)


def _fan_tests(scene: Scene, name: str) -> tuple[counters.PoseTest, counters.PoseTest]:
    return counters.raised(name, FAN_UP), counters.back_home(name, FAN_WAY, FAN_TURN)


LIFT = (
    _lift_task(
        "pot",
        "kitchen_pot",
        (-0.05, 0.05),
        (-0.05, 0.05),
        math.pi / 8,
        0.11,
        _pot_tests,
        True,
        "As often as asked, the pot was lifted above 0.82 m upright with a gripper at either "
        "handle, and then stood within 8 cm of its place again.",
    ),
    _lift_task(
        "fan",
        "fan",
        (-0.1, 0.1),
        (-0.15, -0.05),
        0.0,
        0.08,
        _fan_tests,
        False,
        "As often as asked, the fan was lifted by 5 cm and then was back within 4 cm and about "
        "6 degrees of its place.",
        variants=(0, 1),  # official models
    ),
)
