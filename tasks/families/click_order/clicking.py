"""What the click tasks share: objects to be pressed, their counters, and the presses of a plan."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robospa.action_space import ARMS
from robospa.geometry import Vec3
from robospa.tasks import objects
from robospa.tasks.families.tabletop import side
from robospa.tasks.goals.repeat import PRESS_BOX, PressCounter
from robospa.tasks.plan import Press
from robospa.tasks.sampling.places import Area, LayoutError, Point, candidates, retry, scatter
from robospa.tasks.sampling.turns import Turnable, free_turns, outline
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.shapes import Params
from robospa.workcell import Workcell

Look = tuple[str, Params]
"""An asset and its parameters."""

TRIES = 60
"""Candidate places per object and draw."""

BOXES: Mapping[str, Vec3] = {"can": (0.03, 0.03, 0.04), "bell": (0.025, 0.025, 0.03)}
"""Half sizes [m] of the box around the press point in which a touch counts, where not usual."""

LOOKS: Mapping[str, tuple[int, ...]] = {
    "alarm_clock": (0, 1), "bread": (0, 1, 2, 4, 5), "bell": (0, 1),
}  # fmt: skip
"""Looks that are used, where not all: official models 0, 1, 3, 5 and 6 of bread."""

TURNS: Mapping[str, float] = {
    "alarm_clock": math.pi, "stapler": math.pi, "playing_cards": math.pi, "bread": math.pi / 4,
}  # fmt: skip
"""How far either way an object may be turned about its upright axis [rad]; others are not."""


def clickable_look(rng: np.random.Generator, asset: str) -> dict[str, Any]:
    """Parameters of one of the looks of `asset` that click tasks use, each equally likely."""
    looks = LOOKS.get(asset) or range(objects.look_count(asset))
    return {"look": int(looks[int(rng.integers(len(looks)))])}


def laid_out(
    rng: np.random.Generator,
    workcell: Workcell,
    area: Area,
    middle: float,
    distance: float,
    items: Sequence[Look],
    turns: Mapping[str, float] = TURNS,
) -> list[tuple[Point, float]]:
    """A free place [m] and a turn [rad] for each item, seen whole by the head camera.

    Off the middle line by `middle` [m], pairwise at least `distance` [m] apart, and not touching;
    `turns` says how far either way an asset may be turned. No item has the first choice.
    """
    order = [int(i) for i in rng.permutation(len(items))]
    models = [objects.object_model(*items[i]) for i in order]
    narrow = np.array([[min(outline(*items[i]).reach)] for i in order])
    height = np.array([[m.size[2]] for m in models])
    propose = candidates(workcell, area, (len(items), TRIES), narrow, height, middle)

    def lying() -> list[tuple[Point, float]] | None:
        found = scatter(rng, propose, distance)
        there = [
            Turnable(*items[i], point, turns.get(items[i][0], 0.0))
            for i, point in zip(order, found, strict=True)
        ]
        try:
            yaws = free_turns(rng, workcell, there)
        except LayoutError:
            return None
        placed = dict(zip(order, zip(found, yaws, strict=True), strict=True))
        return [placed[i] for i in range(len(items))]

    return retry(lying, f"{len(items)} things to click")


def press_point(item: SceneObject) -> Vec3:
    """Where an object is pressed [m, world], as it was placed."""
    frame = objects.object_model(item.asset, item.params).frames["press"]
    return item.pose.apply(frame.position)


def click_counter(scene: Scene, name: str, closed: bool = True) -> PressCounter:
    """Counts clicks of an object; `closed`: only while the gripper on its side is closed."""
    item = scene.object(name)
    model = objects.object_model(item.asset, item.params)
    arm = ARMS.index(side(item.pose.position[0])) if closed else None
    box = BOXES.get(item.asset, PRESS_BOX)
    return PressCounter(name, model.frames["touched"], box, arm=arm)


def click(scene: Scene, name: str) -> Press:
    """A press by the arm on the object's side."""
    return Press(name, arm=side(scene.object(name).pose.position[0]))
