"""Click_Bell_Repeat: click a bell a given number of times.

Draw: one fixed bell, left or right of the middle; the level is the count. Success: that many
clicks, each a touch near the bell's top while the gripper on the bell's side is closed, counted
when the touch begins and re-armed by 0.1 s without one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robospa.action_space import ARMS
from robospa.tasks import objects
from robospa.tasks.families.tabletop import Item, draw_look, named, side, standing
from robospa.tasks.goals.repeat import PressCounter, Repeat
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import NUMBERS, TaskText, acting_arm, by_count
from robospa.tasks.plan import Press, Skill
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "click_bell.toml")

FAR, Y, MIDDLE = 0.25, (-0.2, 0.0), 0.05
BOX = (0.025, 0.025, 0.03)
"""Half sizes [m] of the box around the bell's top in which a touch counts."""

HOVER = 0.045
"""How far the expert rises between clicks [m]."""

LEVELS = {n: Level(candidates=1, subtasks=n, steps=200 * n) for n in range(1, 6)}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """The bell, and how often it is clicked."""

    bell: str
    count: int


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """One bell in view and off the middle strip; left and right are equally likely."""
    look = draw_look(rng, "bell")
    model = objects.object_model("bell", look)
    y = float(rng.uniform(*Y))
    low, high = workcell.view_span(y, model.radius, model.size[2])
    if rng.random() < 0.5:
        x = float(rng.uniform(max(-FAR, low), -MIDDLE))
    else:
        x = float(rng.uniform(MIDDLE, min(FAR, high)))
    items = [Item("bell", "bell", standing((x, y)), look, fixed=True)]
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(names["bell"], level))


def goal(scene: Scene) -> Repeat:
    """The click counter of the scene's bell."""
    bell = scene.object(Facts.of(scene).bell)
    frame = objects.object_model(bell.asset, bell.params).frames["touched"]
    arm = ARMS.index(side(bell.pose.position[0]))
    return Repeat(PressCounter(bell.name, frame, BOX, arm), Facts.of(scene).count)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """As many presses as asked for, by the arm on the bell's side."""
    bell = scene.object(Facts.of(scene).bell)
    press = Press(bell.name, hover=HOVER, arm=side(bell.pose.position[0]))
    return (press,) * Facts.of(scene).count


def slots(scene: Scene) -> Slots:
    """Phrasings for the bell, the arm on its side and the count."""
    bell = scene.object(Facts.of(scene).bell)
    arm = acting_arm(side(bell.pose.position[0]))
    count = Facts.of(scene).count
    if count == 1:
        return TEXT.slots("bell", "closed") | arm
    times = f"times.{by_count(count)}"
    return TEXT.slots("bell", "closed", times, "clicks", count=count, word=NUMBERS[count]) | arm


TASK = Task(
    name="Click_Bell_Repeat",
    category="RPF",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Click the bell the given number of times.",
    success=(
        "The bell was touched near its top, by a gripper and with the gripper on its side closed, "
        "as often as asked, with at least 0.1 s without a touch between clicks."
    ),
)
