"""Our shader: what its cameras show, and where there is shadow. Needs a Vulkan device."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.geometry import Pose, look_rotation
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.sim.cameras import new_camera, pixels
from robospa.harness.sim.furniture import SHADOW_CENTRE, SHADOW_HALF, SUN_DIRECTION, DrawnFurniture
from robospa.harness.sim.render_bodies import render_body
from robospa.harness.sim.renderer import open_render_system
from robospa.harness.world import RenderUnavailable
from robospa.tasks.shapes import Box, Shape
from robospa.workcell import TABLE_TOP, WORKCELL

pytestmark = pytest.mark.sim


def down(x: float, y: float, z: float) -> Pose:
    """A camera there that looks straight down."""
    return Pose((x, y, z), look_rotation((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)))


def test_pictures_are_bytes_with_sky_outside_the_room_and_shadows_of_sun_and_lamps() -> None:
    import sapien

    try:
        scene = sapien.Scene([open_render_system()])
    except RenderUnavailable as error:
        pytest.fail(f"nothing can be drawn here, see `robospa check`: {error}")
    room = DrawnFurniture(scene)
    camera = new_camera(scene, 32, 24)

    def taken(pose: Pose) -> np.ndarray:
        camera.entity.pose = to_sapien(pose)
        scene.update_render()
        camera.take_picture()
        return pixels(camera, room.sky())

    sky = taken(Pose((0.0, 0.0, 2.0), look_rotation((0.0, -1.0, 1.0), (1.0, 0.0, 0.0))))
    assert sky.dtype == np.uint8 and sky.shape == (24, 32, 3)
    assert (sky == 186).all()  # 255 x 0.5 ** (1 / 2.2), ambient light of one half
    free = taken(down(0.3, 0.1, 1.2)).astype(int)
    for half, place in ((0.2, (0.3, -0.03, 1.0)), (0.05, (0.48, 0.075, 1.0))):  # sun, one lamp
        lid = render_body((Shape(Box((half, half, 0.01))),), "lid")
        assert lid is not None
        lid.pose = to_sapien(Pose(place))
        scene.add_entity(lid)
        below = taken(down(0.3, 0.1, 0.95)).astype(int)
        scene.remove_entity(lid)
        assert (free[12, 16] - below[12, 16] > 4).all()


def test_the_shadow_map_covers_the_table_and_the_wall_behind_it() -> None:
    width, depth = WORKCELL.table.size
    seen = [(x, y, TABLE_TOP) for x in (-width / 2, width / 2) for y in (-depth / 2, depth / 2)]
    seen += [(x, 0.4, 1.0) for x in (-width / 2, width / 2)]  # wall
    light = Pose(SHADOW_CENTRE, look_rotation(SUN_DIRECTION, (-1.0, 0.0, 0.0))).inverse()
    for point in seen:
        _, across, up = light.apply(point)
        assert abs(across) < SHADOW_HALF and abs(up) < SHADOW_HALF, point
