"""What cameras see of scenes, rooms and lights, and which body. Needs a Vulkan device."""

import math
from dataclasses import replace

import numpy as np
import pytest
from command_line import printed
from numpy.typing import NDArray
from world_scenes import block, go_on, joint_action, run_digest, scene, two_blocks, wandering

from robospa.geometry import Pose, look_rotation
from robospa.harness.robots import embodiment
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.sim.cameras import new_camera, pixels
from robospa.harness.sim.furniture import SHADOW_CENTRE, SHADOW_HALF, SUN_DIRECTION, DrawnFurniture
from robospa.harness.sim.render_bodies import render_body
from robospa.harness.sim.renderer import camera_view, open_render_system
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.textures import MadeTextures
from robospa.harness.world import OTHER, TABLE
from robospa.observation import CAMERAS, CameraSpec
from robospa.protocol.policy import PolicySpec
from robospa.tasks import catalog
from robospa.tasks.scene import UNSEEN, Lights, Scene, Surroundings, Texture
from robospa.tasks.shapes import Box, Shape
from robospa.workcell import TABLE_TOP, WORKCELL

ROBOT = embodiment("aloha-agilex")
HEAD = CameraSpec("head")


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
    image = world.render(HEAD).astype(int)
    rows, columns = np.nonzero(image[..., 0] > 1.5 * image[..., 1])
    assert (columns.mean(), rows.mean()) == pytest.approx((column, row), abs=4)


def test_objects_of_the_last_trial_are_gone(world: SapienWorld) -> None:
    world.load(two_blocks())
    assert red_share(world.render(HEAD)) > 0.001
    world.load(scene())
    assert red_share(world.render(HEAD)) == 0.0


def test_a_still_is_drawn_as_it_was_before_or_after_an_object_appears(world: SapienWorld) -> None:
    world.load(scene(block("late", 0.0, 0.0, appears_at=0.1)))
    before, drawn = world.still(), world.render(HEAD)
    world.step(joint_action(), "joint", go_on)
    after = world.still()
    assert before != after and after == world.still()
    assert red_share(drawn) == 0.0 and red_share(after.draw([HEAD])[0]) > 0.001
    assert np.array_equal(before.draw([HEAD])[0], drawn)
    assert np.array_equal(after.draw([HEAD])[0], world.render(HEAD))
    world.load(scene())
    with pytest.raises(RuntimeError, match="another scene"):
        before.draw([HEAD])


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


def test_cameras_and_sizes_that_there_are_not_are_refused(world: SapienWorld) -> None:
    world.load(scene())
    with pytest.raises(ValueError, match="no camera 'rear'; it has head, front, third, left_wrist"):
        world.render(CameraSpec("rear"))
    for width, height in ((0, 10), (10, -1), (5000, 10)):
        with pytest.raises(ValueError, match="sizes are 1 to 4096"):
            world.render(CameraSpec("head", width, height))


def test_info_names_device_driver_and_textures(world: SapienWorld) -> None:
    world.load(scene())
    world.render(CameraSpec("head", 8, 8))
    assert set(world.info()["renderer"]) == {"name", "driver", "version"}
    assert world.info()["textures"] == {"made": 1}


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


# --------------------------------------------------------------- what each pixel of a picture shows


SCENES = [
    ("Pick_Blocks_Size", 3, "clean"),
    ("Rank_Blocks_Color", 4, "randomized"),
    ("Pick_Mixed_Objects_Relational_A", 5, "clean"),
    ("Hang_Mug_Stack_Blocks", 2, "randomized"),
    ("Click_Bell_Open_Microwave_Place_Object", 5, "clean"),
]


@pytest.mark.parametrize(("task", "level", "mode"), SCENES)
def test_objects_are_found_where_the_picture_shows_them(
    world: SapienWorld, task: str, level: int, mode: str
) -> None:
    scene = catalog.build_scene(task, level, 500_001, mode=mode)
    world.load(scene)
    picture, shown, view = world.render(HEAD), world.identify(HEAD), world.view(HEAD)
    assert shown.dtype == np.int16 and shown.shape == picture.shape[:2]
    assert np.array_equal(world.render(HEAD), picture)
    rows, columns = np.nonzero(shown == TABLE)
    assert len(rows) > 20_000
    for row, column in list(zip(rows.tolist(), columns.tolist(), strict=True))[::997]:
        point = view.onto((column + 0.5) / 320, (row + 0.5) / 240, scene.table_top)
        assert point is not None and abs(point[0]) < 0.7 and abs(point[1]) < 0.5
        u, v = view.pixel(point) or (0, 0)
        assert (u * 320, v * 240) == pytest.approx((column + 0.5, row + 0.5))
    inside = 0
    for index, item in enumerate(scene.objects):
        pose = world.snapshot().poses[item.name]
        u, v = view.pixel(pose.position) or (-1.0, -1.0)
        if not (0.02 < u < 0.98 and 0.02 < v < 0.98):
            continue
        inside += 1
        around = shown[int(v * 240) - 4 : int(v * 240) + 5, int(u * 320) - 4 : int(u * 320) + 5]
        assert index in around or (around >= 0).all() or item.appears_at is not None, item.name
        if index in shown:  # nothing of it where the picture has the table's colour
            assert picture[shown == index].std() > 2
    assert inside >= 2
    assert set(np.unique(shown).tolist()) <= {OTHER, TABLE, *range(len(scene.everything))}


def test_looking_changes_nothing_and_hands_are_no_objects(world: SapienWorld) -> None:
    world.load(two_blocks())
    before = world.render(HEAD), world.digest()
    shown = world.identify(CameraSpec("left_wrist", 64, 48))
    assert OTHER in shown and shown.shape == (48, 64)
    assert np.array_equal(before[0], world.render(HEAD)) and before[1] == world.digest()
    world.step(joint_action(), "joint", go_on)
    assert (world.identify(HEAD) == OTHER).sum() > 2_000


def test_an_upper_half_of_sky_has_no_table_point(world: SapienWorld) -> None:
    world.load(two_blocks())
    view = world.view(CameraSpec("third", 40, 30))
    assert view.onto(0.5, -20.0, 0.74) is None
    assert view.pixel(tuple(np.add(view.pose.position, (0, 1, 0)))) is None


# ---------------------------------------------------- walls, tables and lights of randomised scenes


pytestmark = pytest.mark.sim

SMALL, FRONT = CameraSpec("head", 160, 120), CameraSpec("front", 160, 120)
CHEQUER = Texture(UNSEEN, 98)


def seen(world: SapienWorld, around: Surroundings, camera: CameraSpec = SMALL) -> NDArray[np.int16]:
    """A picture of the two blocks with these surroundings."""
    world.load(dressed(around))
    return world.render(camera).astype(np.int16)


def dressed(around: Surroundings) -> Scene:
    return replace(two_blocks(), surroundings=around)


def test_a_scene_is_drawn_as_if_no_other_had_been_before(world: SapienWorld) -> None:
    plain = seen(world, Surroundings())
    mixed = Surroundings(CHEQUER, Texture(UNSEEN, 3), Lights((1.0, 0.2, 0.2)), (0.0, 0.0, 0.05))
    first = seen(world, mixed)
    seen(world, replace(mixed, table=Texture(UNSEEN, 4), lights=Lights(flicker=7)))
    assert np.array_equal(seen(world, Surroundings()), plain)
    assert np.array_equal(seen(world, mixed), first)
    assert np.abs(first - plain).mean() > 10


def test_the_image_lies_on_the_whole_table_as_the_head_sees_it(world: SapienWorld) -> None:
    picture = seen(world, Surroundings(table=CHEQUER))
    image = MadeTextures.image(CHEQUER).astype(float)
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-0.2, 0.2, 21), np.linspace(0.08, 0.3, 12)))
    columns, rows = WORKCELL.head.pixel(x, y, 0.74)
    shown = picture[(rows / 2).astype(int), (columns / 2).astype(int)].sum(axis=1)
    width, depth = WORKCELL.table.size
    j, i = ((x / width + 0.5) * 256).astype(int), ((0.5 - y / depth) * 256).astype(int)
    painted = image[i, j].sum(axis=1)
    assert np.corrcoef(shown, painted)[0, 1] > 0.8


def test_the_wall_has_its_own_image(world: SapienWorld) -> None:
    plain = seen(world, Surroundings(), FRONT)
    walled = seen(world, Surroundings(wall=CHEQUER), FRONT)
    changed = np.abs(walled - plain).max(axis=2) > 8
    assert changed[:40].mean() > 0.8
    assert changed[-30:].mean() < 0.1


def test_lights_that_flicker_follow_from_seed_and_instant(world: SapienWorld) -> None:
    world.load(dressed(Surroundings(lights=Lights(flicker=11))))
    still = world.still()
    (early,) = still.draw([SMALL])
    action = np.array([0.0] * 6 + [1.0] + [0.0] * 6 + [1.0], np.float32)
    world.step(action, "joint", go_on)
    late = world.render(SMALL)
    assert still != world.still()
    assert np.array_equal(still.draw([SMALL])[0], early)
    empty = early[:40].reshape(-1, 3).mean(axis=0), late[:40].reshape(-1, 3).mean(axis=0)
    assert np.abs(empty[0] - empty[1]).max() > 5


def test_the_head_camera_stands_where_the_scene_says(world: SapienWorld) -> None:
    plain, shifted = (
        seen(world, Surroundings(camera_shift=(x, 0.0, 0.0))).astype(int) for x in (0.0, 0.02)
    )
    red = [p[..., 0] > 1.6 * p[..., 1] for p in (plain, shifted)]
    columns = [np.nonzero(mask)[1].mean() for mask in red]
    assert 2.0 < columns[0] - columns[1] < 12.0


def test_wrist_cameras_are_so_far_from_their_places_as_the_scene_says(world: SapienWorld) -> None:
    shifts = ((0.01, 0.0, 0.0), (0.0, -0.02, 0.005))
    places = []
    for shift in (Scene.wrist_shifts, shifts):
        world.load(replace(dressed(Surroundings()), wrist_shifts=shift))
        world.render(SMALL)
        places.append([world.view(CameraSpec(f"{arm}_wrist")).pose for arm in ("left", "right")])
    for usual, there, shift in zip(*places, shifts, strict=True):
        assert (usual.inverse() * there).position == pytest.approx(shift, abs=1e-6)


def test_the_room_is_drawn_last_so_that_what_it_hides_costs_nothing(world: SapienWorld) -> None:
    for around in (Surroundings(wall=CHEQUER), Surroundings()):
        seen(world, around)
        assert world._renderer is not None
        drawn = [e.name for e in world._renderer._scene.entities if e.name]
        assert drawn[-3:] == ["table", "wall", "floor"]
