"""Stamp_Seals_Press_Stapler: stamp with one or two seals, then press the stapler.

Draw: a seal and its pad on the left, from level 3 on another pair on the right, at level 5 a fixed
stapler in the middle. Success: the left seal came down on its pad as often as asked, then the
right one on the other, then the stapler was pressed. The order is asked for, but not enforced.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robospa.tasks.families.action_chain.stations import button, frame_of
from robospa.tasks.families.tabletop import Item, draw_look, named, radius, side, standing
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.parts import Part
from robospa.tasks.goals.repeat import ActionCounter
from robospa.tasks.goals.stamping import StampCounter
from robospa.tasks.instructions.grammar import Slots
from robospa.tasks.instructions.text import TaskText, times
from robospa.tasks.plan import Press, Skill, Stamp
from robospa.tasks.sampling.places import free_point, retry
from robospa.tasks.scene import Scene
from robospa.tasks.task import Level, SceneFacts, SceneSample, Task
from robospa.workcell import Workcell

TEXT = TaskText.beside(__file__, "seals_stapler.toml")

STEPS = {1: "l", 2: "ll", 3: "llr", 4: "llrr", 5: "llrrs"}
"""What is asked for: l a stamp with the left seal, r one with the right seal, s the stapler."""

SIDES = {"l": "left", "r": "right"}
X = {"left": (-0.25, -0.12), "right": (0.10, 0.22)}
Y = {1: (-0.05, 0.05), 2: (-0.05, 0.05), 3: (-0.15, 0.05), 4: (-0.15, 0.05), 5: (-0.15, 0.05)}
PAD_FAR_Y = 0.1
"""A pad that does not fit near its seal may lie up to here."""
DISTANCE = 0.1
STAPLER_X, STAPLER_Y = (-0.03, 0.04), (-0.15, 0.05)
GAP = 0.01
"""Free space [m] between the stapler and what stands beside it."""

LEVELS = {
    n: Level(candidates=len(set(steps)), subtasks=n, steps=200 * n) for n, steps in STEPS.items()
}


@dataclass(frozen=True)
class Facts(SceneFacts):
    """Seals and pads by side, and the stapler; those of later levels may be missing."""

    left_seal: str
    left_pad: str
    right_seal: str = ""
    right_pad: str = ""
    stapler: str = ""

    @property
    def pairs(self) -> dict[str, tuple[str, str]]:
        """Seal and pad of each side, by its letter."""
        return {"l": (self.left_seal, self.left_pad), "r": (self.right_seal, self.right_pad)}


def draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample:
    """Seals and pads of this level's sides, and the stapler between them."""
    return retry(
        lambda: _draw(level, rng, workcell), f"objects of Stamp_Seals_Press_Stapler level {level}"
    )


def _draw(level: int, rng: np.random.Generator, workcell: Workcell) -> SceneSample | None:
    items: list[Item] = []
    taken: list[tuple[tuple[float, float], float]] = []
    for at in ("left", "right")[: 1 + ("r" in STEPS[level])]:
        x, y = X[at], Y[level]
        seal = free_point(rng, x, y, [])
        pad = free_point(rng, x, y, [(seal, DISTANCE)], 1) if seal else None
        if seal and pad is None:
            pad = free_point(rng, x, (y[0], PAD_FAR_Y), [(seal, DISTANCE)])
        if seal is None or pad is None:
            return None
        look = draw_look(rng, "seal")
        items.append(Item(f"{at}_seal", "seal", standing(seal), look))
        color = draw_look(rng, "pad")
        items.append(Item(f"{at}_pad", "pad", standing(pad), color, fixed=True))
        taken += [(seal, radius("seal", look)), (pad, radius("pad", color))]
    if "s" in STEPS[level]:
        look = draw_look(rng, "stapler")
        room = radius("stapler", look) + GAP
        spot = free_point(rng, STAPLER_X, STAPLER_Y, [(p, r + room) for p, r in taken])
        if spot is None:
            return None
        pose = standing(spot, float(rng.uniform(-math.pi, math.pi)))
        items.append(Item("stapler", "stapler", pose, look, fixed=True))
    scene_objects, names = named(rng, items)
    return SceneSample(scene_objects, Facts(**names))


def goal(scene: Scene) -> Checklist:
    """Three counters at most; the flags follow the asked order."""
    facts = Facts.of(scene)
    counters: dict[str, ActionCounter | Part] = {
        key: StampCounter(seal, pad) for key, (seal, pad) in facts.pairs.items() if seal
    }
    if facts.stapler:
        counters["s"] = button(scene, facts.stapler)
    return Checklist([counters[step] for step in STEPS[scene.level]])


def plan(scene: Scene) -> tuple[Skill, ...]:
    """Each seal by the arm on its side, all its stamps with one grasp."""
    facts, steps = Facts.of(scene), STEPS[scene.level]
    skills: list[Skill] = [
        Stamp(seal, on=pad, times=steps.count(key), arm=SIDES[key])
        for key, (seal, pad) in facts.pairs.items()
        if key in steps
    ]
    if "s" in steps:
        stapler = scene.object(facts.stapler)
        press = frame_of(scene, stapler.name, "press")
        skills.append(Press(stapler.name, arm=side(stapler.pose.apply(press.position)[0])))
    return tuple(skills)


def slots(scene: Scene) -> Slots:
    """Phrasings for the things."""
    level = scene.level
    if level < 3:
        return TEXT.slots("seal", "pad") | {"times": times(level)}
    phrases = TEXT.slots(*(("stapler",) if level == 5 else ()))
    phrases |= {"left_times": times(2), "right_times": times(1 if level == 3 else 2)}
    for at in ("left", "right"):
        phrases[f"{at}_seal"] = TEXT.phrasings("side_seal", side=at)
        phrases[f"{at}_pad"] = TEXT.phrasings("side_pad", side=at)
    return phrases


TASK = Task(
    name="Stamp_Seals_Press_Stapler",
    category="CAC",
    levels=LEVELS,
    draw=draw,
    goal=goal,
    plan=plan,
    templates=TEXT.templates,
    slots=slots,
    summary="Stamp the pads with the seals as often as asked, then press the stapler.",
    success=(
        "Each seal came down within 1 cm of its pad as often as asked, raised or moved away by "
        "2 cm in between, and the stapler was pressed (as far as the level asks)."
    ),
)
