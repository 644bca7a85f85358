"""Many rotations at a time are the same as one at a time, and as SciPy's."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from robospa import geometry
from robospa.geometry import Array, from_matrix, multiply, to_matrix


def unit(count: int, seed: int) -> Array:
    """Random unit quaternions (count, 4) w x y z."""
    values = np.random.default_rng(seed).normal(size=(count, 4))
    return np.asarray(values / np.linalg.norm(values, axis=1, keepdims=True))


def test_matrices_are_those_of_one_rotation() -> None:
    quaternions = unit(50, 0)
    found = geometry.quaternion_to_matrix(3 * quaternions)
    for matrix, (w, x, y, z) in zip(found, quaternions.tolist(), strict=True):
        np.testing.assert_allclose(matrix, to_matrix((w, x, y, z)), atol=1e-14)


def test_quaternions_are_those_of_one_rotation() -> None:
    matrices = geometry.quaternion_to_matrix(unit(50, 1)).reshape(5, 10, 3, 3)
    found = geometry.matrix_to_quaternion(matrices)
    assert found.shape == (5, 10, 4)
    for quaternion, matrix in zip(found.reshape(-1, 4), matrices.reshape(-1, 3, 3), strict=True):
        np.testing.assert_allclose(quaternion, from_matrix(matrix), atol=1e-14)


def test_products_are_those_of_one_rotation() -> None:
    a, b = unit(20, 2), unit(20, 3)
    for row, p, q in zip(geometry.product(a, b), a.tolist(), b.tolist(), strict=True):
        assert tuple(row.tolist()) == multiply(tuple(p), tuple(q))


def test_angles_and_turning_vectors_are_scipys() -> None:
    a, b = unit(30, 4), unit(30, 5)
    turn = Rotation.from_quat(np.roll(a, -1, 1)).inv() * Rotation.from_quat(np.roll(b, -1, 1))
    np.testing.assert_allclose(geometry.angle_between(a, b), turn.magnitude(), atol=1e-6)
    wanted = turn.as_rotvec() / turn.magnitude()[:, None] * 2 * np.sin(turn.magnitude())[:, None]
    np.testing.assert_allclose(geometry.turning_vector(turn.as_matrix()), wanted, atol=1e-12)


def test_the_angle_of_a_tiny_turn_is_exact() -> None:
    turned = np.array([[math.cos(5e-9), math.sin(5e-9), 0, 0]])
    np.testing.assert_allclose(
        geometry.angle_between(np.array([[1.0, 0, 0, 0]]), turned), 1e-8, rtol=1e-9
    )
