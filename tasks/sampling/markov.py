"""Layouts that nearly fill their region: a pool of them, drawn evenly, in bounded time.

Free scatter with refusal takes millions of draws when the objects nearly pack the region. Here
many chains of small random moves start from known layouts and never leave the valid ones, so
every state is a layout and, in the long run, every layout is equally likely. The pool is a
constant of its arguments: it is computed once per process, from a fixed seed, and a trial's own
generator only chooses from it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robospa.geometry import Array
from robospa.tasks.sampling.places import LayoutError, Mask

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
