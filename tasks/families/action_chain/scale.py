"""Place_Object_Scale_Click: bell onto the scale, object onto the stand, a click, and back again.

Draw: a bell and a fixed scale on the left, from level 2 on a fixed display stand and one of five
things on the right, from level 3 on a fixed pack of cards. Success: the bell was put on the scale,
the thing on the stand, the cards were clicked with a closed gripper, and bell and thing are back
on the table (as far as the level asks).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Pose
from robospa.tasks.families.action_chain.stations import button, frame_of, there_and_back
from robospa.tasks.families.tabletop import Item, draw_look, named, standing
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.parts import Part, Rests, on_spot
from robospa.tasks.goals.repeat import ActionCounter
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText
from robospa.tasks.plan import Place, Skill
from robospa.tasks.sampling.places import retry
from robospa.tasks.sampling.turns import Turnable, free_beside
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "scale.toml")

STEPS = {1: "b", 2: "bo", 3: "boc", 4: "bocB", 5: "bocBO"}
"""What is asked for: b bell onto the scale, o thing onto the stand, c a click, B and O back."""

THINGS = ("mouse", "stapler", "rubikscube", "toycar", "remote_control")
FIXED = {"scale": "electronic_scale", "stand": "display_stand", "cards": "playing_cards"}

REGIONS = {
    "bell": ((-0.25, -0.02), (-0.2, 0.05), math.pi),
    "scale": ((-0.25, -0.02), (-0.2, -0.05), math.pi),
    "stand": ((0.10, 0.20), (-0.18, -0.08), math.pi / 6),
    "object": ((0.12, 0.28), (-0.02, 0.10), math.pi / 3),
    "cards": ((-0.25, 0.25), (-0.2, 0.0), math.pi),
}
"""x, y and the largest turn about z of each thing, in the order in which they are placed."""

FIRST_LEVEL = {"bell": 1, "scale": 1, "stand": 2, "object": 2, "cards": 3}
CARDS_OFF = 0.05
"""The cards are at least this far [m] from the middle line: they belong to one arm."""
DISTANCE = {("scale", "bell"): 0.15, ("object", "stand"): 0.1}
CARDS_DISTANCE = 0.14
GAP, TRIES = 0.005, 60
"""Free space [m] between footprints; places that are looked at for a thing."""
ON, BELOW, ABOVE = 0.035, -0.01, 0.02
"""Largest level offset [m] from the middle, and height [m] relative to the place."""
BACK = 0.005
"""Largest height [m] above or below that at the start when it is back on the table."""
GRIP = (0.0, 0.0, 0.015)

LEVELS = {
    n: Level(candidates=len(set(steps.lower())), subtasks=n, steps=200 * n)
    for n, steps in STEPS.items()
}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """Things by their role; those of later levels may be missing."""

    bell: str
    scale: str
    object: str = ""
    stand: str = ""
    cards: str = ""

    @property
    def moves(self) -> dict[str, tuple[str, str]]:
        """What goes onto what, by the letter of the step."""
        return {"b": (self.bell, self.scale), "o": (self.object, self.stand)}


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """This level's things, each in its region."""
    return retry(
        lambda: _draw(level, rng, workcell), f"objects of Place_Object_Scale_Click level {level}"
    )


def _draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample | None:
    items: list[Item] = []
    taken: dict[str, tuple[Turnable, float]] = {}
    thing = THINGS[int(rng.integers(len(THINGS)))]
    for role in REGIONS:
        if level < FIRST_LEVEL[role]:
            continue
        asset = {"object": thing, "bell": "bell"}.get(role) or FIXED[role]
        look = draw_look(rng, asset)
        placed = _placed(rng, workcell, role, (asset, look), taken)
        if placed is None:
            return None
        taken[role] = placed
        pose = standing(placed[0].place, placed[1])
        items.append(Item(role, asset, pose, look, fixed=role in FIXED))
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(**names))


def _placed(
    rng: np.random.Generator,
    workcell: Workcell,
    role: str,
    thing: tuple[str, dict[str, int]],
    taken: Mapping[str, tuple[Turnable, float]],
) -> tuple[Turnable, float] | None:
    """A place and a turn of `role` free of what is there, whole in view; None if none is found."""
    x, y, most = REGIONS[role]
    off = CARDS_OFF if role == "cards" else 0.0
    for _ in range(TRIES):
        point = (float(rng.uniform(*x)), float(rng.uniform(*y)))
        item, turn = Turnable(*thing, point), float(rng.uniform(-most, most))
        apart = all(
            math.dist(point, there.place) >= _least(role, other)
            for other, (there, _) in taken.items()
        )
        if (
            apart
            and abs(point[0]) >= off
            and free_beside(workcell, item, turn, list(taken.values()), GAP)
        ):
            return item, turn
    return None


def _least(role: str, other: str) -> float:
    """Least distance [m] of two things' centres."""
    return CARDS_DISTANCE if role == "cards" else DISTANCE.get((role, other), 0.0)


def _back(pose: Pose, start: Pose) -> bool:
    """The object is as high as at the start."""
    return abs(pose.position[2] - start.position[2]) < BACK


def goal(scene: Scene) -> Checklist:
    """On scale and stand (latched once it has to go back), a click, back on the table."""
    facts, steps = Facts.of(scene), STEPS[scene.level]
    subtasks: list[ActionCounter | Part] = []
    for step in steps:
        if step == "c":
            subtasks.append(button(scene, facts.cards, own_side_closed=True))
            continue
        name, place = facts.moves[step.lower()]
        if step in facts.moves:
            near = on_spot(ON, BELOW, ABOVE, Pose(), frame_of(scene, place))
            latched = step.upper() in steps
            subtasks.append(Rests(name, (place,), near, latched=latched, grip=GRIP))
        else:
            subtasks.append(Rests(name, (), _back, after=steps.index(step.lower()), grip=GRIP))
    return Checklist(subtasks)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """The bell by the left arm, the thing by the right one, there and back to where it was."""
    facts = Facts.of(scene)
    moves = {
        key: Place(name, on=place, arm="left" if key == "b" else "right")
        for key, (name, place) in facts.moves.items()
        if name
    }
    return there_and_back(scene, STEPS[scene.level], moves, facts.cards or None)


def slots(scene: Scene) -> Slots:
    """Phrasings for the things."""
    phrases = TEXT.slots("bell", "scale")
    if scene.level >= 2:
        phrases |= TEXT.slots(f"object.{scene.object(Facts.of(scene).object).asset}", "stand")
    return phrases | (TEXT.slots("cards") if scene.level >= 3 else {})


TASK = Task(
    name="Place_Object_Scale_Click",
    category="CAC",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Put the bell on the scale and an object on the stand, click the cards, and undo both.",
    success=(
        "The bell was let go on the scale, the object on the display stand, the cards were clicked "
        "by the closed gripper on their side, and both lie on the table again (as far as asked)."
    ),
)
