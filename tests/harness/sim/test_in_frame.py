"""What is not drawn is nowhere in the picture."""

from __future__ import annotations

import math

import numpy as np

from robospa.geometry import Pose, yaw_rotation
from robospa.harness.sim.renderer import Frustum, in_frame
from robospa.tasks.objects import object_model
from robospa.workcell import HEIGHT, WIDTH, WORKCELL

HEAD = Frustum.of(WORKCELL.head.pose, WORKCELL.head.fov, WIDTH, HEIGHT)


def test_nothing_that_the_head_camera_sees_is_left_out() -> None:
    """A ball around a point may be seen wherever the point is, and is not far outside."""
    rng = np.random.default_rng(0)
    x, y, z = rng.uniform((-1.0, -0.6, 0.7), (1.0, 0.6, 1.0), (3000, 3)).T
    column, row = WORKCELL.head.pixel(x, y, z)
    inside = (column > 0) & (column < WIDTH) & (row > 0) & (row < HEIGHT)
    far = (np.abs(column - WIDTH / 2) > WIDTH) | (np.abs(row - HEIGHT / 2) > HEIGHT)
    told = np.array([HEAD.may_show(p, 0.02) for p in np.stack([x, y, z], 1).tolist()])
    assert told[inside].all() and inside.sum() > 300
    assert not told[far].any() and far.sum() > 100


def test_a_thing_behind_the_camera_is_not_drawn_and_one_before_it_is() -> None:
    model = object_model("bottle", {"look": 0})
    x, y, z = WORKCELL.head.position
    assert in_frame([HEAD], model, Pose((0.0, 0.0, 0.74)))
    assert not in_frame([HEAD], model, Pose((x, y - 1.0, z)))
    turned = Frustum.of(Pose((0.0, 0.0, 1.0), yaw_rotation(math.pi / 2)), 0.6, 320, 240)
    assert in_frame([turned], model, Pose((0.0, 2.0, 1.0)))
    assert not in_frame([turned], model, Pose((2.0, 0.0, 1.0)))
    assert in_frame([HEAD, turned], model, Pose((0.0, 2.0, 1.0)))
