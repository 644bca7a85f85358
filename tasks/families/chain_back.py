"""Place_Object_Scale_Click and Place_Burger_Fries_Click_Bell: two things there, a click, and back.

Scale: a bell and a fixed scale on the left, from level 2 on a fixed display stand and one of five
things on the right, from level 3 on a fixed pack of cards.

Tray: a fixed tray in the middle, a burger at its left, from level 2 on fries at its right, from
level 3 on a fixed bell behind.
"""

import math
from dataclasses import dataclass

import numpy as np

from robospa.geometry import Pose
from robospa.tasks import objects
from robospa.tasks.families import chain, table
from robospa.tasks.families.chain import ActionChain, Region, Station
from robospa.tasks.goals.conditions import Rests, on_spot
from robospa.tasks.instructions import Slots, TaskText
from robospa.tasks.plan import Place
from robospa.tasks.sampling.places import NoRoom, Point, free_point
from robospa.tasks.sampling.turns import Turnable
from robospa.tasks.scene import Scene
from robospa.tasks.task import SceneFacts
from robospa.workcell import Workcell

SCALE_TEXT = TaskText.beside(__file__, "chain_back_scale.toml")
TRAY_TEXT = TaskText.beside(__file__, "chain_back_tray.toml")

LIMITS = {n: 200 * n for n in range(1, 6)}
SCALE_STEPS = {1: "b", 2: "bo", 3: "boc", 4: "bocB", 5: "bocBO"}
"""What is asked for: b bell onto the scale, o thing onto the stand, c a click, B and O back."""

THINGS = ("mouse", "stapler", "rubikscube", "toycar", "remote_control")
FIXED = {"scale": "electronic_scale", "stand": "display_stand", "cards": "playing_cards"}
REGIONS: dict[str, Region] = {
    "bell": ((-0.25, -0.02), (-0.2, 0.05), math.pi),
    "scale": ((-0.25, -0.02), (-0.2, -0.05), math.pi),
    "stand": ((0.10, 0.20), (-0.18, -0.08), math.pi / 6),
    "object": ((0.12, 0.28), (-0.02, 0.10), math.pi / 3),
    "cards": ((-0.25, 0.25), (-0.2, 0.0), math.pi),
}
"""In the order in which things are placed."""
FIRST_LEVEL = {"bell": 1, "scale": 1, "stand": 2, "object": 2, "cards": 3}
CARDS_OFF = 0.05
"""The cards are at least this far [m] from the middle line: they belong to one arm."""
DISTANCE = {("scale", "bell"): 0.15, ("object", "stand"): 0.1}
CARDS_DISTANCE = 0.14
SCALE_GAP, TRAY_GAP = 0.005, 0.01
"""Free space [m] between footprints."""
ON, BELOW, ABOVE = 0.035, -0.01, 0.02
"""Largest level offset [m] from the middle, and height [m] relative to the place."""
BACK = 0.005
"""Largest height [m] above or below that at the start when a thing is back on the table."""
SCALE_GRIP, TRAY_GRIP = (0.0, 0.0, 0.015), (0.0, 0.0, 0.025)


@dataclass(frozen=True)
class ScaleFacts(SceneFacts):
    """Things by their role; those of later levels may be missing."""

    bell: str
    scale: str
    object: str = ""
    stand: str = ""
    cards: str = ""


def _scale_items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[table.Item]:
    items: list[table.Item] = []
    taken: dict[str, tuple[Turnable, float]] = {}
    thing = THINGS[int(rng.integers(len(THINGS)))]
    for role, region in REGIONS.items():
        if level < FIRST_LEVEL[role]:
            continue
        asset = {"object": thing, "bell": "bell"}.get(role) or FIXED[role]
        variant = table.draw_variant(rng, asset)
        cards = role == "cards"
        others = [
            (*there, CARDS_DISTANCE if cards else DISTANCE.get((role, other), 0.0))
            for other, there in taken.items()
        ]
        off = CARDS_OFF if cards else 0.0
        item, turn = taken[role] = chain.placed(
            rng, workcell, (asset, variant), region, others, SCALE_GAP, off
        )
        items.append(table.thing(role, asset, item.place, variant, turn, fixed=role in FIXED))
    return items


def _scale_station(scene: Scene, step: str) -> Station:
    """On scale and stand (latched once it has to go back), a click, back on the table."""
    facts, steps = ScaleFacts.of(scene), SCALE_STEPS[scene.level]
    if step == "c":
        return chain.click(scene, facts.cards)
    bell = step.lower() == "b"
    name, on = (facts.bell, facts.scale) if bell else (facts.object, facts.stand)
    place = Place(name, on=on, arm="left" if bell else "right")
    if step.isupper():
        after = steps.index(step.lower())

        def lower(pose: Pose, start: Pose) -> bool:
            return abs(pose.position[2] - start.position[2]) < BACK

        return chain.back(scene, place, Rests(name, lower, grip=SCALE_GRIP, after=after))
    near = on_spot(ON, BELOW, ABOVE, Pose(), table.frame_of(scene, on, "support"))
    latched = step.upper() in steps
    rests = Rests(name, near, grip=SCALE_GRIP, targets=(on,), latched=latched)
    return chain.there(place, rests)


def _scale_slots(scene: Scene) -> Slots:
    phrases = SCALE_TEXT.slots("bell", "scale")
    if scene.level >= 2:
        thing = scene.object(ScaleFacts.of(scene).object)
        phrases |= SCALE_TEXT.slots(f"object.{thing.asset}", "stand")
    return phrases | (SCALE_TEXT.slots("cards") if scene.level >= 3 else {})


SCALE = ActionChain(
    "Place_Object_Scale_Click", SCALE_STEPS, LIMITS, ScaleFacts, _scale_items, _scale_station
).task(
    SCALE_TEXT.templates,
    _scale_slots,
    summary="Put the bell on the scale and an object on the stand, click the cards, and undo both.",
    success=(
        "The bell was let go on the scale, the object on the display stand, the cards were clicked "
        "by the closed gripper on their side, and both lie on the table again (as far as asked)."
    ),
)

TRAY_STEPS = {1: "b", 2: "bf", 3: "bfc", 4: "bfcB", 5: "bfcBF"}
"""What is asked for: b burger and f fries onto the tray, c a click, B and F back again."""
FOOD = {"b": ("burger", "hamburger"), "f": ("fries", "french_fries")}
HALF = {"burger": "left", "fries": "right"}
"""The half of the tray for each, and the arm that serves it."""
TRAY_Y = (-0.15, -0.10)
X = {"burger": (-0.30, -0.25), "fries": (0.20, 0.30)}
FOOD_Y = (-0.15, -0.07)
BELL_X, BELL_Y, BELL_OFF = (-0.25, 0.25), (0.02, 0.12), 0.05
ON_TRAY, TRAY_HEIGHT = 0.08, 0.02
"""Largest level offset [m] from the middle of the half, and height [m] above the tray's floor."""
HOME, HOME_HEIGHT = 0.04, 0.005
"""Largest offset [m] from the place at the start, in the plane and in height."""


@dataclass(frozen=True)
class TrayFacts(SceneFacts):
    """Things by their role; those of later levels may be missing."""

    tray: str
    burger: str
    fries: str = ""
    bell: str = ""


def _tray_items(level: int, rng: np.random.Generator, workcell: Workcell) -> list[table.Item]:
    variant = table.draw_variant(rng, "tray")
    middle = (0.0, rng.uniform(*TRAY_Y))
    items = [table.thing("tray", "tray", middle, variant, fixed=True)]
    width, depth, _ = objects.object_model("tray", variant).size
    taken: list[tuple[Point, float]] = []
    for key, (role, asset) in FOOD.items():
        if key in TRAY_STEPS[level]:
            variant = table.draw_variant(rng, asset)
            seen = table.in_view(workcell, asset, variant)
            point = free_point(rng, X[role], FOOD_Y, allowed=seen)
            room = table.radius(asset, variant)
            if abs(point[0]) < width / 2 + room + TRAY_GAP:
                raise NoRoom("the food would lie on the tray")
            taken.append((point, room))
            items.append(table.thing(role, asset, point, variant))
    if "c" in TRAY_STEPS[level]:
        variant = table.draw_variant(rng, "bell")
        room = table.radius("bell", variant) + TRAY_GAP
        bell_seen = table.in_view(workcell, "bell", variant)

        def allowed(point: Point) -> bool:
            beyond = point[1] > middle[1] + depth / 2 + room or abs(point[0]) > width / 2 + room
            return abs(point[0]) >= BELL_OFF and beyond and bell_seen(point)

        far = [(p, r + room) for p, r in taken]
        place = free_point(rng, BELL_X, BELL_Y, far, allowed=allowed)
        items.append(table.thing("bell", "bell", place, variant, fixed=True))
    return items


def _at_home(pose: Pose, start: Pose) -> bool:
    (x, y, z), (sx, sy, sz) = pose.position, start.position
    return math.hypot(x - sx, y - sy) < HOME and abs(z - sz) < HOME_HEIGHT


def _tray_station(scene: Scene, step: str) -> Station:
    """Food on the tray (latched once it has to go back), a click, food at home again."""
    facts, steps = TrayFacts.of(scene), TRAY_STEPS[scene.level]
    if step == "c":
        return chain.click(scene, facts.bell)
    role = FOOD[step.lower()][0]
    name, half = {"burger": facts.burger, "fries": facts.fries}[role], HALF[role]
    spot = table.frame_of(scene, facts.tray, half)
    place = Place(name, scene.object(facts.tray).pose.apply(spot.position), arm=half)
    if step.isupper():
        after = steps.index(step.lower())
        return chain.back(scene, place, Rests(name, _at_home, grip=TRAY_GRIP, after=after))
    near = on_spot(ON_TRAY, -TRAY_HEIGHT, TRAY_HEIGHT, Pose(), spot)
    rests = Rests(name, near, grip=TRAY_GRIP, targets=(facts.tray,), latched="B" in steps)
    return chain.there(place, rests)


TRAY = ActionChain(
    "Place_Burger_Fries_Click_Bell", TRAY_STEPS, LIMITS, TrayFacts, _tray_items, _tray_station
).task(
    TRAY_TEXT.templates,
    lambda scene: TRAY_TEXT.slots(*("burger", "tray", "fries", "bell")[: scene.level + 1]),
    summary="Put burger and fries on the tray, ring the bell, and take them back to their places.",
    success=(
        "Burger and fries were let go on the left and right half of the tray, the bell was clicked "
        "by the closed gripper on its side, and both are back within 4 cm (as far as asked)."
    ),
)
