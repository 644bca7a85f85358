"""Walls, tables and lights of randomised scenes. Needs a Vulkan device."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from world_scenes import go_on, two_blocks

from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.textures import MadeTextures
from robospa.observation import CameraSpec
from robospa.tasks.scene import UNSEEN, Lights, Scene, Surroundings, Texture
from robospa.workcell import WORKCELL

pytestmark = pytest.mark.sim

HEAD, FRONT = CameraSpec("head", 160, 120), CameraSpec("front", 160, 120)
CHEQUER = Texture(UNSEEN, 98)


def seen(world: SapienWorld, around: Surroundings, camera: CameraSpec = HEAD) -> NDArray[np.int16]:
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
    (early,) = still.draw([HEAD])
    action = np.array([0.0] * 6 + [1.0] + [0.0] * 6 + [1.0], np.float32)
    world.step(action, "joint", go_on)
    late = world.render(HEAD)
    assert still != world.still()
    assert np.array_equal(still.draw([HEAD])[0], early)
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
        world.render(HEAD)
        places.append([world.view(CameraSpec(f"{arm}_wrist")).pose for arm in ("left", "right")])
    for usual, there, shift in zip(*places, shifts, strict=True):
        assert (usual.inverse() * there).position == pytest.approx(shift, abs=1e-6)


def test_a_world_says_where_its_textures_come_from(world: SapienWorld) -> None:
    assert world.info()["textures"] == {"made": 1}


def test_the_room_is_drawn_last_so_that_what_it_hides_costs_nothing(world: SapienWorld) -> None:
    for around in (Surroundings(wall=CHEQUER), Surroundings()):
        seen(world, around)
        assert world._renderer is not None
        drawn = [e.name for e in world._renderer._scene.entities if e.name]
        assert drawn[-3:] == ["table", "wall", "floor"]
