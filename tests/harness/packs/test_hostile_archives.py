"""What is read of mesh files, and archives that are broken or mean harm: one sentence each."""

import os
import re
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_archive import READS_MESHES, make_archive
from mesh_writers import Piece, empty_png, glb, glb_bytes, write_glb, write_obj, write_textured_obj

from robospa.harness.packs import mesh_files
from robospa.harness.packs.archive import Archive, ArchiveError, open_archive
from robospa.harness.packs.mesh_files import RawMesh, check_glb, read_mesh
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


# ---- mesh files: what is read of them, and hostile GLB files, refused before anything is allocated


RED, GREEN = (220, 30, 30), (20, 180, 60)
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
TWO = [Piece(CORNERS, FACES, RED), Piece(CORNERS + 2, FACES, GREEN)]


def read(folder: Path, name: str) -> RawMesh:
    return read_mesh(folder / "objects" / name, Archive(folder).inside)


def colours(mesh: RawMesh) -> list[tuple[int, ...]]:
    """What the picture shows at each vertex."""
    side = len(mesh.picture)
    at = np.minimum((mesh.uv * side).astype(int), side - 1)
    return [tuple(mesh.picture[row, column, :3].tolist()) for column, row in at]


@pytest.mark.parametrize("ending", ["glb", "obj"])
def test_several_meshes_become_one_with_one_picture(tmp_path: Path, ending: str) -> None:
    path = tmp_path / "objects" / f"two.{ending}"
    (write_glb if ending == "glb" else write_obj)(path, TWO)
    mesh = read(tmp_path, path.name)
    assert len(mesh.faces) == 8 and mesh.faces.max() == len(mesh.vertices) - 1
    seen = dict(zip(map(tuple, mesh.vertices.tolist()), colours(mesh), strict=True))
    for place, expected in (((1, 0, 0), RED), ((3, 2, 2), GREEN)):
        assert np.abs(np.subtract(seen[place], expected)).max() <= 2


def with_picture(picture: bytes) -> bytes:
    """A GLB file with another picture than its own."""
    header, data = glb(TWO)
    view = header["bufferViews"][header["images"][0]["bufferView"]]
    view |= {"byteOffset": len(data), "byteLength": len(picture)}
    data += picture + b"\0" * (-len(picture) % 4)
    header["buffers"][0]["byteLength"] = len(data)
    return glb_bytes(header, data)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (with_picture(empty_png(9000, 16)), "9000x16 pixels"),
        (with_picture(empty_png(200_000, 200_000)), "unreadable picture"),
        (with_picture(b"no picture at all"), "unreadable picture"),
        (with_picture(empty_png(64, 64)), "image file is truncated"),
        (glb_bytes(*glb([Piece(CORNERS * np.nan, FACES)])), "places that no object can have"),
        (glb_bytes(*glb([Piece(CORNERS, FACES + 9)])), "base0.glb"),
        (b"", "is no GLB file"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0", "is no GLB file"),
        (struct.pack("<4sIII4s", b"glTF", 1, 20, 0, b"JSON"), "no GLB file of version 2"),
        (struct.pack("<4sIII4s", b"glTF", 2, 2**31, 2**31, b"JSON"), "promises 2147483648 bytes"),
        (struct.pack("<4sIII4s", b"glTF", 2, 24, 4, b"JSON") + b"{]  ", "unreadable header"),
        (struct.pack("<4sIII4s", b"glTF", 2, 24, 4, b"JSON") + b"[]  ", "no JSON object"),
    ],
)
def test_hostile_files_are_refused_in_a_sentence(
    tmp_path: Path, content: bytes, message: str
) -> None:
    path = tmp_path / "objects" / "base0.glb"
    path.parent.mkdir()
    path.write_bytes(content.replace(b"NaN", b"0.0"))
    with pytest.raises(ArchiveError, match=message):
        read(tmp_path, "base0.glb")


def test_a_missing_file_and_other_formats_are_named(tmp_path: Path) -> None:
    (tmp_path / "objects").mkdir()
    with pytest.raises(ArchiveError, match="is missing"):
        read(tmp_path, "base0.glb")
    with pytest.raises(ArchiveError, match=r"no \.glb, \.obj, \.stl, \.ply file"):
        read(tmp_path, "link.dae")


@pytest.mark.parametrize("inside", [True, False])
def test_an_obj_file_takes_nothing_from_outside(tmp_path: Path, inside: bool) -> None:
    path = tmp_path / "objects" / "x" / "a.obj"
    write_textured_obj(path, Piece(CORNERS, FACES, (10, 200, 250)))
    if not inside:
        (path.parent / "textured.png").rename(tmp_path / "secret.png")
        path.with_name("textured.mtl").write_text("newmtl picture\nmap_Kd ../../secret.png\n")
        with pytest.raises(ArchiveError, match="leads out"):
            read_mesh(path, Archive(tmp_path).inside)
    else:
        assert (10, 200, 250) in colours(read_mesh(path, Archive(tmp_path).inside))


TRIANGLE = Piece(np.eye(3), np.array([[0, 1, 2]]))


def written(folder: Path, content: bytes) -> Path:
    path = folder / "base0.glb"
    path.write_bytes(content)
    return path


def test_a_sound_file_passes_and_says_where_its_pictures_are(tmp_path: Path) -> None:
    path = written(tmp_path, glb_bytes(*glb([TRIANGLE])))
    ((offset, length),) = check_glb(path)
    assert path.read_bytes()[offset : offset + length].startswith(b"\x89PNG")


def changed(kind: str, **values: Any) -> Callable[[dict[str, Any]], object]:
    """A header whose first entry of a kind has other values; None is left out."""

    def change(header: dict[str, Any]) -> None:
        header[kind][0].update(values)
        header[kind][0] = {k: v for k, v in header[kind][0].items() if v is not None}

    return change


def holding(*children: list[int]) -> Callable[[dict[str, Any]], object]:
    return lambda header: header.update(nodes=[{"children": some} for some in children])


CASES: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "huge count": (changed("accessors", count=10**12), "promises 1000000000000 num"),
    "wide stride": (changed("bufferViews", byteStride=2**40), "promises 3 numbers"),
    "no data": (changed("accessors", bufferView=None), "not in the file"),
    "sparse": (changed("accessors", sparse={}), "not in the file"),
    "negative": (changed("accessors", count=-1), "where a count"),
    "not whole": (changed("accessors", count=1.5), "where a count"),
    "strange type": (changed("accessors", type="VEC9"), "no valid GLB"),
    "long view": (changed("bufferViews", byteLength=10**9), "beyond its data"),
    "far view": (changed("bufferViews", byteOffset=10**9), "beyond its data"),
    "long buffer": (changed("buffers", byteLength=10**9), "bytes of data"),
    "other file": (changed("buffers", uri="../../etc/passwd"), "another file"),
    "other picture": (lambda h: h["images"].append({"uri": "x.png"}), "picture in another file"),
    "compressed": (lambda h: h.update(extensionsRequired=["KHR_draco_mesh_compression"]), "KHR_"),
    "ring": (holding([1], [0]), "hold each other"),
    "copies": (lambda h: h.update(nodes=[{"mesh": 0}] * 60_000), "vertices, more than"),
    "pyramid": (holding(*([k + 1, k + 1] for k in range(40)), []), "a node in two places"),
    "many nodes": (lambda h: h.update(nodes=[{}] * 200_000), "200000 nodes"),
    "no list": (lambda h: h.update(accessors=7), "no valid GLB"),
    "a map of nodes": (lambda h: h.update(nodes={"a": 1}), "no valid GLB"),
    "no primitives": (lambda h: h.update(meshes=[{"primitives": 5}]), "no valid GLB"),
}


@pytest.mark.parametrize("case", CASES)
def test_hostile_glb_files_are_refused_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    monkeypatch.setattr(mesh_files, "MOST_VERTICES", 100_000)
    change, message = CASES[case]
    header, data = glb([TRIANGLE])
    change(header)
    with pytest.raises(ArchiveError, match=message) as refused:
        check_glb(written(tmp_path, glb_bytes(header, data)))
    assert "base0.glb" in str(refused.value) and "\n" not in str(refused.value)
