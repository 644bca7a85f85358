"""What the network is told of objects: numbers, comparisons, and what keyframes are relative to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robospa.baselines.learned.act.augment import mirrored_arms, mirrored_objects
from robospa.baselines.learned.act.objects import (
    CHANNELS,
    COMPARED,
    anchors,
    cells,
    comparisons,
    present,
)
from robospa.baselines.learned.act.poses import WIDTH, from_poses
from robospa.observation import FEATURES, SLOTS

SIZE, X = list(COMPARED).index("half_x"), list(COMPARED).index("x")


def scene(*objects: dict[str, float]) -> NDArray[np.float32]:
    """(1, SLOTS, features) with these numbers; an object is of kind 1."""
    rows = np.zeros((1, SLOTS, len(FEATURES)), np.float32)
    for slot, given in enumerate(objects):
        for name, value in {"present": 1.0, "kind_0": 1.0, **given}.items():
            rows[0, slot, FEATURES.index(name)] = value
    return rows


def test_an_object_is_told_where_it_stands_in_the_order_of_sizes() -> None:
    rows = scene(*({"half_x": half} for half in (0.028, 0.033, 0.022)))
    size = comparisons(rows)[0, :, SIZE]
    assert np.allclose(size[:3], (0.0, 1.0, -1.0), atol=0.03) and not size[3:].any()


def test_comparisons_are_with_all_and_with_those_of_a_kind() -> None:
    basket = {"half_x": 0.1, "kind_0": -1.0}
    found = comparisons(scene({"half_x": 0.03}, {"half_x": 0.02}, basket))[0]
    assert np.allclose(found[:3, SIZE], (0.0, -1.0, 1.0), atol=0.03)
    assert np.allclose(found[:3, len(COMPARED) + SIZE], (1.0, -1.0, 0.0), atol=0.03)


def test_cells_follow_their_objects_to_other_slots_and_absent_ones_are_zero() -> None:
    one, other = {"half_x": 0.03, "x": 0.2}, {"half_x": 0.02, "x": -0.1}
    seen, swapped = cells(scene(one, other)), cells(scene(other, one))
    assert seen.shape == (1, CHANNELS, 1, SLOTS) and not seen[..., 2:].any()
    assert np.array_equal(seen[..., :2], swapped[..., 1::-1])


def test_keyframes_are_told_from_objects_and_from_where_an_arm_is() -> None:
    mean, spread = np.full(WIDTH, 0.1, np.float32), np.full(WIDTH, 0.5, np.float32)
    arms = np.arange(WIDTH, dtype=np.float32)[None]
    rows = scene({"x": 0.6, "y": -0.4, "z": 0.1})
    found = anchors(arms, rows[:, :2], mean, spread)
    assert found.shape == (1, 2, 3, 10)
    assert np.allclose(found[0, :, 0], (1.0, -1.0, 0.0, *[0.0] * 7))
    assert np.allclose(found[0, :, 2].ravel() * spread + mean, arms[0], atol=1e-5)
    assert present(rows[:, :2]).tolist() == [[True, False, True]]


def test_a_mirror_swaps_arms_and_turns_objects_over_and_twice_is_nothing() -> None:
    half = np.sqrt(0.5)
    left = (-0.3, -0.1, 0.9, half, 0.0, 0.0, half, 1.0)  # x ahead, y to the left
    right = (0.2, 0.0, 0.8, 0.0, half, half, 0.0, 0.2)  # x to y and back, z down
    seen = from_poses(np.array([left, right], np.float32))
    found = mirrored_arms(seen)
    assert np.allclose(found[[0, 1, 2, 9]], (-0.2, 0.0, 0.8, 0.2))
    ahead = (0.0, 1.0, 0.0, -1.0, 0.0, 0.0)  # still: x ahead, y to the left
    assert np.allclose(found[10:], (0.3, -0.1, 0.9, *ahead, 1.0), atol=1e-6)
    assert np.allclose(mirrored_arms(found), seen)
    rows = scene({"x": 0.2, "y": 0.1, "sin_yaw": 0.6, "cos_yaw": 0.8})
    over = mirrored_objects(rows)[0, 0]
    assert [round(float(over[FEATURES.index(n)]), 3) for n in ("x", "y", "sin_yaw", "cos_yaw")] == [
        -0.2, 0.1, -0.6, 0.8,
    ]  # fmt: skip
