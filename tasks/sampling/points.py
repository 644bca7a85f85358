"""Point by point: places that are drawn one after the other, each until it fits."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from robospa.tasks.sampling.region import Drawn, LayoutError, Point, Range, apart

TRIES_PER_POINT = 100
LAYOUTS = 200


def free_point(
    rng: np.random.Generator,
    x: Range,
    y: Range,
    far: Iterable[tuple[Point, float]],
    tries: int = TRIES_PER_POINT,
    allowed: Callable[[Point], bool] = lambda point: True,
) -> Point | None:
    """A uniform allowed point of the rectangle at least so far [m] from each given one, or None."""
    far = tuple(far)
    for _ in range(tries):
        point = (float(rng.uniform(*x)), float(rng.uniform(*y)))
        if all(apart(point, [other], distance) for other, distance in far) and allowed(point):
            return point
    return None


def scatter_points(
    rng: np.random.Generator,
    count: int,
    x: Range,
    y: Range,
    distance: float,
    allowed: Callable[[Point], bool] = lambda point: True,
    near_middle: bool = False,
    tries: int = TRIES_PER_POINT,
) -> tuple[Point, ...]:
    """`count` uniform points of the rectangle, pairwise at least `distance` [m] apart.

    With `near_middle` a point with |x| < 0.15 and y > 0 gets a new y between the region's near
    edge and 0 (an official rule: the middle of the table's far half is hard to reach for both
    arms). A layout that is not complete after `tries` draws per point is started again, 200 times
    at most: where points are crowded, few tries are faster than many. LayoutError if that does
    not do.
    """
    random = rng.random  # what rng.uniform draws, to the bit, at a third of its time
    for _ in range(LAYOUTS):
        points: list[Point] = []
        for _ in range(tries * count):
            px, py = x[0] + (x[1] - x[0]) * random(), y[0] + (y[1] - y[0]) * random()
            if near_middle and abs(px) < 0.15 and py > 0:
                py = y[0] + (0.0 - y[0]) * random()
            if apart((px, py), points, distance) and allowed((px, py)):
                points.append((px, py))
                if len(points) == count:
                    return tuple(points)
    raise LayoutError(
        f"no layout of {count} points {distance} m apart in x {x}, y {y} after {LAYOUTS} attempts; "
        "widen the region or lower the distance"
    )


def retry(attempt: Callable[[], Drawn | None], what: str) -> Drawn:
    """The first result that `attempt` has in 200 tries; LayoutError naming `what` if none."""
    for _ in range(LAYOUTS):
        found = attempt()
        if found is not None:
            return found
    raise LayoutError(f"no free layout of the {what} in {LAYOUTS} draws; skip this seed")
