"""What the cameras see. Needs a Vulkan device."""

import math

import numpy as np
import pytest
from command_line import printed
from world_scenes import block, go_on, joint_action, run_digest, scene, two_blocks, wandering

from robospa.geometry import Pose, look_rotation
from robospa.harness.robots import embodiment
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.sim.cameras import new_camera, pixels
from robospa.harness.sim.furniture import SHADOW_CENTRE, SHADOW_HALF, SUN_DIRECTION, DrawnFurniture
from robospa.harness.sim.render_bodies import render_body
from robospa.harness.sim.renderer import camera_view, open_render_system
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.observation import CAMERAS, CameraSpec
from robospa.protocol.policy import PolicySpec
from robospa.tasks.shapes import Box, Shape
from robospa.workcell import TABLE_TOP, WORKCELL

pytestmark = pytest.mark.sim

ROBOT = embodiment("aloha-agilex")


def red_share(image: np.ndarray) -> float:
    """Share of clearly red pixels."""
    levels = image.astype(int)
    return float(((levels[..., 0] > 100) & (levels[..., 0] > 1.5 * levels[..., 1])).mean())


def test_observe_draws_exactly_the_cameras_asked_for(world: SapienWorld) -> None:
    world.load(two_blocks())
    spec = PolicySpec("p", cameras=(CameraSpec("head", 64, 48), CameraSpec("third", 40, 30)))
    images = world.observe(spec)["images"]
    assert {name: image.shape for name, image in images.items()} == {
        "head": (48, 64, 3),
        "third": (30, 40, 3),
    }
    assert images["head"].dtype == np.uint8


@pytest.mark.parametrize("camera", CAMERAS)
def test_every_camera_sees_something(world: SapienWorld, camera: str) -> None:
    world.load(two_blocks())
    world.step(joint_action(), "joint", go_on)
    assert world.render(CameraSpec(camera, 64, 48)).std() > 3


def test_an_object_is_where_its_projection_says(world: SapienWorld) -> None:
    world.load(scene(block("one", 0.1, -0.05)))
    view = camera_view(ROBOT, "head", ())
    x, y, z = view.pose.inverse().apply(world.snapshot().poses["one"].position)
    focal = 120 / math.tan(view.fov / 2)
    column, row = 160 - focal * y / x, 120 - focal * z / x
    image = world.render(CameraSpec("head")).astype(int)
    rows, columns = np.nonzero(image[..., 0] > 1.5 * image[..., 1])
    assert (columns.mean(), rows.mean()) == pytest.approx((column, row), abs=4)


def test_objects_of_the_last_trial_are_gone(world: SapienWorld) -> None:
    world.load(two_blocks())
    assert red_share(world.render(CameraSpec("head"))) > 0.001
    world.load(scene())
    assert red_share(world.render(CameraSpec("head"))) == 0.0


def test_a_still_is_drawn_as_it_was_before_or_after_an_object_appears(world: SapienWorld) -> None:
    head = CameraSpec("head")
    world.load(scene(block("late", 0.0, 0.0, appears_at=0.1)))
    before, drawn = world.still(), world.render(head)
    world.step(joint_action(), "joint", go_on)
    after = world.still()
    assert before != after and after == world.still()
    assert red_share(drawn) == 0.0 and red_share(after.draw([head])[0]) > 0.001
    assert np.array_equal(before.draw([head])[0], drawn)
    assert np.array_equal(after.draw([head])[0], world.render(head))
    world.load(scene())
    with pytest.raises(RuntimeError, match="another scene"):
        before.draw([head])


def test_instants_at_rest_look_the_same_whenever_they_are(world: SapienWorld) -> None:
    """So that a film draws them once."""
    hold = joint_action((0,) * 6, (0,) * 6)
    world.load(scene())
    world.step(hold, "joint", go_on)
    still, now = world.still(), world.snapshot().time
    world.step(hold, "joint", go_on)
    assert world.still() == still and world.snapshot().time > now


def test_the_same_state_gives_the_same_picture(world: SapienWorld) -> None:
    pictures = []
    for _ in range(2):
        world.load(two_blocks())
        world.step(joint_action(), "joint", go_on)
        pictures.append(world.render(CameraSpec("left_wrist")))
        world.load(scene())
        world.render(CameraSpec("front"))
    assert np.array_equal(*pictures)


def test_looking_does_not_change_the_trial(world: SapienWorld) -> None:
    blind = run_digest(SapienWorld(render=False), two_blocks(), seed=5)
    world.load(two_blocks())
    for action in wandering(4, 5):
        world.observe(PolicySpec("p"))
        world.step(action, "joint", go_on)
    assert world.digest() == blind


def test_a_closed_gripper_shows_both_fingertips_in_its_wrist_camera() -> None:
    # where it is officially mounted it sees an open gripper's left finger only
    for arm in ROBOT.arms:
        eye = arm.camera.inverse()
        for finger, side in zip(arm.fingers, (1.0, -1.0), strict=True):
            tip = finger.origin * Pose((0.071, -0.0205 * side, 0.0))
            x, y, z = eye.apply(tip.position)
            assert abs(z / x) < math.tan(ROBOT.arms[0].wrist_fov / 2)
            assert abs(y / x) < math.tan(ROBOT.arms[0].wrist_fov / 2) * 4 / 3


def test_an_unknown_camera_is_refused(world: SapienWorld) -> None:
    world.load(scene())
    with pytest.raises(ValueError, match="no camera 'rear'; it has head, front, third, left_wrist"):
        world.render(CameraSpec("rear"))


@pytest.mark.parametrize(("width", "height"), [(0, 10), (10, -1), (5000, 10)])
def test_an_impossible_size_is_refused(world: SapienWorld, width: int, height: int) -> None:
    world.load(scene())
    with pytest.raises(ValueError, match="sizes are 1 to 4096"):
        world.render(CameraSpec("head", width, height))


def test_info_names_device_and_driver(world: SapienWorld) -> None:
    world.load(scene())
    world.render(CameraSpec("head", 8, 8))
    assert set(world.info()["renderer"]) == {"name", "driver", "version"}


def test_without_a_device_physics_runs_and_drawing_says_what_to_do() -> None:
    code = (
        "from world_scenes import *; from robospa.harness.sim.sapien_world import SapienWorld\n"
        "from robospa.observation import CameraSpec\n"
        "w = SapienWorld(); w.load(two_blocks())\n"
        "w.step(joint_action(), 'joint', go_on)\n"
        "try: w.render(CameraSpec('head'))\n"
        "except Exception as e: print(type(e).__name__, e)"
    )
    none = "/nonexistent.json"
    said = printed(code, VK_ICD_FILENAMES=none, VK_DRIVER_FILES=none)
    assert said.startswith("RenderUnavailable") and "robospa check" in said


def test_pictures_are_bytes_with_sky_outside_the_room_and_shadows_of_sun_and_lamps() -> None:
    import sapien

    scene = sapien.Scene([open_render_system()])
    room = DrawnFurniture(scene)
    camera = new_camera(scene, 32, 24)

    def taken(pose: Pose) -> np.ndarray:
        camera.entity.pose = to_sapien(pose)
        scene.update_render()
        camera.take_picture()
        return pixels(camera, room.sky())[0]

    sky = taken(Pose((0.0, 0.0, 2.0), look_rotation((0.0, -1.0, 1.0), (1.0, 0.0, 0.0))))
    assert sky.dtype == np.uint8 and sky.shape == (24, 32, 3)
    assert (sky == 186).all()  # 255 x 0.5 ** (1 / 2.2), ambient light of one half
    down = look_rotation((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0))
    free = taken(Pose((0.3, 0.1, 1.2), down)).astype(int)
    for half, place in ((0.2, (0.3, -0.03, 1.0)), (0.05, (0.48, 0.075, 1.0))):  # sun, one lamp
        lid = render_body((Shape(Box((half, half, 0.01))),), "lid")
        assert lid is not None
        lid.pose = to_sapien(Pose(place))
        scene.add_entity(lid)
        below = taken(Pose((0.3, 0.1, 0.95), down)).astype(int)
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
