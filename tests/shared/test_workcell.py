"""The workcell: the head camera's projection and reach, and that robots fit it."""

import math

import numpy as np
import pytest
from scene_checks import pixels
from scipy.spatial.transform import Rotation

from robospa import geometry
from robospa.geometry import Array, Pose, axis_rotation, from_matrix, multiply, rotate, to_matrix
from robospa.harness.robots import embodiment, embodiments
from robospa.workcell import HEIGHT, TABLE_TOP, WIDTH, WORKCELL, grasp_points

A = np.array
CELL = WORKCELL


def test_point_on_the_optical_axis_is_the_image_centre() -> None:
    eye = CELL.head.position
    u, v = CELL.head.pixel(A([eye[0]]), A([eye[1] + 0.6]), A([eye[2] - 0.8]))
    assert (u[0], v[0]) == pytest.approx((160.0, 120.0))


@pytest.mark.parametrize(
    ("x", "y", "axis", "edge"),
    [
        (0.0, -0.248, 1, 240.0),
        (0.0, 0.432, 1, 0.0),
        (-0.303, -0.248, 0, 0.0),
        (0.239, -0.248, 0, 320.0),
        (0.421, 0.432, 0, 320.0),
    ],
)
def test_edges_of_the_visible_table_are_the_official_ones(
    x: float, y: float, axis: int, edge: float
) -> None:
    """By our camera, and by that of the scenes' rules, which is written apart."""
    assert CELL.head.pixel(A([x]), A([y]), TABLE_TOP)[axis][0] == pytest.approx(edge, abs=1.0)
    assert pixels(A([x, y, TABLE_TOP]))[axis] == pytest.approx(edge, abs=1.0)


def test_pixels_per_metre_at_the_table_centre_are_the_official_ones() -> None:
    u, _ = CELL.head.pixel(A([0.0, 0.01]), A([0.0, 0.0]), TABLE_TOP)
    assert (u[1] - u[0]) / 0.01 == pytest.approx(474, abs=2)


def test_tall_object_leaves_the_view_before_a_flat_one() -> None:
    x, y = A([0.24]), A([-0.1])
    flat, tall = CELL.in_view(x, y, 0.0, 0.0), CELL.in_view(x, y, 0.0, 0.12)
    assert (bool(flat[0]), bool(tall[0])) == (True, False)


@pytest.mark.parametrize("y", [-0.18, 0.0, 0.1])
def test_view_span_ends_where_the_view_does(y: float) -> None:
    low, high = CELL.view_span(y, 0.03, 0.05)
    inside = CELL.in_view(A([low, high]) + A([1e-6, -1e-6]), A([y, y]), 0.03, 0.05)
    outside = CELL.in_view(A([low, high]) + A([-1e-3, 1e-3]), A([y, y]), 0.03, 0.05)
    assert inside.all() and not outside.any()


def test_reach_covers_the_work_area_and_not_the_far_edge() -> None:
    assert CELL.in_reach(A([0.0, -0.25, 0.25]), A([0.19, 0.2, 0.2])).all()
    assert not CELL.in_reach(A([0.0]), A([0.34]))[0]


@pytest.mark.parametrize("name", embodiments())
def test_pixels_are_those_of_a_pinhole_at_the_cameras_pose(name: str) -> None:
    # by the pose that the renderer uses, not by the axes that `pixel` works with
    rng = np.random.default_rng(0)
    for camera in embodiment(name).cameras.values():
        for _ in range(20):
            local = A([1.0, *rng.uniform(-0.3, 0.3, 2)]) * rng.uniform(0.5, 2.0)
            x, y, z = camera.pose.apply(tuple(local.tolist()))
            focal = HEIGHT / 2 / np.tan(camera.fov / 2)
            u = WIDTH / 2 - focal * local[1] / local[0]
            v = HEIGHT / 2 - focal * local[2] / local[0]
            found = camera.pixel(A([x]), A([y]), A([z]))
            assert np.ravel(found) == pytest.approx([u, v], abs=1e-6)


@pytest.mark.parametrize("name", embodiments())
def test_the_head_camera_of_every_robot_is_the_one_that_scenes_are_drawn_for(name: str) -> None:
    assert embodiment(name).cameras["head"] == CELL.head


def test_scenes_are_drawn_for_arms_that_stand_where_those_of_the_first_robot_do() -> None:
    for arm, site in zip(embodiment("aloha-agilex").arms, CELL.arms, strict=True):
        # 7 mm: scenes are drawn for a right base at 0.300, the mount is at 0.306
        assert np.hypot(*np.subtract(arm.base.position[:2], site.base)) <= 0.0071


def test_a_grasp_point_lies_ahead_of_the_end_effector() -> None:
    end = Pose((0.1, 0.2, 0.9), axis_rotation((1.0, 2.0, 3.0), 1.1))
    grippers = embodiment("aloha-agilex").grippers
    ahead = A(rotate(end.rotation, (grippers[0].grasp_centre, 0.0, 0.0)))
    points = grasp_points(grippers, (end, Pose()))
    assert points[0] == pytest.approx(tuple(A(end.position) + ahead), abs=1e-12)
    assert points[1] == pytest.approx((grippers[1].grasp_centre, 0.0, 0.0))


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
