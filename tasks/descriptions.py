"""What a reader calls the objects of a scene: "the red block", "the taller block"."""

from collections.abc import Sequence
from itertools import pairwise

from robospa.tasks.colors import NAMED
from robospa.tasks.families import memory
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene, SceneObject

ORDINALS = ("1st", "2nd", "3rd")
SIZES = {
    (True, True, True): ("{}larger {}", "{}largest {}", "{}smaller {}", "{}smallest {}"),
    (False, False, True): ("{}taller {}", "{}tallest {}", "{}shorter {}", "{}shortest {}"),
    (True, False, False): ("{}longer {}", "{}longest {}", "{}shorter {}", "{}shortest {}"),
    (True, True, False): (
        "{1} with the {0}larger base", "{1} with the {0}largest base",
        "{1} with the {0}smaller base", "{1} with the {0}smallest base",
    ),
}  # fmt: skip
"""Of objects that differ in size alone, by the axes along which they do: what the first of two and
of several is called, and the last."""
SAME_SIZE = 5e-4
"""Sizes [m] that differ by less are equal to a reader."""


def describe_objects(scene: Scene) -> dict[str, str]:
    """A noun phrase for every object and piece of clutter of `scene`, by its name.

    Objects that look alike but for their size are ranked by that, as sentences do; others are
    counted from the left, as the robot sees them when a trial begins.
    """
    alike: dict[str, list[SceneObject]] = {}
    for item in scene.objects:
        alike.setdefault(_phrase(item), []).append(item)
    described: dict[str, str] = {}
    for phrase, group in alike.items():
        described |= _by_size(phrase, group) or _by_place(phrase, group)
    clutter = {item.name: f"the {_phrase(item)} (clutter)" for item in scene.clutter}
    return {item.name: f"the {described[item.name]}" for item in scene.objects} | clutter


def _by_place(phrase: str, group: Sequence[SceneObject]) -> dict[str, str]:
    """The objects of `group` counted from the left; one alone is just what it is."""
    if len(group) == 1:
        return {group[0].name: phrase}
    row = sorted(group, key=lambda o: (o.pose.position[0], o.pose.position[1], o.name))
    return {o.name: f"{phrase}, {_ordinal(i + 1)} from the left" for i, o in enumerate(row)}


def _by_size(phrase: str, group: Sequence[SceneObject]) -> dict[str, str]:
    """The objects of `group` ranked by their size, the largest first; empty if some are equal, or
    if it is not plain which of them is the larger one."""
    sizes = {o.name: object_model(o.asset, o.params).size for o in group}
    ranked = sorted(group, key=lambda o: sum(sizes[o.name]), reverse=True)
    steps = [
        tuple(a - b for a, b in zip(sizes[one.name], sizes[other.name], strict=True))
        for one, other in pairwise(ranked)
    ]
    axes = [tuple(abs(step) > SAME_SIZE for step in each) for each in steps]
    if len(set(axes)) != 1 or axes[0] not in SIZES or any(min(s) < -SAME_SIZE for s in steps):
        return {}
    first, first_of_many, last, last_of_many = SIZES[axes[0]]
    count = len(ranked)
    if count == 2:
        return {ranked[0].name: first.format("", phrase), ranked[1].name: last.format("", phrase)}
    names = [first_of_many.format("", phrase)]
    names += [first_of_many.format(f"{_ordinal(i)} ", phrase) for i in range(2, count)]
    names.append(last_of_many.format("", phrase))
    return {o.name: name for o, name in zip(ranked, names, strict=True)}


def _phrase(item: SceneObject) -> str:
    """What the object is; without its colour where no named colour is right."""
    if scenery := memory.noun_of(item):
        return scenery
    model = object_model(item.asset, item.params)
    color = item.params.get("color")
    plain = color is not None and tuple(color) not in NAMED.values()
    return model.noun if plain else model.phrases[0]


def _ordinal(number: int) -> str:
    return ORDINALS[number - 1] if number <= len(ORDINALS) else f"{number}th"
