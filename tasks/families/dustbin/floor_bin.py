"""The bin on the floor at the left of a table that stands 0.3 m farther right, and how it is used.

Only the left arm reaches the bin. What the right arm takes is handed over by setting it down in the
middle of the table, where the left arm takes it.
"""

from __future__ import annotations

from collections.abc import Iterable

from robospa.geometry import Pose
from robospa.tasks import objects
from robospa.tasks.goals.parts import Container
from robospa.tasks.plan import Drop, Pick, Place, Skill
from robospa.tasks.sampling.places import Point, apart
from robospa.tasks.scene import Scene, SceneObject
from robospa.workcell import Workcell

BIN = Pose((-0.45, 0.0, 0.0))
TABLE_SHIFT = (0.3, 0.0)
CEILING = 0.7
"""Highest origin [m] of a thing in the bin that counts (official), should it be higher; beside a
table at its usual height."""

EXCHANGE = (-0.03, -0.08)
"""Where the right arm leaves a thing for the left one, if that place is free."""

LIFT = 0.12
"""How high the expert lifts a bottle [m]."""


def container(dustbin: SceneObject) -> Container:
    """The inside of the bin."""
    size = objects.object_model(dustbin.asset, dustbin.params).size
    rim = min(size[2], CEILING - BIN.position[2])
    return Container(dustbin.pose, (size[0] / 2, size[1] / 2), rim)


def reachable(workcell: Workcell, point: Point) -> bool:
    """Whether the arm on that side can take a thing there."""
    arm = workcell.arms[int(point[0] > 0)]
    return not apart(point, [arm.base], arm.reach)


def discard(scene: Scene, name: str, dustbin: str, exchange: Point = EXCHANGE) -> tuple[Skill, ...]:
    """Bring `name` into the bin; one on the right goes through the hands of both arms."""
    right = scene.object(name).pose.position[0] > 0
    hand_over: tuple[Skill, ...] = (
        Pick(name, lift=LIFT, arm="right"),
        Place(name, (*exchange, scene.table_top), arm="right"),
    )
    throw = (Pick(name, lift=LIFT, arm="left"), Drop(name, into=dustbin, arm="left"))
    return (*hand_over, *throw) if right else throw


def exchange_place(taken: Iterable[tuple[Point, float]]) -> Point:
    """The place nearest to EXCHANGE that keeps its distance [m] from each point of `taken`.

    Where there is none, the one with most room.
    """
    taken = tuple(taken)
    best: tuple[float, float, Point] | None = None
    for i in range(-8, 9):
        for j in range(-8, 9):
            point = (EXCHANGE[0] + 0.0125 * i, EXCHANGE[1] + 0.0125 * j)
            room = min((_distance(point, other) - far for other, far in taken), default=0.0)
            rating = (min(room, 0.0), -_distance(point, EXCHANGE), point)
            best = rating if best is None else max(best, rating)
    assert best is not None
    return best[2]


def _distance(a: Point, b: Point) -> float:
    return float(((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2) ** 0.5)
