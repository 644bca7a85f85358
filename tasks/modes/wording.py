"""What a trial may be asked instead of its own sentence, with the same things on the table.

Rewordings mean the same. Counterfactual questions do not: `other_target` makes the scene ask for
another of its objects, so that sentence, goal and plan are of that one; `about_nothing_here` names
a thing that lies nowhere. A policy that does not read does the same in all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from robospa.tasks.scene import Scene, SceneObject

Asks = list[dict[str, object]]
"""Facts of a scene that ask for one of its objects, for each that can be asked for."""


def other_target(scene: Scene, rng: np.random.Generator) -> Scene:
    """`scene` asking for another object than the drawn one, each equally likely where its task
    names it; scenes without a single target (procedures) stay as they are."""
    known = next((make for fact, make in QUESTIONS.items() if fact in scene.facts), None)
    others = [] if known is None or "target" not in scene.facts else known(scene)
    others = [facts for facts in others if facts["target"] != scene.facts["target"]]
    if not others:
        return scene
    return replace(scene, facts={**scene.facts, **others[int(rng.integers(len(others)))]})


def _ranked(objects: Sequence[SceneObject], key: Callable[[SceneObject], float], fact: str) -> Asks:
    """Objects by `key`, the largest first."""
    ranked = sorted(objects, key=key, reverse=True)
    return [{"target": item.name, fact: rank} for rank, item in enumerate(ranked, 1)]


def _by_measure(measure: str, scene: Scene) -> Asks:
    axis = 2 if measure == "height" else 0
    return _ranked(scene.objects, lambda o: float(o.params["half"][axis]), f"{measure}_rank")


def _by_distance(scene: Scene) -> Asks:
    reference = scene.object(scene.facts["reference"])
    x, y, _ = reference.pose.position
    others = [item for item in scene.objects if item.name != reference.name]
    return _ranked(others, lambda o: math.dist(o.pose.position[:2], (x, y)), "distance_rank")


def _by_place(scene: Scene) -> Asks:
    """By row and column, counted from the scene's sides; grids are those of `canonical_index`."""
    items = sorted(scene.objects, key=lambda o: o.pose.position[1])
    columns = 4 if len(items) % 4 == 0 else 3
    rows = [items[k : k + columns] for k in range(0, len(items), columns)]
    if scene.facts.get("row_direction") == "far_to_near":
        rows.reverse()
    found: Asks = []
    for number, row in enumerate(rows, 1):
        row.sort(key=lambda o: o.pose.position[0])
        if scene.facts["column_direction"] == "right_to_left":
            row.reverse()
        place = {"row": number} if len(rows) > 1 else {}
        found += [{"target": o.name, "column": n, **place} for n, o in enumerate(row, 1)]
    return found


def _by_extreme(scene: Scene) -> Asks:
    from robospa.tasks.families.cross_view import AXES, EXTREMES, SEEN_AS, SIGNS

    found: Asks = []
    for k, position in enumerate(SEEN_AS[scene.facts["viewpoint"]]):
        first = max(scene.objects, key=lambda o: float(SIGNS[k] * o.pose.position[AXES[k]]))
        found.append({"target": first.name, "extreme": EXTREMES[k], "position": position})
    return found


def _by_color(scene: Scene) -> Asks:
    from robospa.tasks.colors import nearest

    def word(item: SceneObject) -> str:
        if "tint" in item.params:
            return str(item.params["tint"])
        return nearest(item.params["color"]) if "color" in item.params else "brown"  # bread

    return [{"target": item.name, "color": word(item)} for item in scene.objects]


def _by_relation(scene: Scene) -> Asks:
    """Neighbour and reference exchanged: what was next to it is now named by its place."""
    from robospa.tasks.families.relational import label_in

    target, reference, relation = (scene.facts[n] for n in ("target", "reference", "relation"))
    opposite = {"left": "right", "right": "left", "front": "back", "back": "front"}
    turned = "_".join(opposite[word] for word in relation.split("_"))
    named = {"reference": target, "reference_label": label_in(scene, target)}
    return [{"target": reference, "relation": turned, **named}]


QUESTIONS: Mapping[str, Callable[[Scene], Asks]] = {
    **{f"{m}_rank": partial(_by_measure, m) for m in ("size", "height", "length", "area")},
    "distance_rank": _by_distance,
    "column": _by_place,
    "relation": _by_relation,
    "extreme": _by_extreme,
    "color": _by_color,
}
"""By a fact that says how the scene asks."""


def about_nothing_here(scene: Scene, rng: np.random.Generator) -> str:
    """A sentence about a thing that is not on the table, nor anything that is taken for it."""
    from robospa.tasks.modes.clutter import candidates
    from robospa.tasks.objects import object_model

    taken = {item.asset for item in scene.clutter}
    absent = [asset for asset in candidates(scene) if asset not in taken]
    noun = object_model(absent[int(rng.integers(len(absent)))], {"look": 0}).noun
    return f"Find the {noun} and lift it off the table."


def misspelt(sentence: str, rng: np.random.Generator, errors: int) -> str:
    """`sentence` with so many words of five letters or more in which two letters are exchanged."""
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
