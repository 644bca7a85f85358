"""Place_Phone_Press_Stapler: phone onto its stand, press the stapler, empty the small bin.

Draw: a phone and a fixed stand on the right, from level 2 on a fixed stapler, at level 5 a small
bin with a ball in it on the left and the bin on the floor; the table stands 0.3 m farther right.
Success: the phone is on the stand, the stapler was pressed as often as asked, the ball lies in the
bin on the floor. The order is asked for, but not enforced.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Pose
from robospa.tasks.families.action_chain.stations import button, frame_of
from robospa.tasks.families.dustbin.floor_bin import BIN, TABLE_SHIFT, container
from robospa.tasks.families.tabletop import Item, named, standing
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.parts import Inside, Near, Part, Rests
from robospa.tasks.goals.repeat import ActionCounter
from robospa.tasks.goals.subtask_flags import inside_box
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText, times
from robospa.tasks.objects import look_count
from robospa.tasks.plan import Dock, Home, Pour, Press, Skill
from robospa.tasks.sampling.places import retry
from robospa.tasks.sampling.turns import Turnable, free_beside
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "phone_stapler.toml")

PRESSES = {1: 0, 2: 1, 3: 2, 4: 3, 5: 3}
DUMP_LEVEL = 5
"""The level at which the small bin has to be emptied."""

Region = tuple[tuple[float, float], tuple[float, float], float]
REGIONS: dict[str, Region] = {
    "phone": ((0.05, 0.25), (-0.2, 0.0), 0.7),
    "phone_stand": ((0.0, 0.15), (0.0, 0.2), 0.0),
    "stapler": ((0.0, 0.2), (-0.2, -0.05), math.pi),
    "table_trash_bin": ((-0.2, -0.07), (-0.2, 0.0), math.pi / 8.5),
}
"""x, y and the largest turn about z of each thing."""

PHONE_DISTANCE = 0.15
"""Least distance [m] from phone to stand."""
LOOKS = {"phone_stand": (0, 1)}
"""Looks that are used, where not all: the official models."""
GAP, TRIES = 0.01, 60
"""Free space [m] between footprints; places that are looked at for a thing."""
BOX = (0.045, 0.04, 0.04)
"""Half sizes [m] of the box around the stand's place in which the phone's lower end counts."""
GARBAGE_XY, GARBAGE_Z = 0.01, 0.78
"""How far off the small bin's axis the ball starts, and how high [m]."""

LEVELS = {
    n: Level(candidates=1 + (n > 1) + (n == DUMP_LEVEL), subtasks=n, steps=steps)
    for n, steps in {1: 400, 2: 600, 3: 800, 4: 1000, 5: 1300}.items()
}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """Things by their role; those of later levels may be missing."""

    phone: str
    phone_stand: str
    stapler: str = ""
    table_trash_bin: str = ""
    garbage: str = ""
    dustbin: str = ""


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """This level's things, each in its region, no two touching."""
    return retry(
        lambda: _draw(level, rng, workcell), f"objects of Place_Phone_Press_Stapler level {level}"
    )


def _draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample | None:
    items: list[Item] = []
    taken: list[tuple[Turnable, float]] = []
    wanted = ["phone", "phone_stand", *(["stapler"] if PRESSES[level] else [])]
    for asset in (*wanted, *(["table_trash_bin"] if level == DUMP_LEVEL else [])):
        looks = LOOKS.get(asset) or range(look_count(asset))
        look = {"look": int(looks[int(rng.integers(len(looks)))])}
        least = PHONE_DISTANCE if asset == "phone_stand" else 0.0
        placed = _placed(rng, workcell, asset, look, [(t, turn, least) for t, turn in taken])
        if placed is None:
            return None
        taken.append(placed)
        pose = standing(placed[0].place, placed[1])
        items.append(Item(asset, asset, pose, look, fixed=asset in ("phone_stand", "stapler")))
    if level == DUMP_LEVEL:
        dx, dy = (float(rng.uniform(-GARBAGE_XY, GARBAGE_XY)) for _ in range(2))
        bin_x, bin_y = taken[-1][0].place
        start = Pose((bin_x + dx, bin_y + dy, GARBAGE_Z))
        items.append(Item("garbage", "garbage", start, {"look": 0}))
        items.append(Item("dustbin", "dustbin", BIN, {"look": 0}, fixed=True))
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(**names), TABLE_SHIFT)


def _placed(
    rng: np.random.Generator,
    workcell: Workcell,
    asset: str,
    look: dict[str, int],
    others: Sequence[tuple[Turnable, float, float]],
) -> tuple[Turnable, float] | None:
    """A place and a turn free of `others` (thing, turn, least distance); None if none is found."""
    x, y, most = REGIONS[asset]
    for _ in range(TRIES):
        point = (float(rng.uniform(*x)), float(rng.uniform(*y)))
        turn = float(rng.uniform(-most, most))
        item = Turnable(asset, look, point)
        apart = all(math.dist(point, other.place) >= least for other, _, least in others)
        if apart and free_beside(workcell, item, turn, [(o, t) for o, t, _ in others], GAP):
            return item, turn
    return None


def _within(box: tuple[float, float, float], own: Pose, frame: Pose) -> Near:
    """The object's frame `own` lies in the box around `frame` of the target."""

    def near(pose: Pose, target: Pose) -> bool:
        return inside_box(pose.apply(own.position), target.apply(frame.position), box)

    return near


def goal(scene: Scene) -> Checklist:
    """Phone on the stand, presses, and the ball in the bin; only the presses latch."""
    facts = Facts.of(scene)
    stand = facts.phone_stand
    near = _within(BOX, frame_of(scene, facts.phone, "end"), frame_of(scene, stand, "end"))
    subtasks: list[ActionCounter | Part] = [Rests(facts.phone, (stand,), near)]
    if facts.stapler:
        subtasks += [button(scene, facts.stapler)] * PRESSES[scene.level]
    if scene.level == DUMP_LEVEL:
        inside = container(scene.object(facts.dustbin))
        subtasks.append(Inside(facts.garbage, facts.dustbin, inside, latched=False))
        tools = {facts.table_trash_bin: DUMP_LEVEL - 1}
        return Checklist(subtasks, may_fall=inside.over, tools=tools)
    return Checklist(subtasks)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """The right arm docks the phone and presses, the left one empties the small bin."""
    facts = Facts.of(scene)
    skills: list[Skill] = [Dock(facts.phone, on=facts.phone_stand, arm="right")]
    if facts.stapler:
        skills += [Press(facts.stapler, arm="right")] * PRESSES[scene.level]
    if scene.level == DUMP_LEVEL:
        skills += [Home("right"), Pour(facts.table_trash_bin, into=facts.dustbin, arm="left")]
    return tuple(skills)


def slots(scene: Scene) -> Slots:
    """Phrasings for the things."""
    phrases = TEXT.slots("phone", "stand")
    if PRESSES[scene.level]:
        phrases |= TEXT.slots("stapler") | {"times": times(PRESSES[scene.level])}
    return phrases | (TEXT.slots("bin", "dustbin") if scene.level == DUMP_LEVEL else {})


TASK = Task(
    name="Place_Phone_Press_Stapler",
    category="CAC",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Put the phone on its stand, press the stapler, empty the small bin.",
    success=(
        "The phone was let go on the stand and is there, the stapler was pressed as often as "
        "asked, and the ball lies inside the bin on the floor (as far as the level asks)."
    ),
)
