"""What a trial may be asked instead of its own sentence, with the same things on the table.

Rewordings mean the same. Counterfactual questions do not: `other_target` makes the scene ask for
another of its objects, so that sentence, goal and plan are of that one; `about_nothing_here` names
a thing that lies nowhere. A policy that does not read does the same in all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from robospa.geometry import Vec3
from robospa.tasks.scene import Scene, SceneObject

Facts = Mapping[str, object]


def other_target(scene: Scene, rng: np.random.Generator) -> Scene:
    """`scene` asking for another object than the drawn one, each equally likely where its task
    names it; scenes without a single target (procedures) stay as they are."""
    known = next((make for fact, make in QUESTIONS.items() if fact in scene.facts), None)
    others = [] if known is None or "target" not in scene.facts else known(scene)
    others = [facts for facts in others if facts["target"] != scene.facts["target"]]
    if not others:
        return scene
    return replace(scene, facts={**scene.facts, **others[int(rng.integers(len(others)))]})


def _by_measure(fact: str, axis: int) -> Callable[[Scene], list[Facts]]:
    """Blocks by their half size along `axis`, the largest first."""

    def questions(scene: Scene) -> list[Facts]:
        ranked = sorted(scene.objects, key=lambda o: -float(o.params["half"][axis]))
        return [{"target": item.name, fact: rank} for rank, item in enumerate(ranked, 1)]

    return questions


def _by_distance(scene: Scene) -> list[Facts]:
    """Objects by their distance from the reference, the farthest first."""
    reference = scene.object(scene.facts["reference"])
    x, y, _ = reference.pose.position
    others = [item for item in scene.objects if item.name != reference.name]
    others.sort(key=lambda o: -math.dist(o.pose.position[:2], (x, y)))
    return [{"target": o.name, "distance_rank": rank} for rank, o in enumerate(others, 1)]


def _by_place(scene: Scene) -> list[Facts]:
    """Objects by row and column of their grid, counted from the sides that the scene counts from;
    the sizes of grids are `canonical_index`'s."""
    items = sorted(scene.objects, key=lambda o: o.pose.position[1])
    columns = 4 if len(items) % 4 == 0 else 3
    rows = [items[k : k + columns] for k in range(0, len(items), columns)]
    if scene.facts.get("row_direction") == "far_to_near":
        rows.reverse()
    found: list[Facts] = []
    for number, row in enumerate(rows, 1):
        row.sort(key=lambda o: o.pose.position[0])
        if scene.facts["column_direction"] == "right_to_left":
            row.reverse()
        place = {"row": number} if len(rows) > 1 else {}
        found += [{"target": o.name, "column": n, **place} for n, o in enumerate(row, 1)]
    return found


def _by_extreme(scene: Scene) -> list[Facts]:
    """The leftmost, rightmost, farthest and nearest object in the viewer's words."""
    from robospa.tasks.families.cross_view import AXES, EXTREMES, SEEN_AS, SIGNS

    def along(k: int, at: Vec3) -> float:
        return float(SIGNS[k] * at[AXES[k]])

    words = SEEN_AS[scene.facts["viewpoint"]]
    found: list[Facts] = []
    for k, (extreme, position) in enumerate(zip(EXTREMES, words, strict=True)):
        first = max(scene.objects, key=lambda o: along(k, o.pose.position))
        found.append({"target": first.name, "extreme": extreme, "position": position})
    return found


def _by_color(scene: Scene) -> list[Facts]:
    from robospa.tasks.colors import nearest

    def word(item: SceneObject) -> str:
        if "tint" in item.params:
            return str(item.params["tint"])
        return nearest(item.params["color"]) if "color" in item.params else "brown"  # bread

    return [{"target": item.name, "color": word(item)} for item in scene.objects]


def _by_relation(scene: Scene) -> list[Facts]:
    """Neighbour and reference exchanged: what was next to it is now named by its place."""
    from robospa.tasks.families.relational import label_in

    facts = scene.facts
    opposite = {"left": "right", "right": "left", "front": "back", "back": "front"}
    return [
        {
            "target": facts["reference"],
            "reference": facts["target"],
            "relation": "_".join(opposite[word] for word in facts["relation"].split("_")),
            "reference_label": label_in(scene, facts["target"]),
        }
    ]


QUESTIONS: Mapping[str, Callable[[Scene], list[Facts]]] = {
    "size_rank": _by_measure("size_rank", 0),
    "height_rank": _by_measure("height_rank", 2),
    "length_rank": _by_measure("length_rank", 0),
    "area_rank": _by_measure("area_rank", 0),
    "distance_rank": _by_distance,
    "column": _by_place,
    "relation": _by_relation,
    "extreme": _by_extreme,
    "color": _by_color,
}
"""By a fact of the scene: the facts that ask for each of its objects."""


def about_nothing_here(scene: Scene, rng: np.random.Generator) -> str:
    """A sentence about a thing that is not on the table, nor anything that is taken for it."""
    from robospa.tasks.modes.clutter import candidates
    from robospa.tasks.objects import object_model

    taken = {item.asset for item in scene.clutter}
    absent = [asset for asset in candidates(scene) if asset not in taken]
    noun = object_model(absent[int(rng.integers(len(absent)))], {"look": 0}).noun
    return f"Find the {noun} and lift it off the table."


def misspelt(sentence: str, rng: np.random.Generator, errors: int) -> str:
    """`sentence` with so many words of four letters or more in which two neighbours are exchanged,
    neither of them the first."""
    words = sentence.split(" ")
    long = [n for n, word in enumerate(words) if len(word) > 4 and word.isalpha()]
    for n in rng.permutation(long)[:errors].tolist():
        word = words[n]
        at = int(rng.integers(1, len(word) - 1))
        words[n] = word[:at] + word[at + 1] + word[at] + word[at + 2 :]
    return " ".join(words)


def reworded(
    made: Sequence[str], index: int, share: int, axis: str, strength: float,
    rng: np.random.Generator,
) -> str:  # fmt: skip
    """The sentence number `index` of those `made` of a scene, changed as `axis` says; every
    template has made `share` of them in a row."""
    group, place = divmod(index, share)
    if axis == "other-words":
        return made[group * share + (place + 1 + int(rng.integers(share - 1))) % share]
    if axis == "other-order":
        groups = len(made) // share
        return made[(group + 1 + int(rng.integers(groups - 1))) % groups * share + place]
    if axis in ("short", "long"):
        return (min if axis == "short" else max)(made, key=len)
    if axis == "lower-case":
        return made[index].lower().rstrip(".")
    return misspelt(made[index], rng, int(strength))


REWORDED = ("other-words", "other-order", "short", "long", "lower-case", "typos")
