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

from robospa.geometry import Vec3
from robospa.tasks import objects
from robospa.tasks.families import table
from robospa.tasks.families.chain import button, pressing_arm
from robospa.tasks.goals import counters
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.instructions import NUMBERS, Slots, TaskText, acting_arm, by_count
from robospa.tasks.plan import Press, RaiseLower, Skill
from robospa.tasks.sampling.places import Range
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

STAPLER_TEXT = TaskText.beside(__file__, "repeat_stapler.toml")
BELL_TEXT = TaskText.beside(__file__, "repeat_bell.toml")
LIFT_TEXT = TaskText.beside(__file__, "repeat_lift.toml")

LEVELS = {n: Level(candidates=1, subtasks=n, steps=200 * n) for n in range(1, 6)}


def presses(
    scene: Scene,
    name: str,
    times: int,
    box: Vec3 = counters.PRESS_BOX,
    own_side_closed: bool = False,
) -> Checklist:
    """The goal of so many presses; subtask i is press i + 1, latched.

    Success latches at the last one asked for, so one press too many cannot happen, and it needs no
    retreat (official).
    """
    presses = button(scene, name, box, own_side_closed)
    return Checklist([presses] * times, figures=counters.FIGURES)


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


def _draw_stapler(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    point, turn = (rng.uniform(*X), rng.uniform(*Y)), rng.uniform(-math.pi, math.pi)
    look = table.draw_variant(rng, "stapler")
    items = [table.thing("stapler", "stapler", point, look, turn, fixed=True)]
    return table.sample(rng, items, lambda n: StaplerFacts(n["stapler"], level))


def _stapler_goal(scene: Scene) -> Checklist:
    facts = StaplerFacts.of(scene)
    return presses(scene, facts.stapler, facts.count)


def _stapler_plan(scene: Scene) -> tuple[Skill, ...]:
    facts = StaplerFacts.of(scene)
    return (Press(facts.stapler, arm=pressing_arm(scene, facts.stapler)),) * facts.count


PRESS_STAPLER = Task(
    name="Press_Stapler_Repeat",
    category="RPF",
    levels=LEVELS,
    draw=_draw_stapler,
    goal=_stapler_goal,
    plan=_stapler_plan,
    templates=STAPLER_TEXT.templates,
    slots=lambda s: _words(STAPLER_TEXT, StaplerFacts.of(s).count, ["stapler"], "presses"),
    summary="Press the stapler the given number of times.",
    success=(
        "The stapler was touched by a gripper near its press point as often as asked, "
        "with at least 0.1 s without a touch between presses."
    ),
)

BELL_FAR, BELL_Y, BELL_MIDDLE = 0.25, (-0.2, 0.0), 0.05
BELL_BOX = (0.025, 0.025, 0.03)
"""Half sizes [m] of the box around the bell's top in which a touch counts."""
HOVER = 0.045
"""How far the expert rises between clicks [m]."""


@dataclass(frozen=True)
class BellFacts(SceneFacts):
    """The bell, and how often it is clicked."""

    bell: str
    count: int


def _draw_bell(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """One bell in view and off the middle strip; left and right are equally likely."""
    variant = table.draw_variant(rng, "bell")
    model = objects.object_model("bell", variant)
    y = rng.uniform(*BELL_Y)
    low, high = workcell.view_span(y, model.radius, model.size[2])
    if rng.random() < 0.5:
        x = rng.uniform(max(-BELL_FAR, low), -BELL_MIDDLE)
    else:
        x = rng.uniform(BELL_MIDDLE, min(BELL_FAR, high))
    items = [table.thing("bell", "bell", (x, y), variant, fixed=True)]
    return table.sample(rng, items, lambda n: BellFacts(n["bell"], level))


def _bell_goal(scene: Scene) -> Checklist:
    facts = BellFacts.of(scene)
    return presses(scene, facts.bell, facts.count, BELL_BOX, own_side_closed=True)


def _bell_plan(scene: Scene) -> tuple[Skill, ...]:
    facts = BellFacts.of(scene)
    return (Press(facts.bell, hover=HOVER, arm=table.side_of(scene, facts.bell)),) * facts.count


def _bell_slots(scene: Scene) -> Slots:
    facts = BellFacts.of(scene)
    words = _words(BELL_TEXT, facts.count, ["bell", "closed"], "clicks")
    return words | acting_arm(table.side_of(scene, facts.bell))


CLICK_BELL = Task(
    name="Click_Bell_Repeat",
    category="RPF",
    levels=LEVELS,
    draw=_draw_bell,
    goal=_bell_goal,
    plan=_bell_plan,
    templates=BELL_TEXT.templates,
    slots=_bell_slots,
    summary="Click the bell the given number of times.",
    success=(
        "The bell was touched near its top, by a gripper and with the gripper on its side closed, "
        "as often as asked, with at least 0.1 s without a touch between clicks."
    ),
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


@dataclass(frozen=True)
class Lifted:
    """What is lifted: where it may stand, how it is judged, how high the expert lifts it.

    `tests` are those of being up and of being back; `both` arms lift it, or one.
    """

    name: str
    asset: str
    x: Range
    y: Range
    yaw: float
    rise: float
    tests: Callable[[Scene, str], tuple[counters.PoseTest, counters.PoseTest]]
    both: bool
    variants: Sequence[int] | None
    success: str


def _pot_tests(scene: Scene, name: str) -> tuple[counters.PoseTest, counters.PoseTest]:
    handles = [table.frame_of(scene, name, arm).position for arm in ("left", "right")]
    up = counters.held_up(name, UP + scene.table_rise, handles)
    return up, counters.put_down(name, DOWN, ASIDE)


THINGS = (
    Lifted(
        "pot",
        "kitchen_pot",
        (-0.05, 0.05),
        (-0.05, 0.05),
        math.pi / 8,
        0.11,
        _pot_tests,
        True,
        None,
        "As often as asked, the pot was lifted above 0.82 m upright with a gripper at either "
        "handle, and then stood within 8 cm of its place again.",
    ),
    Lifted(
        "fan",
        "fan",
        (-0.1, 0.1),
        (-0.15, -0.05),
        0.0,
        0.08,
        lambda scene, name: (
            counters.raised(name, FAN_UP),
            counters.back_home(name, FAN_WAY, FAN_TURN),
        ),
        False,
        (0, 1),  # official models
        "As often as asked, the fan was lifted by 5 cm and then was back within 4 cm and about "
        "6 degrees of its place.",
    ),
)


def _draw_lifted(
    thing: Lifted, level: int, rng: np.random.Generator, workcell: Workcell
) -> SceneSample:
    point, turn = (rng.uniform(*thing.x), rng.uniform(*thing.y)), rng.uniform(-thing.yaw, thing.yaw)
    look = table.draw_variant(rng, thing.asset, thing.variants)
    items = [table.thing("thing", thing.asset, point, look, turn)]
    return table.sample(rng, items, lambda n: LiftFacts(n["thing"], level))


def _lift_goal(thing: Lifted, scene: Scene) -> Checklist:
    facts = LiftFacts.of(scene)
    up, down = thing.tests(scene, facts.thing)
    counter = counters.CycleCounter(facts.thing, up, down, THING_RADIUS)
    return Checklist(
        [counter] * facts.count, radius=THING_RADIUS, figures=("lifts", "released", "drops")
    )


def _lift_plan(thing: Lifted, scene: Scene) -> tuple[Skill, ...]:
    facts = LiftFacts.of(scene)
    arms = ("left", "right") if thing.both else (table.side_of(scene, facts.thing),)
    return (RaiseLower(facts.thing, thing.rise, facts.count, arms),)


def _lift_task(thing: Lifted) -> Task:
    own = [f"thing.{thing.name}", f"hands.{thing.name}"]
    return Task(
        name=f"Lift_{thing.name.capitalize()}_Repeat",
        category="RPF",
        levels=LEVELS,
        draw=lambda level, rng, workcell: _draw_lifted(thing, level, rng, workcell),
        goal=lambda scene: _lift_goal(thing, scene),
        plan=lambda scene: _lift_plan(thing, scene),
        templates=LIFT_TEXT.templates,
        slots=lambda scene: _words(LIFT_TEXT, LiftFacts.of(scene).count, own, "lifts"),
        summary=f"Lift the {thing.name} and put it back, the given number of times.",
        success=thing.success,
    )


LIFT = tuple(_lift_task(thing) for thing in THINGS)
