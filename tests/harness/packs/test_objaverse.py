"""Things of the archive that lie about in randomised scenes of the official world alone."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from made_archive import READS_MESHES, make_archive, official_pack_in

from robospa.harness.official.layout import OfficialLayout, archive_pack, official_world_parts
from robospa.harness.packs.archive import ArchiveError, open_archive
from robospa.harness.packs.index import THING, clutter_things, digest_of, index
from robospa.harness.packs.official import OfficialPack
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import task_parts
from robospa.observation import CameraSpec
from robospa.tasks import packs
from robospa.tasks.catalog import build_scene
from robospa.tasks.modes.clutter import colors_asked, keep_out, taken_kinds
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene
from robospa.trial import TrialKey

pytestmark = READS_MESHES

KEY = TrialKey("Press_Stapler_Repeat", 1, 3, mode="randomized")
COLORED = "Stack_Blocks_Color_Order"
"""A task that names things by their colour."""
PACKED = OfficialLayout(True, "none")


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OfficialPack]:
    folder = tmp_path_factory.mktemp("objaverse")
    root = make_archive(folder / "assets", ["stapler"], ("objects", "clutter"))
    with (
        pytest.MonkeyPatch.context() as patch,
        official_pack_in(root, folder / "cache", patch),
    ):
        yield archive_pack()


def official(key: TrialKey) -> Scene:
    return official_world_parts(key, PACKED, {}).scene


def things_in(scene: Scene) -> list[str]:
    return [str(item.params["thing"]) for item in scene.clutter if item.asset == THING]


def categories(pack: OfficialPack, scene: Scene) -> set[str]:
    looks = [look for kind in pack.clutter(scene) if kind.asset == THING for look in kind.looks]
    return {str(look["thing"]).partition("/")[0] for look in looks}


def test_the_list_says_which_there_are_and_without_it_all_are(
    pack: OfficialPack, tmp_path: Path
) -> None:
    found = clutter_things(pack.archive)
    assert found["toothbrush"] == ("0", "12") and {*found} == {
        "bottle", "marker", "plush", "toothbrush"
    }  # fmt: skip
    assert index(pack.archive).clutter == 5
    archive = open_archive(make_archive(tmp_path, [], ("clutter",)))
    (tmp_path / "objects" / THING / "list.json").unlink()
    assert clutter_things(archive)["toothbrush"] == ("0", "12", "3")


def test_a_thing_collides_as_its_hull_and_stands_where_its_file_has_it(pack: OfficialPack) -> None:
    made = object_model(THING, {"thing": "marker/0", "pack": "official"})
    assert len(made.shapes) == 1 and made.size == pytest.approx((0.06, 0.04, 0.06))
    assert made.bottom == pytest.approx(-0.03)
    assert made.radius == pytest.approx(math.hypot(0.03, 0.02))
    assert made.noun == "marker" and made.skin is not None
    with np.load(made.skin.file) as skin:
        assert skin["picture"].reshape(-1, 4).mean(axis=0)[:3] == pytest.approx((200, 20, 20))


def test_look_alikes_unknown_categories_and_colours_are_left_out(pack: OfficialPack) -> None:
    assert categories(pack, official(KEY)) == {"bottle", "marker", "toothbrush"}
    bottles = build_scene("Put_Bottles_Dustbin", 2, 100_000)
    assert categories(pack, bottles) == {"marker", "toothbrush"}
    colors = build_scene(COLORED, 2, 100_000)
    assert colors_asked(colors) and categories(pack, colors) == set()


def test_they_lie_in_randomised_scenes_by_the_rules_of_all_clutter(pack: OfficialPack) -> None:
    scenes = [official(TrialKey(KEY.task, 1, seed, mode="randomized")) for seed in range(8)]
    assert len({name for scene in scenes for name in things_in(scene)}) >= 2
    for scene in scenes:
        assert Scene.from_json(scene.to_json()) == scene
        taken = keep_out(scene)
        for item in scene.clutter:
            model = object_model(item.asset, item.params)
            x, y, z = item.pose.position
            assert z + model.bottom == pytest.approx(scene.table_top)
            assert taken.free(np.array([x]), np.array([y]), model, scene.table_top)[0]
            assert item.fixed == (item.asset == THING)
            assert item.asset not in taken_kinds(scene)
    assert official(KEY) == official(KEY)


def test_no_other_scene_has_them(pack: OfficialPack) -> None:
    clean = TrialKey(KEY.task, 1, 3)
    assert not official(clean).clutter
    lit = official(TrialKey(KEY.task, 1, 3, mode="randomized:light"))
    assert not lit.clutter
    ours = task_parts(KEY).scene
    assert ours.clutter and not things_in(ours) and not any(i.fixed for i in ours.clutter)


def test_without_such_things_the_clutter_is_that_of_the_library(
    pack: OfficialPack, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robospa.harness.packs.official.clutter_kinds", lambda *_: ())
    plain = packs.with_pack(task_parts(KEY).scene, "official")
    assert official(KEY).clutter == plain.clutter


@pytest.mark.parametrize("text", ["[]", '{"list_of_items": {"bottle": 3}}', "{", "[" * 100_000])
def test_a_broken_list_is_refused_in_a_sentence(tmp_path: Path, text: str) -> None:
    archive = open_archive(make_archive(tmp_path, [], ("clutter",)))
    (tmp_path / "objects" / THING / "list.json").write_text(text)
    with pytest.raises(ArchiveError, match=r"list\.json"):
        clutter_things(archive)


@pytest.mark.parametrize("thing", ["../../secret/0", "bottle", "bottle/../0", "bottle/9", 3, None])
def test_what_is_no_thing_of_the_archive_is_refused(pack: OfficialPack, thing: object) -> None:
    with pytest.raises(ArchiveError, match=r"is no thing of the archive|is missing"):
        pack.model(THING, {"thing": thing})


def test_a_thing_in_the_wrong_unit_is_refused_and_its_files_are_hashed(tmp_path: Path) -> None:
    root = make_archive(tmp_path, [], ("clutter",))
    archive = open_archive(root)
    before = digest_of(archive)
    urdf = root / "objects" / THING / "marker" / "0" / "model.urdf"
    urdf.write_text(urdf.read_text().replace("<mesh ", '<mesh scale="100 100 100" '))
    assert digest_of(archive) != before
    with pytest.raises(ArchiveError, match="'marker/0' of the assets' folder is 6 x 4 x 6 m large"):
        OfficialPack(archive).model(THING, {"thing": "marker/0"})


@pytest.mark.sim
def test_they_are_drawn_with_their_textures_and_cannot_be_moved(pack: OfficialPack) -> None:
    seeds = range(3, 40)
    keys = [TrialKey(KEY.task, 1, seed, mode="randomized:clutter") for seed in seeds]
    scene = next(s for s in map(official, keys) if len(things_in(s)) > 1)
    world = SapienWorld(render=True)
    world.load(scene)
    image = world.render(CameraSpec("head", 160, 120)).astype(int)
    poses = world.snapshot().poses
    world.close()
    assert ((image[..., 0] > 100) & (image[..., 1] < 60)).sum() > 20
    for item in scene.clutter:
        if item.fixed:
            assert poses[item.name].position == pytest.approx(item.pose.position, abs=1e-6)
