"""Robots as data, and their kinematics. Each is an entry point in the group `robospa.robots`."""

import math
import re
from dataclasses import replace
from functools import cache

from robospa.geometry import Pose
from robospa.harness.robots.embodiment import Arm, Embodiment
from robospa.registry import ROBOTS, UnknownName, find, names

NAME = re.compile(r"(?P<left>[^+:]+)(?:\+(?P<right>[^+:]+))?(?::(?P<distance>[^+:]+))?")
NEAREST, FARTHEST = 0.3, 1.2
"""Distances between two bases [m] that the table lets stand."""


def embodiments() -> tuple[str, ...]:
    """Names of all installed robots."""
    return names(ROBOTS)


@cache
def embodiment(name: str) -> Embodiment:
    """The robot called `name`, an installed one or made of such: NAME, NAME:METRES between the
    bases, or LEFT+RIGHT:METRES.

    Equal robots have one name, `embodiment(name).name`: it has the distance only if that is not the
    usual one, and each kind of arm once. ValueError, which says what exists or how names are
    written, if there is none, for a distance out of range, and for an arm that stands on a stand
    together with another one.
    """
    match = NAME.fullmatch(name)
    if match is None:
        raise ValueError(f"{name!r} names no robot; write NAME, NAME:METRES or LEFT+RIGHT:METRES")
    left, right = _installed(match["left"]), _installed(match["right"] or match["left"])
    if match["distance"] is None:
        if right is left:
            return left
        raise ValueError(f"how far apart the arms of {name!r} stand is missing; write {name}:0.6")
    distance = _distance(name, match["distance"])
    if right is left and distance == left.distance:
        return left
    for part in (left, right):
        if part.distance is None:
            raise ValueError(f"the arms of {part.name} stand together; {name!r} cannot part them")
    kinds = left.name if right is left else f"{left.name}+{right.name}"
    return Embodiment(
        name=f"{kinds}:{distance:g}",
        arms=(_at(left.arms[0], -distance / 2), _at(right.arms[1], distance / 2)),
        cameras={n: camera for n, camera in left.cameras.items() if n in right.cameras},
        distance=distance,
        travel_height=max(left.travel_height, right.travel_height),
        highest=min(left.highest, right.highest),
    )


@cache
def _installed(name: str) -> Embodiment:
    try:
        found = find(ROBOTS, name, "embodiment")
    except UnknownName as error:
        raise ValueError(str(error)) from error
    if not isinstance(found, Embodiment) or found.name != name:
        raise ValueError(f"entry point {name!r} of {ROBOTS} leads to no Embodiment of that name")
    return found


def _distance(name: str, text: str) -> float:
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not NEAREST <= found <= FARTHEST:
        raise ValueError(
            f"the distance of {name!r} is {text!r}; it has to be from {NEAREST} to {FARTHEST} m"
        )
    return found


def _at(arm: Arm, x: float) -> Arm:
    _, y, z = arm.base.position
    return replace(arm, base=Pose((x, y, z), arm.base.rotation))
