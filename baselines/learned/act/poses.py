"""Keyframes as the network has them: per arm a position, a rotation and a gripper.

A keyframe is what the expert commands, as end-effector poses: 20 numbers, per arm x y z [m], the
first two columns of the rotation matrix, gripper 0 closed to 1 open. Poses follow where an object
is nearly linearly, joints do not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import matrix_to_quaternion, quaternion_to_matrix
from robospa.harness.robots.embodiment import Embodiment

Array = NDArray[np.float64]

ARM = 10
"""Numbers of an arm: position 3, rotation 6, gripper 1."""
WIDTH = 2 * ARM
POSITIONS = (0, 1, 2, ARM, ARM + 1, ARM + 2)
"""Columns of the positions of both arms."""
SAME_PLACE, SAME_TURN, SAME_GRIPPER = 0.004, 0.05, 0.1
"""Two keyframes that differ by less [m], [rad] and [opening] are one: the arms rest."""


def from_poses(poses: NDArray[np.float32]) -> NDArray[np.float32]:
    """Keyframes (..., 20) of end-effector poses (..., 2, 8) as in an observation."""
    matrix = quaternion_to_matrix(poses[..., 3:7].astype(float))
    columns = np.swapaxes(matrix[..., :2], -1, -2).reshape(*poses.shape[:-1], 6)
    rows = np.concatenate([poses[..., :3], columns, poses[..., 7:]], axis=-1)
    return rows.reshape(*poses.shape[:-2], WIDTH).astype(np.float32)


def to_poses(keyframes: NDArray[np.floating]) -> NDArray[np.float32]:
    """End-effector poses (..., 2, 8) of keyframes (..., 20): rotations made orthonormal, grippers
    brought to 0..1."""
    rows = np.asarray(keyframes, float).reshape(*keyframes.shape[:-1], 2, ARM)
    first, second = rows[..., 3:6], rows[..., 6:9]
    a = _unit(first, (1.0, 0.0, 0.0))
    b = _unit(second - np.sum(a * second, axis=-1, keepdims=True) * a, (0.0, 1.0, 0.0))
    matrix = np.stack([a, b, np.cross(a, b)], axis=-1)
    turn = matrix_to_quaternion(matrix)
    gripper = np.clip(rows[..., 9:], 0.0, 1.0)
    return np.concatenate([rows[..., :3], turn, gripper], axis=-1).astype(np.float32)


def _unit(vector: Array, otherwise: tuple[float, float, float]) -> Array:
    """`vector` (..., 3) with length 1; `otherwise` where it has none."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    found: Array = np.where(length > 1e-6, vector / np.maximum(length, 1e-6), otherwise)
    return found


def from_joints(commanded: NDArray[np.float32], robot: Embodiment) -> NDArray[np.float32]:
    """Keyframes (T, 20) of commanded joints and grippers (T, D) of `robot`."""
    from robospa.harness.robots.kinematics import chain_of, forward

    arms = []
    for columns, arm in zip(robot.action_space("joint").arms, robot.arms, strict=True):
        frames, _ = forward(chain_of(arm), commanded[:, columns.body].astype(float))
        turn = matrix_to_quaternion(frames[:, :3, :3])
        arms.append(np.concatenate([frames[:, :3, 3], turn, commanded[:, [columns.gripper]]], 1))
    return from_poses(np.stack(arms, axis=1).astype(np.float32))


def resting(poses: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(T - 1,): whether each of the poses (T, 2, 8) but the first is the one before."""
    before, after = poses[:-1].astype(float), poses[1:].astype(float)
    moved = np.linalg.norm(after[..., :3] - before[..., :3], axis=-1)
    cosine = np.abs(np.sum(before[..., 3:7] * after[..., 3:7], axis=-1))
    turned = 2 * np.arccos(np.clip(cosine, 0.0, 1.0))
    opened = np.abs(after[..., 7] - before[..., 7])
    still = (moved < SAME_PLACE) & (turned < SAME_TURN) & (opened < SAME_GRIPPER)
    found: NDArray[np.bool_] = still.all(axis=-1)
    return found
