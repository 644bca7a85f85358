"""What each pixel of a picture shows. Needs a Vulkan device."""

import numpy as np
import pytest
from world_scenes import go_on, joint_action, run_digest, two_blocks

from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.world import OTHER, TABLE
from robospa.observation import CameraSpec
from robospa.tasks import catalog

pytestmark = pytest.mark.sim

HEAD = CameraSpec("head")
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
    hidden = SapienWorld(render=False)
    assert run_digest(world, two_blocks(), 1) == run_digest(hidden, two_blocks(), 1)
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
