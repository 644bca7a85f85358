"""Mesh files: what is read of them, and hostile GLB files, refused before anything is allocated."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_archive import READS_MESHES
from mesh_writers import Piece, empty_png, glb, glb_bytes, write_glb, write_obj, write_textured_obj

from robospa.harness.packs import mesh_files as checks
from robospa.harness.packs.archive import Archive, ArchiveError
from robospa.harness.packs.mesh_files import RawMesh, check_glb, read_mesh

pytestmark = READS_MESHES

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
    monkeypatch.setattr(checks, "MOST_VERTICES", 100_000)
    change, message = CASES[case]
    header, data = glb([TRIANGLE])
    change(header)
    with pytest.raises(ArchiveError, match=message) as refused:
        check_glb(written(tmp_path, glb_bytes(header, data)))
    assert "base0.glb" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is no GLB file"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0", "is no GLB file"),
        (struct.pack("<4sIII4s", b"glTF", 1, 20, 0, b"JSON"), "no GLB file of version 2"),
        (struct.pack("<4sIII4s", b"glTF", 2, 2**31, 2**31, b"JSON"), "promises 2147483648 bytes"),
        (struct.pack("<4sIII4s", b"glTF", 2, 24, 4, b"JSON") + b"{]  ", "unreadable header"),
        (struct.pack("<4sIII4s", b"glTF", 2, 24, 4, b"JSON") + b"[]  ", "no JSON object"),
    ],
)
def test_files_that_are_none_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    with pytest.raises(ArchiveError, match=message):
        check_glb(written(tmp_path, content))
