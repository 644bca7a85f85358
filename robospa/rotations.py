"""Many rotations at a time, as arrays: what `robospa.geometry` does for one.

Quaternions are w, x, y, z on the last axis, matrices lie on the last two; the axes before are free.
"""

from __future__ import annotations

import numpy as np

from robospa.geometry import Array, matrix_rows, multiply


def quaternion_to_matrix(quaternion: Array) -> Array:
    """(..., 4) to (..., 3, 3); of any length but 0."""
    w, x, y, z = np.moveaxis(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True), -1, 0)
    return np.stack([np.stack(row, axis=-1) for row in matrix_rows(w, x, y, z)], axis=-2)


def matrix_to_quaternion(matrix: Array) -> Array:
    """(..., 3, 3) to (..., 4) with w >= 0; the largest component is divided by.

    `geometry.from_matrix` divides by w wherever the trace is positive. The two differ in the last
    bit, plans of scenes rest on that one and the actions of foreign policies on this one, so both
    stay.
    """
    m = np.asarray(matrix, dtype=float)
    r00, r11, r22 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    # One symmetric 4x4 matrix holds 4 q q^T; its row with the largest diagonal is the safe one.
    four = np.empty((*m.shape[:-2], 4, 4))
    four[..., 0, 0] = 1 + r00 + r11 + r22
    four[..., 1, 1] = 1 + r00 - r11 - r22
    four[..., 2, 2] = 1 - r00 + r11 - r22
    four[..., 3, 3] = 1 - r00 - r11 + r22
    pairs = {
        (0, 1): m[..., 2, 1] - m[..., 1, 2],
        (0, 2): m[..., 0, 2] - m[..., 2, 0],
        (0, 3): m[..., 1, 0] - m[..., 0, 1],
        (1, 2): m[..., 1, 0] + m[..., 0, 1],
        (1, 3): m[..., 0, 2] + m[..., 2, 0],
        (2, 3): m[..., 2, 1] + m[..., 1, 2],
    }
    for (i, j), value in pairs.items():
        four[..., i, j] = four[..., j, i] = value
    best = np.argmax(np.diagonal(four, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(four, best[..., None, None], axis=-2)[..., 0, :]
    unit = row / np.linalg.norm(row, axis=-1, keepdims=True)
    positive: Array = np.where(unit[..., :1] < 0, -unit, unit)
    return positive


def product(a: Array, b: Array) -> Array:
    """Hamilton product (..., 4) of two quaternions (..., 4)."""
    (aw, ax, ay, az), (bw, bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack(multiply((aw, ax, ay, az), (bw, bx, by, bz)), axis=-1)


def angle_between(a: Array, b: Array) -> Array:
    """Angles (N,) [rad], 0 to pi, by which unit quaternions (N, 4) differ; exact where small.

    The vector part of conj(a) * b is written out: settling scenes compares it with a limit, so its
    last bit must not change.
    """
    vector = a[:, :1] * b[:, 1:] - b[:, :1] * a[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    sine = np.linalg.norm(vector, axis=1)
    angle: Array = 2.0 * np.arcsin(np.clip(sine, 0.0, 1.0))
    return angle


def turning_vector(matrix: Array) -> Array:
    """(..., 3): the axis of a rotation (..., 3, 3) times twice the sine of its angle."""
    m = matrix
    return np.stack(
        [
            m[..., 2, 1] - m[..., 1, 2],
            m[..., 0, 2] - m[..., 2, 0],
            m[..., 1, 0] - m[..., 0, 1],
        ],
        axis=-1,
    )
