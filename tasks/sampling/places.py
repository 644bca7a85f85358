"""Free places on the table, and the error of a seed that has no layout.

`scatter_points` draws point by point, `scatter` each object from many candidates drawn at once,
`scatter_blocks` whole layouts by the thousand, of which the first good one is taken.

Free scatter with refusal takes millions of draws when the objects nearly pack the region. There
`pool` gives layouts drawn evenly in bounded time: many chains of small random moves start from
known layouts and never leave the valid ones, so that in the long run every layout is equally
likely. A pool is a constant of its arguments, computed once per process; a trial's own generator
only chooses from it.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Array
from robospa.workcell import Workcell

Mask = NDArray[np.bool_]
Point = tuple[float, float]
Points = list[Point]
Range = tuple[float, float]
Drawn = TypeVar("Drawn")


class LayoutError(RuntimeError):
    """No layout was found within the allowed work: this seed is not valid."""


class NoRoom(LayoutError):
    """What was drawn so far leaves no room for the rest: it may be drawn anew, see `retry`."""


@dataclass(frozen=True)
class Area:
    """A rectangle on the table: `x` and `y` ranges [m].

    `clear_middle` keeps y <= 0 where |x| < 0.15, as the official scenes do.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    clear_middle: bool = False

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> tuple[Array, Array]:
        """Uniform positions of this shape; y is uniform on what is allowed at its x."""
        x = rng.uniform(self.x[0], self.x[1], shape)
        top: Array | float = self.y[1]
        if self.clear_middle:
            top = np.where(np.abs(x) < 0.15, min(0.0, self.y[1]), self.y[1])
        y = self.y[0] + (top - self.y[0]) * rng.random(shape)
        return x, y


def apart(point: Point, others: Iterable[Point], distance: float) -> bool:
    """Whether `point` is at least `distance` [m] from all `others`."""
    x, y = point
    for ox, oy in others:  # noqa: SIM110 - crowded layouts ask thousands of times
        if math.hypot(x - ox, y - oy) < distance:
            return False
    return True


def wide(x: float, y: float) -> Callable[[Points], bool]:
    """Whether points extend over at least `x` and `y` [m]."""

    def extends(points: Points) -> bool:
        xs, ys = zip(*points, strict=True)
        return bool(max(xs) - min(xs) >= x and max(ys) - min(ys) >= y)

    return extends


def shuffled(rng: np.random.Generator, items: Sequence[Drawn]) -> list[Drawn]:
    """The items in random order: who was placed first had more places to choose from."""
    return [items[int(i)] for i in rng.permutation(len(items))]


TRIES_PER_POINT = 100
LAYOUTS = 200


def tried_point(
    rng: np.random.Generator,
    x: Range,
    y: Range,
    far: Iterable[tuple[Point, float]],
    tries: int,
    allowed: Callable[[Point], bool] = lambda point: True,
) -> Point | None:
    """A uniform allowed point of the rectangle at least so far [m] from each given one, or None."""
    far = tuple(far)
    for _ in range(tries):
        point = (rng.uniform(*x), rng.uniform(*y))
        if all(apart(point, [other], distance) for other, distance in far) and allowed(point):
            return point
    return None


def free_point(
    rng: np.random.Generator,
    x: Range,
    y: Range,
    far: Iterable[tuple[Point, float]] = (),
    tries: int = TRIES_PER_POINT,
    allowed: Callable[[Point], bool] = lambda point: True,
) -> Point:
    """The same; NoRoom instead of None."""
    point = tried_point(rng, x, y, far, tries, allowed)
    if point is None:
        raise NoRoom(f"no free point in x {x}, y {y}")
    return point


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


def retry(attempt: Callable[[], Drawn], what: str) -> Drawn:
    """The first result that `attempt` has in 200 tries; LayoutError naming `what` if none.

    Each ends with a result or with NoRoom.
    """
    for _ in range(LAYOUTS):
        with suppress(NoRoom):
            return attempt()
    raise LayoutError(f"no free layout of the {what} in {LAYOUTS} draws; skip this seed")


Propose = Callable[[np.random.Generator], tuple[Array, Array, Mask]]
"""Draws candidate positions: x, y and whether each may be used, all of shape (objects, tries)."""


def candidates(
    workcell: Workcell,
    area: Area,
    shape: tuple[int, int],
    radius: Array | float,
    height: Array | float,
    off_middle: float = 0.0,
    also: Callable[[Array, Array], Mask] | None = None,
) -> Propose:
    """Candidates in `area` where the head camera sees whole objects of `radius`, `height` [m].

    `shape` is (objects, tries); |x| is at least `off_middle` [m], and `also` may refuse further.
    """

    def propose(rng: np.random.Generator) -> tuple[Array, Array, Mask]:
        x, y = area.draw(rng, shape)
        usable = (np.abs(x) >= off_middle) & workcell.in_view(x, y, radius, height, (0.0, 0.0))
        return x, y, usable if also is None else usable & also(x, y)

    return propose


def scatter(
    rng: np.random.Generator,
    propose: Propose,
    distance: float | Sequence[Sequence[float]],
    accept: Callable[[Points], bool] = lambda points: True,
    restarts: int = 80,
) -> Points:
    """Free positions, object by object: each takes its first candidate that keeps its distance.

    `distance[i][j]` is the least centre distance [m] of objects i and j, or `distance` that of any
    two. A layout that `accept` refuses is drawn afresh, at most `restarts` times; then LayoutError.
    """
    for _ in range(restarts):
        x, y, usable = propose(rng)
        least = [[distance] * len(x)] * len(x) if isinstance(distance, float) else distance
        points = _place(x, y, usable, least)
        if points is not None and accept(points):
            return points
    raise LayoutError(f"no free layout of {len(x)} objects in {restarts} draws; skip this seed")


def _place(x: Array, y: Array, usable: Mask, distances: Sequence[Sequence[float]]) -> Points | None:
    points: Points = []
    for i, limits in enumerate(distances):
        free = usable[i]
        if points:
            taken, least = np.array(points), np.array(limits[:i])
            dx, dy = x[i] - taken[:, :1], y[i] - taken[:, 1:]
            free = free & (dx * dx + dy * dy >= (least * least)[:, None]).all(axis=0)
        first = int(free.argmax())
        if not free[first]:
            return None
        points.append((float(x[i, first]), float(y[i, first])))
    return points


POOL, POOLED, POOLS = 256, 2048, 40
"""Places drawn at once, layouts made of them, and how often at most."""


@dataclass(frozen=True)
class Ground:
    """Where blocks may lie: in `area`, |x| at least `off_middle` [m].

    And at least `free` [m] from the point `middle` [m] of the near edge.
    """

    area: Area
    off_middle: float
    middle: Point
    free: float


def scatter_blocks(
    rng: np.random.Generator,
    workcell: Workcell,
    ground: Ground,
    halves: Sequence[Sequence[float]],
    gaps: Callable[[int, int], float],
    accept: Callable[[Points], bool] = lambda points: True,
) -> list[Point]:
    """A place [m] for a block of each half sizes [m], seen whole by the head camera.

    `gaps(i, j)` is the least distance [m] of two blocks. Many layouts are drawn at once from a pool
    of usable places, and the first that keeps the distances and that `accept` takes is used, so
    every such layout is equally likely. LayoutError if there is none in a bounded number.
    """
    count = len(halves)
    reach = max(math.hypot(*half[:2]) for half in halves)  # the same for all: places tell nothing
    height = 2 * max(half[2] for half in halves)
    pairs = list(itertools.combinations(range(count), 2))
    for _ in range(POOLS):
        x, y = ground.area.draw(rng, (POOL,))
        mx, my = ground.middle
        usable = (np.abs(x) >= ground.off_middle) & (np.hypot(x - mx, y - my) >= ground.free)
        usable &= workcell.in_view(x, y, reach, height, (0.0, 0.0))
        x, y = x[usable], y[usable]
        drawn = rng.integers(len(x), size=(POOLED, count)).T
        xs, ys = x[drawn], y[drawn]  # a row a block, a column a layout
        for i, j in pairs:
            free = (xs[i] - xs[j]) ** 2 + (ys[i] - ys[j]) ** 2 >= gaps(i, j) ** 2
            xs, ys = xs[:, free], ys[:, free]
        for px, py in zip(xs.T.tolist(), ys.T.tolist(), strict=True):
            points = list(zip(px, py, strict=True))
            if accept(points):
                return points
    raise LayoutError(f"no free layout of {count} blocks in {POOLS * POOLED} draws; skip the seed")


Fits = Callable[[Array, Array, int], Mask]
"""Whether place i of each chain's layout (chains, count, 2) may move to `moved_to` (chains, 2)."""

SEED = 0


def keeps_apart(points: Array, moved_to: Array, i: int, least: float) -> Mask:
    """Whether `moved_to` is at least `least` [m] from all places of its chain but `i`."""
    delta = points - moved_to[:, None]
    square = delta[..., 0] ** 2 + delta[..., 1] ** 2
    square[:, i] = np.inf
    return np.asarray(square.min(axis=1) >= least**2)


def walk(rng: np.random.Generator, points: Array, fits: Fits, step: float) -> None:
    """One sweep, in place: each place of each chain moves by up to `step` [m] if it fits there."""
    for i in range(points.shape[1]):
        moved_to = points[:, i] + step * (2 * rng.random((len(points), 2)) - 1)
        good = fits(points, moved_to, i)
        points[good, i] = moved_to[good]


def pool(starts: Array, fits: Fits, sweeps: int = 160, samples: int = 8, seed: int = SEED) -> Array:
    """Layouts [m] of the shape of `starts`, from every chain: (samples, chains, count, 2).

    Each chain starts from a layout that fits (LayoutError if one does not) and is sampled in the
    second half of its `sweeps`.
    """
    count = starts.shape[1]
    if not all(bool(fits(starts, starts[:, i], i).all()) for i in range(count)):
        raise LayoutError(f"the start layouts of {count} objects do not keep to their own rules")
    rng = np.random.Generator(np.random.PCG64(seed))
    points = starts.copy()
    every = max(1, sweeps // 2 // samples)
    found = []
    for sweep in range(1, sweeps + 1):
        walk(rng, points, fits, STEPS[sweep % len(STEPS)])
        if sweep > sweeps - every * samples and (sweeps - sweep) % every == 0:
            found.append(points.copy())
    return np.stack(found)


STEPS = (0.06, 0.015)
"""Lengths of the moves [m], in turn: long ones to change places, short ones where it is tight."""
