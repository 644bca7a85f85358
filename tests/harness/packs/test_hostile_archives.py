"""Archives that are broken or mean harm: one sentence each, and nothing is built of them."""

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_archive import READS_MESHES, make_archive
from mesh_writers import Piece, empty_png, glb, glb_bytes

from robospa.harness.packs.archive import ArchiveError, open_archive
from robospa.harness.packs.official import OfficialPack, fault
from robospa.harness.textures import TextureFolder
from robospa.tasks.official import official_models
from robospa.tasks.packs import PackError
from robospa.tasks.scene import Texture

pytestmark = READS_MESHES

CAN = "objects/071_can"
THING = "objects/objaverse/marker/0"
NOWHERE = r"no object can have|cannot be read as a mesh"
"""The second where warnings are errors."""
Change = Callable[[Path], object]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sound archive of cans and things."""
    root = tmp_path_factory.mktemp("whole")
    return make_archive(root, ["can"], ("objects", "clutter", "background_texture"))


@pytest.fixture
def root(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it, to be harmed."""
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "cache"))
    return Path(shutil.copytree(whole, tmp_path / "archive"))


def loop(name: str) -> Change:
    """A link that leads to itself in place of a file or folder."""

    def harm(root: Path) -> None:
        path = root / name
        shutil.rmtree(path) if path.is_dir() else path.unlink()
        path.symlink_to(path.name)

    return harm


def node(**values: object) -> Change:
    """A GLB file whose node has them."""

    def harm(root: Path) -> None:
        triangles = Piece(np.eye(4, 3), np.array([[0, 1, 2], [0, 2, 3]]))
        head, data = glb([triangles], textured=False)
        head["nodes"][0].update(values)
        (root / CAN / "collision" / "base3.glb").write_bytes(glb_bytes(head, data))

    return harm


def picture(data: bytes) -> Change:
    return lambda root: (root / THING / "textured.png").write_bytes(data)


def material(text: str) -> Change:
    rows = f"newmtl picture\nmap_Kd {text}\n"
    return lambda root: (root / THING / "textured.mtl").write_text(rows)


MODEL, MARKER = ("can", {"look": 3}), ("objaverse", {"thing": "marker/0"})


@pytest.mark.parametrize(
    ("asked", "harm", "sentence"),
    [
        (MODEL, loop(f"{CAN}/visual"), "is missing"),
        (MODEL, loop(f"{CAN}/model_data3.json"), "is missing"),
        (MODEL, node(matrix=[float("nan")] * 16), NOWHERE),
        (MODEL, node(scale=[1e308] * 3), NOWHERE),
        (MARKER, loop(f"{THING}/coacd_collision.obj"), "cannot be followed: Symlink loop"),
        (MARKER, loop(f"{THING}/textured.png"), "cannot be followed"),
        (MARKER, picture(empty_png(30_000, 30_000)), "unreadable picture: Image size"),
        (MARKER, picture(empty_png(10_000, 16)), "a picture of 10000x16 pixels"),
        (MARKER, material("../../../../secret.png"), "leads out of the assets' folder"),
    ],
)
def test_what_is_harmed_is_refused_in_a_sentence(
    root: Path, asked: tuple[str, dict[str, Any]], harm: Change, sentence: str
) -> None:
    harm(root)
    with pytest.raises(ArchiveError, match=sentence) as refused:
        OfficialPack(open_archive(root)).model(*asked)
    assert len(str(refused.value)) < 500 and "\n" not in str(refused.value)


def test_a_model_without_its_meshes_is_known_before_anything_is_made(tmp_path: Path) -> None:
    archive = open_archive(make_archive(tmp_path, ["microwave"]))
    model = official_models("microwave")[0]
    assert not fault(archive, model)
    for path in tmp_path.glob("objects/044_microwave/*/textured_objs/*.obj"):
        path.unlink()
    assert re.search("the mesh '.*body_visual.obj' is missing", fault(archive, model))


def test_a_pack_names_the_tasks_that_cannot_run(root: Path) -> None:
    pack = OfficialPack(open_archive(root))
    assert not pack.faults(["Pick_Cans_Relational", "Pick_Blocks_Size"])
    (root / CAN / "model_data0.json").unlink()
    found = pack.faults(["Pick_Cans_Relational", "Pick_Blocks_Size", "Basic_Color_Blocks"])
    assert {*found} == {"Pick_Cans_Relational"}
    assert "model_data0.json' is missing" in found["Pick_Cans_Relational"]


@pytest.mark.parametrize(
    ("harm", "sentence"),
    [
        (lambda path: path.write_bytes(empty_png(30_000, 30_000)), "cannot be read: Image size"),
        (lambda path: path.write_bytes(empty_png(10_000, 16)), "10000x16 pixels"),
        (lambda path: (path.unlink(), path.symlink_to(path.name)), "Too many levels"),
        (lambda path: (path.unlink(), os.mkfifo(path)), "it is no file"),
    ],
)
def test_a_harmed_texture_is_refused_in_a_sentence(root: Path, harm: Change, sentence: str) -> None:
    harm(root / "background_texture" / "unseen" / "0.png")
    with pytest.raises(PackError, match=sentence):
        textures = TextureFolder(root / "background_texture")
        textures.about()
        textures.image(Texture("unseen", 0))
