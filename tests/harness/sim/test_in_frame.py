"""What is not drawn is nowhere in the picture."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, yaw_rotation
from robospa.harness.sim.cameras import CameraView, pixels
from robospa.harness.sim.renderer import in_frame, may_show
from robospa.tasks.objects import object_model
from robospa.workcell import HEIGHT, WIDTH, WORKCELL

HEAD = CameraView(WORKCELL.head.pose, WORKCELL.head.fov, 0.1), WIDTH / HEIGHT


def test_nothing_that_the_head_camera_sees_is_left_out() -> None:
    """A ball around a point may be seen wherever the point is, and is not far outside."""
    rng = np.random.default_rng(0)
    x, y, z = rng.uniform((-1.0, -0.6, 0.7), (1.0, 0.6, 1.0), (3000, 3)).T
    column, row = WORKCELL.head.pixel(x, y, z)
    inside = (column > 0) & (column < WIDTH) & (row > 0) & (row < HEIGHT)
    far = (np.abs(column - WIDTH / 2) > WIDTH) | (np.abs(row - HEIGHT / 2) > HEIGHT)
    told = np.array([may_show(*HEAD, p, 0.02) for p in np.stack([x, y, z], 1).tolist()])
    assert told[inside].all() and inside.sum() > 300
    assert not told[far].any() and far.sum() > 100


def test_a_thing_behind_the_camera_is_not_drawn_and_one_before_it_is() -> None:
    model = object_model("bottle", {"look": 0})
    x, y, z = WORKCELL.head.position
    assert in_frame([HEAD], model, Pose((0.0, 0.0, 0.74)))
    assert not in_frame([HEAD], model, Pose((x, y - 1.0, z)))
    turned = CameraView(Pose((0.0, 0.0, 1.0), yaw_rotation(math.pi / 2)), 0.6, 0.1), 4 / 3
    assert in_frame([turned], model, Pose((0.0, 2.0, 1.0)))
    assert not in_frame([turned], model, Pose((2.0, 0.0, 1.0)))
    assert in_frame([HEAD, turned], model, Pose((0.0, 2.0, 1.0)))


SKY = np.array([101, 112, 103], dtype=np.uint8)


class Camera:
    """Has taken `picture`, RGBA (height, width, 4)."""

    def __init__(self, picture: NDArray[np.uint8]) -> None:
        self.picture = picture

    def get_picture(self, name: str) -> NDArray[np.uint8]:
        assert name == "Color"
        return self.picture


def random_picture(width: int) -> NDArray[np.uint8]:
    return np.random.default_rng(0).integers(100, 120, (6, width, 4), dtype=np.uint8)


def test_a_row_is_cut_into_its_pictures() -> None:
    row = random_picture(12)
    camera: Any = Camera(row)
    images = pixels(camera, SKY, 3)
    for image, part in zip(images, np.split(row, 3, axis=1), strict=True):
        assert image.flags.c_contiguous and image.flags.owndata
        np.testing.assert_array_equal(image, part[..., :3])


def test_the_sky_is_where_nothing_was_drawn_and_nowhere_else() -> None:
    row = random_picture(8)
    row[2, 1] = row[4, 7] = 0
    camera: Any = Camera(row)
    drawn = row[..., :3].copy()
    left, right = pixels(camera, SKY, 2)
    assert left[2, 1].tolist() == right[4, 3].tolist() == SKY.tolist()
    assert (np.hstack([left, right]) != drawn).any(axis=2).sum() == 2
