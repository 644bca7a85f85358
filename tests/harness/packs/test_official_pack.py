"""Models of a made-up archive: shape, size, frames and grasps as tasks need them."""

import json
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from made_archive import READS_MESHES, SCALE, make_archive, make_robot, official_pack_in
from mesh_writers import Piece, write_glb

from robospa.baselines.oracle import Oracle
from robospa.geometry import Pose
from robospa.harness.official.layout import (
    OfficialLayout,
    archive_pack,
    official_world_parts,
    use_archive,
)
from robospa.harness.packs.archive import ArchiveError, open_archive
from robospa.harness.packs.official import THING, OfficialPack, clutter_things, digest_of, index
from robospa.harness.settings import Simulation
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import TrialSetup, run_trial, task_parts
from robospa.observation import CameraSpec
from robospa.protocol.policy import TrialInfo
from robospa.tasks import packs
from robospa.tasks.catalog import build_scene
from robospa.tasks.modes.clutter import colors_asked, keep_out, taken_kinds
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects import object_model
from robospa.tasks.official import official_model
from robospa.tasks.packs import with_pack
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.shapes import Box, ObjectModel
from robospa.trial import TrialKey
from robospa.workcell import TABLE_TOP

pytestmark = READS_MESHES

ASSETS = ("can", "stapler", "mug", "microwave", "kitchen_pot", "hammer", "bowl")
BREAD = ("bread", "bread_basket")
HEAD = CameraSpec("head", 160, 120)


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OfficialPack]:
    folder = tmp_path_factory.mktemp("official")
    root = make_archive(folder / "assets", (*ASSETS, *BREAD), ("objects", "clutter"))
    with pytest.MonkeyPatch.context() as patch, official_pack_in(root, folder / "cache", patch):
        yield archive_pack()


def model(pack: OfficialPack, asset: str, look: int = 0) -> ObjectModel:
    return object_model(asset, {"look": look, "pack": "official"})


@pytest.mark.parametrize("asset", ASSETS)
def test_a_model_has_all_that_the_built_in_one_has(pack: OfficialPack, asset: str) -> None:
    made, builtin = model(pack, asset), object_model(asset)
    assert {*made.frames} == {*builtin.frames}
    assert made.size == pytest.approx(builtin.size, abs=0.012)
    assert made.bottom == 0 and made.mass == builtin.mass
    assert made.phrases == builtin.phrases and made.noun == builtin.noun
    assert made.skin is not None and Path(made.skin.file).is_file()
    assert not any(shape.visual for shape in made.shapes)
    near = 1e-3 if asset in ("hammer", "microwave", "kitchen_pot") else 0.01  # origin in the middle
    for name, frame in made.frames.items():
        assert frame.position == pytest.approx(builtin.frames[name].position, abs=near), name
        assert frame.rotation == builtin.frames[name].rotation
    assert bool(made.grasps) == bool(builtin.grasps)
    for grasp in builtin.grasps:
        like = min(made.grasps, key=lambda g: np.abs(np.subtract(g.point, grasp.point)).sum())
        assert like.width == pytest.approx(grasp.width, abs=0.004)


def test_the_pressed_place_is_the_archives_contact_point(pack: OfficialPack) -> None:
    files = pack.archive.files(official_model("stapler", 2))  # type: ignore[arg-type]
    data = json.loads(files.data.read_text())
    x, _, depth = (row[3] * SCALE for row in data["contact_points_pose"][2][:3])
    touched = model(pack, "stapler", 2).frames["touched"].position
    assert touched[:2] == pytest.approx((x, -depth), abs=1e-6)


def test_a_door_turns_as_the_joint_says(pack: OfficialPack) -> None:
    made, builtin = model(pack, "microwave"), object_model("microwave")
    assert made.hinge is not None and builtin.hinge is not None
    assert made.hinge.upper == pytest.approx(builtin.hinge.upper)
    assert made.hinge.axis == pytest.approx(builtin.hinge.axis, abs=1e-5)
    opened = (made.hinge.turned(1.0) * made.frames["handle"]).position
    expected = (builtin.hinge.turned(1.0) * builtin.frames["handle"]).position
    assert opened == pytest.approx(expected, abs=0.01)
    assert made.hinge.skin is not None and made.hinge.skin != made.skin


def test_pieces_that_are_boxes_collide_as_boxes_and_a_bowl_stays_hollow(pack: OfficialPack) -> None:
    assert sum(isinstance(s.geometry, Box) for s in model(pack, "hammer").shapes) == 3
    made = model(pack, "bowl")
    assert len(made.shapes) == sum(s.collision for s in object_model("bowl").shapes)
    assert all(grasp.width < 0.012 for grasp in made.grasps)


def test_a_colour_that_a_task_asks_for_is_drawn(pack: OfficialPack) -> None:
    green = object_model("mug", {"look": 0, "tint": "green", "pack": "official"})
    assert green.skin is not None and green.skin.tint == object_model(
        "mug", {"look": 0, "tint": "green"}
    ).shapes[0].color  # fmt: skip


def test_what_the_archive_does_not_have_stays_built_in(pack: OfficialPack) -> None:
    assert not pack.has("block", {}) and pack.has("can", {"look": 1})
    with pytest.raises(ValueError, match="the official archive has no 'block'"):
        object_model("block", {"pack": "official"})


def test_the_index_says_which_tasks_can_run(pack: OfficialPack) -> None:
    found = index(pack.archive)
    assert "Pick_Seals_Multi_View needs 100_seal" in found.summary()
    assert "Pick_Cans_Relational" not in found.missing
    assert found.summary().startswith(f"{found.runnable} of 56 tasks can run with this folder; ")
    assert found.digest == pack.digest() == index(pack.archive).digest


@pytest.fixture
def broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of cans, to be broken before they are asked for."""
    root = make_archive(tmp_path / "assets", ["can"])
    with official_pack_in(root, tmp_path / "cache", monkeypatch):
        yield root / "objects" / "071_can"


def change(folder: Path, **values: object) -> None:
    path = folder / "model_data0.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


def look_0() -> ObjectModel:
    return object_model("can", {"look": 0, "pack": "official"})


def another_mesh(folder: Path) -> None:
    cube = m.box_mesh((2.0, 2.0, 2.0))
    piece = Piece(np.array(cube.vertices), np.array(cube.faces))
    write_glb(folder / "visual" / "base0.glb", [piece])


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lambda f: change(f, scale=[0.125 * 25.4] * 3), r"071_can/base0 is .* its scale"),
        (another_mesh, r"is 0\.5 x 0\.5 x 0\.5 m large where the official"),
        (lambda f: change(f, contact_points_pose=[]), "has no contact 8 point"),
    ],
)
def test_files_of_another_model_are_noticed(
    broken: Path, harm: Callable[[Path], object], words: str
) -> None:
    harm(broken)
    with pytest.raises(ArchiveError, match=words):
        look_0()


def test_a_run_with_another_folder_does_not_get_the_first_ones_models(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = [tmp_path / "a", tmp_path / "b"]
    for folder in folders:
        make_archive(folder, ["can"])
    change(folders[1] / "objects" / "071_can", mass=0.5)
    with official_pack_in(folders[0], tmp_path / "cache", monkeypatch):
        assert look_0().mass != 0.5
        use_archive(Simulation(world="official", assets=folders[1]))
        assert look_0().mass == 0.5


# ------------ things of the archive that lie about in randomised scenes of the official world alone


KEY = TrialKey("Press_Stapler_Repeat", 1, 3, mode="randomized")
COLORED = "Stack_Blocks_Color_Order"
"""A task that names things by their colour."""
PACKED = OfficialLayout(True, "none")


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
    image = world.render(HEAD).astype(int)
    poses = world.snapshot().poses
    world.close()
    assert ((image[..., 0] > 100) & (image[..., 1] < 60)).sum() > 20
    for item in scene.clutter:
        if item.fixed:
            assert poses[item.name].position == pytest.approx(item.pose.position, abs=1e-6)


# ------------------- in the simulator scenes are solved by the expert and drawn with their pictures


class OfficialOracle(Oracle):
    """Plans in the scene that the world has."""

    def reset(self, trial: TrialInfo) -> None:
        super().reset(trial)
        assert self._scene is not None
        self._scene = with_pack(self._scene, "official")


def parts_of(key: TrialKey) -> TrialSetup:
    parts = task_parts(key)
    scene = with_pack(parts.scene, "official")
    return TrialSetup(scene, parts.task, parts.task.goal(scene), parts.instruction)


@pytest.mark.sim
def test_the_expert_solves_a_scene_of_the_archive(pack: OfficialPack) -> None:
    key = TrialKey("Click_Can_Place_Items", 2, 100_000, "aloha-agilex", "clean")
    world = SapienWorld(render=False)
    record = run_trial(world, OfficialOracle(), key, policy_seed=0, parts=parts_of)
    again = run_trial(world, OfficialOracle(), key, policy_seed=0, parts=parts_of)
    assert record.success and again.digest == record.digest
    plain = run_trial(world, Oracle(), key, policy_seed=0, parts=partial(task_parts))
    assert plain.success and plain.digest != record.digest


@pytest.mark.sim
def test_objects_are_drawn_with_their_pictures(pack: OfficialPack) -> None:
    """A red, tinted mug in the middle of the table, drawn as large as its built-in likeness."""
    item = SceneObject(
        "mug", "mug", Pose((0.0, 0.0, TABLE_TOP)), {"look": 1, "tint": "red"}, fixed=True
    )
    scene = Scene("Test", 1, 100_000, "aloha-agilex", "clean", (item,), {})
    world, red = SapienWorld(render=True), []
    for shown in (scene, with_pack(scene, "official")):
        world.load(shown)
        image = world.render(HEAD).astype(int)
        red.append((image[..., 0] > 2 * image[..., 1]).sum())
    world.close()
    assert red[0] > 60 and 0.8 < red[1] / red[0] < 1.25


@pytest.mark.sim
def test_robots_are_drawn_with_the_vendors_meshes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pack: OfficialPack
) -> None:
    """Stand-ins of a robot's links look as our own shapes: they are where those are."""
    monkeypatch.setenv("ROBOSPA_ASSETS", str(make_robot(tmp_path, "piper")))
    scene = Scene("Test", 1, 100_000, "piper", "clean", (), {})
    third = CameraSpec("third", 160, 120)
    pictures = []
    for name in ("builtin", "official"):
        world = SapienWorld(render=True, robot_assets=name)
        world.load(scene)
        pictures.append(world.render(third).astype(int))
        world.close()
    off = np.abs(pictures[0] - pictures[1]).max(axis=2) > 40
    assert 0 < off.mean() < 0.02  # a plate that only the vendor has, and edges
