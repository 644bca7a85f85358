"""The objects as the network reads them: their numbers, scaled, and how they compare.

What a sentence asks for is mostly a place in an order: the largest, the second from the left, the
farther one. Blocks that differ by 5 mm are nearly the same to a network that is told sizes alone.
So each object is told besides, for what `COMPARED` lists, whether others have more or less of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robospa.observation import FEATURES

TABLE = 0.74
"""Heights count from here [m]."""
SCALES = {
    "x": 5.0, "y": 8.0, "z": 8.0, "half_x": 30.0, "half_y": 30.0, "half_z": 20.0,
}  # fmt: skip
"""Numbers of an object that are not about 1 in size are multiplied by these."""
COMPARED = {
    "x": 0.01, "y": 0.01, "z": 0.002, "half_x": 0.002, "half_y": 0.002, "half_z": 0.002,
    "area": 5e-5,
}  # fmt: skip
"""What is compared, and by how much [m], for the area [m^2] of the top, two must differ to count as
clearly different."""
CHANNELS = len(FEATURES) + 2 * len(COMPARED)
"""Numbers of a cell: those of the environment state, comparisons with all, with those of a kind."""
_PRESENT, _KIND = FEATURES.index("present"), FEATURES.index("kind_0")
_PLACE = slice(FEATURES.index("x"), FEATURES.index("z") + 1)


def cells(objects: NDArray[np.float32]) -> NDArray[np.float32]:
    """Objects (B, S, features) as (B, CHANNELS, 1, S); those that are not there are zeros."""
    present = objects[..., _PRESENT]
    scaled = objects.copy()
    scaled[..., FEATURES.index("z")] -= TABLE
    for name, scale in SCALES.items():
        scaled[..., FEATURES.index(name)] *= scale
    found = np.concatenate([scaled, comparisons(objects)], axis=-1) * present[..., None]
    return np.ascontiguousarray(np.swapaxes(found, 1, 2)[:, :, None])


def comparisons(objects: NDArray[np.float32]) -> NDArray[np.float32]:
    """(B, S, 2 * compared): from -1, less than all others, to 1, more than all others; first among
    all objects that are there, then among those of the same kind."""
    columns = [objects[..., FEATURES.index(name)] for name in COMPARED if name != "area"]
    area = 4 * objects[..., FEATURES.index("half_x")] * objects[..., FEATURES.index("half_y")]
    values = np.stack([*columns, area], axis=-1) / np.array(list(COMPARED.values()), np.float32)
    more = np.tanh(values[:, :, None] - values[:, None])
    there = objects[..., _PRESENT] > 0
    others = there[:, :, None] & there[:, None] & ~np.eye(objects.shape[1], dtype=bool)
    kind = objects[..., _KIND:]
    alike = others & (kind[:, :, None] == kind[:, None]).all(axis=-1)
    return np.concatenate([_mean(more, others), _mean(more, alike)], axis=-1)


def _mean(values: NDArray[np.float32], counted: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Means of `values` (B, S, S, C) over the others that are `counted` (B, S, S); 0 if none is."""
    total = (values * counted[..., None]).sum(axis=2)
    found: NDArray[np.float32] = total / np.maximum(counted.sum(axis=2), 1)[..., None]
    return found.astype(np.float32)


def anchors(
    arms: NDArray[np.float32],
    objects: NDArray[np.float32],
    mean: NDArray[np.float32],
    spread: NDArray[np.float32],
) -> NDArray[np.float32]:
    """(B, 2, S + 1, 10): what an arm's keyframe is told relative to, in the numbers of a normalised
    keyframe: every object's place, turned on average; last, where the arm is now.

    `arms` (B, 20) and `objects` (B, S, features) are as in a Batch, `mean` and `spread` (20,) those
    of keyframes.
    """
    count, slots = objects.shape[:2]
    arm = len(mean) // 2
    found = np.zeros((count, 2, slots + 1, arm), np.float32)
    centre, scale = mean.reshape(2, arm), spread.reshape(2, arm)
    place = objects[:, None, :, _PLACE]
    found[:, :, :-1, :3] = (place - centre[:, None, :3]) / scale[:, None, :3]
    found[:, :, -1] = (arms.reshape(count, 2, arm) - centre) / scale
    return found


def present(objects: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(B, S + 1): which anchors are there; where the arm is, always is."""
    there = objects[..., _PRESENT] > 0
    return np.concatenate([there, np.ones((len(there), 1), bool)], axis=1)
