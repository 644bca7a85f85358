"""Place_Burger_Fries_Click_Bell: serve burger and fries on the tray, ring, and take them back.

Draw: a fixed tray in the middle, the burger at its left, from level 2 on the fries at its right,
from level 3 on a fixed bell behind. Success: burger and fries were put on their halves of the tray,
the bell was clicked with a closed gripper, both are back where they were (as far as the
level asks).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Pose
from robospa.tasks import objects
from robospa.tasks.families.action_chain.stations import button, frame_of, there_and_back
from robospa.tasks.families.tabletop import Item, draw_look, in_view, named, radius, standing
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.parts import Part, Rests, on_spot
from robospa.tasks.goals.repeat import ActionCounter
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText
from robospa.tasks.plan import Place, Skill
from robospa.tasks.sampling.places import Point, free_point, retry
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "tray.toml")

STEPS = {1: "b", 2: "bf", 3: "bfc", 4: "bfcB", 5: "bfcBF"}
"""What is asked for: b burger and f fries onto the tray, c a click, B and F back again."""

FOOD = {"b": ("burger", "hamburger"), "f": ("fries", "french_fries")}
HALF = {"burger": "left", "fries": "right"}
"""The half of the tray for each, and the arm that serves it."""

TRAY_Y = (-0.15, -0.10)
X = {"burger": (-0.30, -0.25), "fries": (0.20, 0.30)}
FOOD_Y = (-0.15, -0.07)
BELL_X, BELL_Y, BELL_OFF = (-0.25, 0.25), (0.02, 0.12), 0.05
GAP = 0.01
ON_TRAY, TRAY_HEIGHT = 0.08, 0.02
"""Largest level offset [m] from the middle of the half, and height [m] above the tray's floor."""
HOME, HOME_HEIGHT = 0.04, 0.005
"""Largest offset [m] from the place at the start, in the plane and in height."""
CLICK_BOX = (0.025, 0.025, 0.03)
GRIP = (0.0, 0.0, 0.025)

LEVELS = {
    n: Level(candidates=len(set(steps.lower())), subtasks=n, steps=200 * n)
    for n, steps in STEPS.items()
}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """Things by their role; those of later levels may be missing."""

    tray: str
    burger: str
    fries: str = ""
    bell: str = ""

    @property
    def food(self) -> dict[str, str]:
        """What is served, by role."""
        return {"burger": self.burger, "fries": self.fries}


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """The tray in the middle, food beside it, the bell behind."""
    what = f"objects of Place_Burger_Fries_Click_Bell level {level}"
    return retry(lambda: _draw(level, rng, workcell), what)


def _draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample | None:
    look = draw_look(rng, "tray")
    middle = (0.0, float(rng.uniform(*TRAY_Y)))
    items = [Item("tray", "tray", standing(middle), look, fixed=True)]
    width, depth, _ = objects.object_model("tray", look).size
    taken: list[tuple[Point, float]] = []
    for key, (role, asset) in FOOD.items():
        if key in STEPS[level]:
            look = draw_look(rng, asset)
            point = free_point(rng, X[role], FOOD_Y, [], allowed=in_view(workcell, asset, look))
            room = radius(asset, look)
            if point is None or abs(point[0]) < width / 2 + room + GAP:
                return None
            taken.append((point, room))
            items.append(Item(role, asset, standing(point), look))
    if "c" in STEPS[level]:
        look = draw_look(rng, "bell")
        room = radius("bell", look) + GAP
        seen = in_view(workcell, "bell", look)

        def allowed(point: Point) -> bool:
            beyond = point[1] > middle[1] + depth / 2 + room or abs(point[0]) > width / 2 + room
            return abs(point[0]) >= BELL_OFF and beyond and seen(point)

        far = [(p, r + room) for p, r in taken]
        place = free_point(rng, BELL_X, BELL_Y, far, allowed=allowed)
        if place is None:
            return None
        items.append(Item("bell", "bell", standing(place), look, fixed=True))
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(**names))


def _at_home(pose: Pose, start: Pose) -> bool:
    """The object lies where it lay at the start."""
    (x, y, z), (sx, sy, sz) = pose.position, start.position
    return math.hypot(x - sx, y - sy) < HOME and abs(z - sz) < HOME_HEIGHT


def goal(scene: Scene) -> Checklist:
    """Food on the tray (latched once it has to go back), a click, food at home again."""
    facts, steps = Facts.of(scene), STEPS[scene.level]
    back = "B" in steps
    subtasks: list[ActionCounter | Part] = []
    for step in steps:
        if step == "c":
            subtasks.append(button(scene, facts.bell, CLICK_BOX, own_side_closed=True))
            continue
        role, _ = FOOD[step.lower()]
        if step in FOOD:
            spot = frame_of(scene, facts.tray, HALF[role])
            near = on_spot(ON_TRAY, -TRAY_HEIGHT, TRAY_HEIGHT, Pose(), spot)
            subtasks.append(Rests(facts.food[role], (facts.tray,), near, latched=back, grip=GRIP))
        else:
            after = steps.index(step.lower())
            subtasks.append(Rests(facts.food[role], (), _at_home, after=after, grip=GRIP))
    return Checklist(subtasks)


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Each food by the arm on its side, there and back."""
    facts = Facts.of(scene)
    tray = scene.object(facts.tray)
    moves = {}
    for key, (role, _) in FOOD.items():
        if facts.food[role]:
            place = tray.pose.apply(frame_of(scene, tray.name, HALF[role]).position)
            moves[key] = Place(facts.food[role], place, arm=HALF[role])
    return there_and_back(scene, STEPS[scene.level], moves, facts.bell or None)


def slots(scene: Scene) -> Slots:
    """Phrasings for food, tray and bell."""
    return TEXT.slots(*("burger", "tray", "fries", "bell")[: scene.level + 1])


TASK = Task(
    name="Place_Burger_Fries_Click_Bell",
    category="CAC",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Put burger and fries on the tray, ring the bell, and take them back to their places.",
    success=(
        "Burger and fries were let go on the left and right half of the tray, the bell was clicked "
        "by the closed gripper on its side, and both are back within 4 cm (as far as asked)."
    ),
)
