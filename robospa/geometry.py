"""Poses and the little rotation algebra that scenes, goals, skills and robots share; below, many
rotations at a time.

Positions are metres in the world frame (x right, y away from the robot, z up); rotations are unit
quaternions in the order w, x, y, z. Everything here is plain numpy: no simulator, no global state.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]
Array = NDArray[np.float64]
Number = TypeVar("Number", float, Array)


@dataclass(frozen=True, slots=True)
class Pose:
    """A rigid transform; `a * b` is the pose `b` of `a`'s frame, in the frame that `a` is in."""

    position: Vec3 = (0.0, 0.0, 0.0)
    """x, y, z [m]."""
    rotation: Quat = (1.0, 0.0, 0.0, 0.0)
    """Unit quaternion w, x, y, z."""

    def __mul__(self, other: Pose) -> Pose:
        """The pose of `other`'s frame when `other` is given in this pose's frame."""
        return Pose(self.apply(other.position), multiply(self.rotation, other.rotation))

    def apply(self, point: ArrayLike) -> Vec3:
        """`point` [m] of this pose's frame, expressed in the parent frame."""
        x, y, z = rotate(self.rotation, point)
        px, py, pz = self.position
        return (px + x, py + y, pz + z)

    def inverse(self) -> Pose:
        """The transform that undoes this one."""
        w, x, y, z = self.rotation
        back: Quat = (w, -x, -y, -z)
        px, py, pz = rotate(back, self.position)
        return Pose((-px, -py, -pz), back)


def vec3(values: ArrayLike) -> Vec3:
    """Three numbers as a tuple."""
    x, y, z = np.asarray(values, dtype=np.float64).tolist()
    return (x, y, z)


def multiply(
    a: tuple[Number, Number, Number, Number], b: tuple[Number, Number, Number, Number]
) -> tuple[Number, Number, Number, Number]:
    """Hamilton product a*b of two wxyz quaternions, of numbers or of equal arrays."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def rotate(q: Quat, v: ArrayLike) -> Vec3:
    """Vector `v` turned by the unit quaternion `q`."""
    w, x, y, z = q
    # tuples, which poses consist of, are by far the most frequent and need no conversion
    vx, vy, vz = v if isinstance(v, tuple) else (float(c) for c in np.asarray(v, dtype=float))
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def yaw_rotation(yaw: float) -> Quat:
    """Rotation by `yaw` [rad] about the world's z axis."""
    return (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))


def axis_rotation(axis: ArrayLike, angle: float) -> Quat:
    """Rotation by `angle` [rad] about `axis` (need not be unit length)."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    s = math.sin(angle / 2)
    return (math.cos(angle / 2), float(x) * s, float(y) * s, float(z) * s)


def matrix_rows(w: Number, x: Number, y: Number, z: Number) -> tuple[tuple[Number, ...], ...]:
    """The three rows of a unit quaternion's rotation matrix, of numbers or of equal arrays."""
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def to_matrix(q: Quat) -> Array:
    """3x3 rotation matrix of a unit quaternion."""
    return np.array(matrix_rows(*q))


def from_matrix(m: Array) -> Quat:
    """Unit quaternion (wxyz, w >= 0) of a 3x3 rotation matrix."""
    return _quaternion(m.tolist())


def to_transform(pose: Pose) -> Array:
    """4x4 homogeneous transform of a pose."""
    out = np.eye(4)
    out[:3, :3] = to_matrix(pose.rotation)
    out[:3, 3] = pose.position
    return out


def from_transform(transform: Array) -> Pose:
    """Pose of a 4x4 homogeneous transform."""
    x, y, z = (float(v) for v in transform[:3, 3])
    return Pose((x, y, z), from_matrix(transform[:3, :3]))


def _quaternion(m: Sequence[Sequence[float]]) -> Quat:
    """`from_matrix` of plain rows: planning asks for it a thousand times a trial."""
    trace = m[0][0] + m[1][1] + m[2][2]
    if trace > 0:
        s = 2 * math.sqrt(1 + trace)
        q = [s / 4, (m[2][1] - m[1][2]) / s, (m[0][2] - m[2][0]) / s, (m[1][0] - m[0][1]) / s]
    else:
        i = max((0, 1, 2), key=lambda axis: m[axis][axis])
        j, k = (i + 1) % 3, (i + 2) % 3
        s = 2 * math.sqrt(max(1e-12, 1 + m[i][i] - m[j][j] - m[k][k]))
        q = [(m[k][j] - m[j][k]) / s, 0.0, 0.0, 0.0]
        q[1 + i], q[1 + j], q[1 + k] = s / 4, (m[j][i] + m[i][j]) / s, (m[k][i] + m[i][k]) / s
    length = _length(np.array(q))
    if q[0] / length < 0:
        length = -length
    return (q[0] / length, q[1] / length, q[2] / length, q[3] / length)


def _length(v: Array) -> float:
    """Euclidean length of a vector."""
    return math.sqrt(float(v.dot(v)))


def look_rotation(x_axis: ArrayLike, y_axis: ArrayLike) -> Quat:
    """Rotation whose x axis is `x_axis` and whose y axis is as near to `y_axis` as possible."""
    x = np.asarray(x_axis, dtype=float)
    x = x / _length(x)
    y = np.asarray(y_axis, dtype=float)
    y = y - x * float(x.dot(y))
    y = y / _length(y)
    (a, b, c), (d, e, f) = x.tolist(), y.tolist()
    return _quaternion(((a, d, b * f - c * e), (b, e, c * d - a * f), (c, f, a * e - b * d)))


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
    four[..., 0, 1:] = four[..., 1:, 0] = turning_vector(m)
    for i, j in ((1, 2), (1, 3), (2, 3)):
        four[..., i, j] = four[..., j, i] = m[..., i - 1, j - 1] + m[..., j - 1, i - 1]
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
    parts = [matrix[..., i, j] - matrix[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))]
    return np.stack(parts, axis=-1)
