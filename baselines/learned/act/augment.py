"""Scenes that were not demonstrated, made of those that were.

Objects change slots: their numbers tell all that matters, and a slot is where one can be learned by
heart. And a scene is seen in a mirror, left for right: the arms change places, and so does what
they do. A sentence that speaks of left or right is never shown with a mirrored scene.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robospa.baselines.learned.act.poses import ARM
from robospa.observation import FEATURES

SIDES = frozenset({"left", "right", "leftmost", "rightmost", "clockwise", "counterclockwise"})
"""A sentence with one of these words is about a side."""
_TURNED_OVER = [FEATURES.index(n) for n in ("x", "sin_yaw", "sin_2yaw", "sin_4yaw", "up_x")]
_MIRROR = np.array([-1, 1, 1, -1, 1, 1, 1, -1, -1, 1], np.float32)
"""Signs of an arm's numbers in the mirror: place, the gripper's x axis, its y axis, opening. The
fingers are alike, so the y axis, from one to the other, is turned over once more."""


def permuted(objects: NDArray[np.float32], rng: np.random.Generator, slots: int) -> None:
    """Let the first `slots` objects of (B, SLOTS, features) change places, row by row."""
    order = rng.random((len(objects), slots)).argsort(axis=1)
    objects[:, :slots] = np.take_along_axis(objects[:, :slots], order[:, :, None], axis=1)


def mirrored_objects(objects: NDArray[np.float32]) -> NDArray[np.float32]:
    """Objects (..., features) in the mirror x = 0."""
    found = objects.copy()
    found[..., _TURNED_OVER] *= -1
    return found


def mirrored_arms(keyframes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Keyframes (..., 20) in the mirror x = 0: what the left arm did is the right one's."""
    arms = keyframes.reshape(*keyframes.shape[:-1], 2, ARM)
    found: NDArray[np.float32] = (arms[..., ::-1, :] * _MIRROR).reshape(keyframes.shape)
    return found
