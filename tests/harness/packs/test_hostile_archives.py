"""Archives that are broken or mean harm: one sentence each, and nothing is built of them."""

from __future__ import annotations

import os
import re
import shutil
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from made_archive import READS_MESHES, make_archive
from mesh_writers import Piece, glb, glb_bytes

from robospa.harness.packs.archive import ArchiveError, open_archive
from robospa.harness.packs.index import fault
from robospa.harness.packs.official import OfficialPack
from robospa.harness.textures import TextureFolder
from robospa.tasks.official import official_models
from robospa.tasks.packs import PackError
from robospa.tasks.scene import Texture

pytestmark = READS_MESHES

CAN = "objects/071_can"
THING = "objects/objaverse/marker/0"
NAN = float("nan")
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


def png(width: int, height: int) -> bytes:
    """A picture of which only the header is true."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        ends = struct.pack(">I", len(data)), struct.pack(">I", zlib.crc32(kind + data))
        return ends[0] + kind + data + ends[1]

    size = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    parts = [chunk(b"IHDR", size), chunk(b"IDAT", zlib.compress(bytes(100))), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def loop(name: str) -> Change:
    """A link that leads to itself in place of a file or folder."""

    def harm(root: Path) -> None:
        path = root / name
        shutil.rmtree(path) if path.is_dir() else path.unlink()
        path.symlink_to(path.name)

    return harm


def header(change: Callable[[dict[str, object]], object], textured: bool = False) -> Change:
    """A GLB file whose header was changed."""

    def harm(root: Path) -> None:
        triangles = Piece(np.eye(4, 3), np.array([[0, 1, 2], [0, 2, 3]]))
        head, data = glb([triangles], textured)
        change(head)
        (root / CAN / "collision" / "base3.glb").write_bytes(glb_bytes(head, data))

    return harm


def joints(*pairs: tuple[str, str]) -> Change:
    def harm(root: Path) -> None:
        path = root / THING / "model.urdf"
        rows = [
            f'<joint name="{k}" type="fixed"><parent link="{a}"/><child link="{b}"/></joint>'
            for k, (a, b) in enumerate(pairs)
        ]
        more = f"<link name='b'/>{''.join(rows)}</robot>"
        path.write_text(path.read_text().replace("</robot>", more))

    return harm


def picture(data: bytes) -> Change:
    return lambda root: (root / THING / "textured.png").write_bytes(data)


def material(text: str) -> Change:
    rows = f"newmtl picture\nmap_Kd {text}\n"
    return lambda root: (root / THING / "textured.mtl").write_text(rows)


def first(values: object, index: int, key: str, value: object) -> None:
    values[index][key] = value  # type: ignore[index]


@pytest.mark.parametrize(
    ("harm", "sentence"),
    [
        (loop(f"{CAN}/visual"), "is missing"),
        (loop(f"{CAN}/model_data3.json"), "is missing"),
        (header(lambda h: first(h["bufferViews"], 0, "byteLength", 10**6)), "beyond its data"),
        (header(lambda h: first(h["bufferViews"], 0, "byteStride", 2**40)), "promises 4 numbers"),
        (header(lambda h: first(h["nodes"], 0, "matrix", [NAN] * 16)), NOWHERE),
        (header(lambda h: first(h["nodes"], 0, "scale", [1e308] * 3)), NOWHERE),
        (header(lambda h: h.update(nodes={"a": 1})), "its header lacks something"),
        (header(lambda h: h.update(meshes=[{"primitives": 5}])), "its header lacks something"),
    ],
)
def test_a_harmed_model_is_refused_in_a_sentence(root: Path, harm: Change, sentence: str) -> None:
    harm(root)
    with pytest.raises(ArchiveError, match=sentence) as refused:
        OfficialPack(open_archive(root)).model("can", {"look": 3})
    assert len(str(refused.value)) < 500 and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("harm", "sentence"),
    [
        (loop(f"{THING}/coacd_collision.obj"), "cannot be followed: Symlink loop"),
        (loop(f"{THING}/textured.png"), "cannot be followed"),
        (joints(("a", "b"), ("b", "a")), "joints that form a ring"),
        (joints(("a", "a")), "joints that form a ring"),
        (picture(png(30_000, 30_000)), "unreadable picture: Image size"),
        (picture(png(10_000, 16)), "a picture of 10000x16 pixels"),
        (material("../../../../secret.png"), "leads out of the assets' folder"),
    ],
)
def test_a_harmed_thing_is_refused_in_a_sentence(root: Path, harm: Change, sentence: str) -> None:
    harm(root)
    with pytest.raises(ArchiveError, match=sentence) as refused:
        OfficialPack(open_archive(root)).model("objaverse", {"thing": "marker/0"})
    assert "\n" not in str(refused.value)


def in_urdf(old: str, new: str) -> Change:
    def harm(root: Path) -> None:
        for path in root.glob("objects/044_microwave/*/mobility.urdf"):
            path.write_text(path.read_text().replace(old, new))

    return harm


def without_meshes(root: Path) -> None:
    for path in root.glob("objects/044_microwave/*/textured_objs/*.obj"):
        path.unlink()


@pytest.mark.parametrize(
    ("harm", "sentence"),
    [
        (without_meshes, "the mesh '.*body_visual.obj' is missing"),
        (in_urdf("textured_objs/", "package://x/"), "which is no path"),
        (in_urdf("textured_objs/", "/etc/"), "'/etc/body_visual.obj' leads out"),
        (in_urdf("textured_objs/", "../../../../etc/"), "leads out of the assets' folder"),
        (in_urdf("<robot", "<!DOCTYPE r [<!ENTITY x SYSTEM 'f'>]><robot"), "defines XML entities"),
        (in_urdf('<link name="base"/>', "<link/>"), "lacks what it must have"),
        (in_urdf('<link name="base"/>', '<link name="base"/>' * 5000), "more than 4096"),
    ],
)
def test_a_harmed_urdf_file_is_known_before_anything_is_made(
    tmp_path: Path, harm: Change, sentence: str
) -> None:
    """By `robospa official assets`, and by a run, which refuses the tasks that need it."""
    root = make_archive(tmp_path, ["microwave"])
    model = official_models("microwave")[0]
    assert not fault(open_archive(root), model)
    harm(root)
    said = fault(open_archive(root), model)
    assert re.search(sentence, said) and len(said) < 500 and "\n" not in said


def test_a_pack_names_the_tasks_that_cannot_run(root: Path) -> None:
    pack = OfficialPack(open_archive(root))
    assert not pack.faults(["Pick_Cans_Relational", "Pick_Blocks_Size"])
    (root / CAN / "model_data0.json").unlink()
    found = pack.faults(["Pick_Cans_Relational", "Pick_Blocks_Size", "Basic_Color_Blocks"])
    assert {*found} == {"Pick_Cans_Relational"}
    assert "model_data0.json' is missing" in found["Pick_Cans_Relational"]


def test_a_thing_whose_picture_is_not_there_is_drawn_without(root: Path) -> None:
    (root / THING / "textured.png").unlink()
    assert OfficialPack(open_archive(root)).model("objaverse", {"thing": "marker/0"}).skin


@pytest.mark.parametrize(
    ("harm", "sentence"),
    [
        (lambda path: path.write_bytes(png(30_000, 30_000)), "cannot be read: Image size"),
        (lambda path: path.write_bytes(png(10_000, 16)), "has 10000x16 pixels, more than 8192"),
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
