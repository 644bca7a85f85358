"""The objects that the facts of a scene ask for, found from where and what its objects are.

Nothing here asks the code that draws the scenes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import numpy as np

from robospa.tasks.colors import nearest
from robospa.tasks.scene import Scene, SceneObject


def targets_of(scene: Scene) -> list[str]:
    """The objects that the facts of a single-target scene fit, from where and what objects are."""
    facts = scene.facts
    if "color" in facts:
        return [o.name for o in scene.objects if color_of(o) == facts["color"]]
    if "column" in facts:
        return [_counted(scene)]
    if "relation" in facts:
        return _beside(scene)
    if "extreme" in facts:
        return [_extreme(scene)]
    (key,) = (key for key in facts if key.endswith("_rank"))
    values = _measures(scene, key)
    ranked = sorted(values, key=lambda n: -values[n])
    found = ranked[int(facts[key]) - 1]
    return [n for n in ranked if abs(values[n] - values[found]) < 1e-6]


def color_of(item: SceneObject) -> str:
    """The word for an object's colour in the basic tasks."""
    if item.asset == "block":
        return nearest(tuple(item.params["color"]))
    return "brown" if item.asset == "bread" else str(item.params["tint"])


def _measures(scene: Scene, key: str) -> dict[str, float]:
    """The measure that objects are ranked by, largest first."""
    if key == "distance_rank":
        reference = scene.object(str(scene.facts["reference"]))
        x, y, _ = reference.pose.position
        others = [o for o in scene.objects if o.name != reference.name]
        return {o.name: math.dist((x, y), o.pose.position[:2]) for o in others}
    halves = {o.name: o.params["half"] for o in scene.objects}
    if key == "area_rank":
        return {name: float(h[0] * h[1]) for name, h in halves.items()}
    axis = {"size_rank": 0, "length_rank": 0, "height_rank": 2}[key]
    return {name: float(h[axis]) for name, h in halves.items()}


def _extreme(scene: Scene) -> str:
    facts = scene.facts
    right, front = {
        "robot": ((1, 0), (0, 1)),
        "opposite": ((-1, 0), (0, -1)),
        "left": ((0, -1), (1, 0)),
        "right": ((0, 1), (-1, 0)),
    }[str(facts["viewpoint"])]
    axis, sign = {
        "leftmost": (right, -1),
        "rightmost": (right, 1),
        "frontmost": (front, 1),
        "backmost": (front, -1),
    }[str(facts["position"])]
    at = {o.name: np.array(o.pose.position[:2]) for o in scene.objects}
    return max(at, key=lambda n: sign * float(at[n] @ np.array(axis)))


def _counted(scene: Scene) -> str:
    """The object in the row and column that are asked for, in rows found by gaps in depth."""
    facts = scene.facts
    at = {o.name: o.pose.position for o in scene.objects}
    rows = grouped({n: at[n][1] for n in at}, 0.041)
    row = rows[0]
    if scene.level > 1:
        ordered = rows if facts["row_direction"] == "near_to_far" else rows[::-1]
        row = ordered[int(facts["row"]) - 1]
    line = sorted(row, key=lambda n: at[n][0])
    ordered_line = line if facts["column_direction"] == "left_to_right" else line[::-1]
    return ordered_line[int(facts["column"]) - 1]


def grouped(values: Mapping[str, float], gap: float = 0.05) -> list[list[str]]:
    """Names in groups of like value, smallest first; a step wider than `gap` starts a new group."""
    names = sorted(values, key=lambda n: values[n])
    groups = [[names[0]]]
    for before, name in itertools.pairwise(names):
        if values[name] - values[before] > gap:
            groups.append([])
        groups[-1].append(name)
    return groups


def _beside(scene: Scene) -> list[str]:
    """The neighbour of the labelled object in the asked direction, on the grid of objects."""
    at = {o.name: o.pose.position for o in scene.objects}
    columns = grouped({n: p[0] for n, p in at.items()}, 0.03)
    rows = grouped({n: p[1] for n, p in at.items()}, 0.03)
    cell = {n: (c, r) for c, column in enumerate(columns) for n in column
            for r, row in enumerate(rows) if n in row}  # fmt: skip
    label = str(scene.facts["reference_label"]).replace("center", "middle_middle")
    parts = label.split("_")
    depth = {"back": 0, "middle": 1, "front": len(rows) - 1}
    side = {"left": 0, "middle": 1, "right": len(columns) - 1}
    if len(parts) == 2:
        origin = (side[parts[1]], depth[parts[0]])
    else:
        origin = (side[label], 0) if label in side else (0, depth[label])
    if cell[str(scene.facts["reference"])] != origin:
        return []
    step = {"left": (-1, 0), "right": (1, 0), "front": (0, 1), "back": (0, -1)}
    moves = [step[part] for part in str(scene.facts["relation"]).split("_")]
    goal = tuple(o + sum(m[i] for m in moves) for i, o in enumerate(origin))
    return [n for n, place in cell.items() if place == goal]


def drawn(scene: Scene) -> dict[str, str | int]:
    """The drawn values by name of the fact: ranks, directions, counts, colours."""
    facts = {k: v for k, v in scene.facts.items() if isinstance(v, str | int) and k != "reference"}
    number = {o.name: n for n, o in enumerate(scene.objects)}
    return {key: number.get(str(value), value) for key, value in facts.items()}
