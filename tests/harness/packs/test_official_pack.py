"""Models of a made-up archive: shape, size, frames and grasps as tasks need them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from made_archive import READS_MESHES, SCALE, make_archive, official_pack_in
from mesh_writers import Piece, write_glb

from robospa.harness.official.layout import archive_pack, use_archive
from robospa.harness.packs.archive import ArchiveError
from robospa.harness.packs.index import index
from robospa.harness.packs.official import OfficialPack
from robospa.harness.settings import Simulation
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects import object_model
from robospa.tasks.official import official_model
from robospa.tasks.shapes import Box, ObjectModel

pytestmark = READS_MESHES

ASSETS = ("can", "stapler", "mug", "microwave", "kitchen_pot", "hammer", "bowl")


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OfficialPack]:
    folder = tmp_path_factory.mktemp("official")
    with pytest.MonkeyPatch.context() as patch:
        root = make_archive(folder / "assets", ASSETS)
        with official_pack_in(root, folder / "cache", patch):
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


def test_pieces_that_are_boxes_collide_as_boxes_and_a_bowl_stays_hollow(
    pack: OfficialPack,
) -> None:
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
        (
            lambda f: change(f, scale=[0.125 * 25.4] * 3),
            r"071_can/base0 is .* its scale",
        ),
        (another_mesh, r"is 0\.5 x 0\.5 x 0\.5 m large where the official"),
        (
            lambda f: change(f, contact_points_pose=[]),
            "has no contact 8 point",
        ),
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
