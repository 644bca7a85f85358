"""Hostile GLB files are refused before anything of them is allocated."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mesh_writers import Piece, glb, glb_bytes

from robospa.harness.packs import mesh_files as checks
from robospa.harness.packs.archive import ArchiveError
from robospa.harness.packs.mesh_files import check_glb

TRIANGLE = Piece(np.eye(3), np.array([[0, 1, 2]]))


def written(folder: Path, content: bytes) -> Path:
    path = folder / "base0.glb"
    path.write_bytes(content)
    return path


def test_a_sound_file_passes_and_says_where_its_pictures_are(tmp_path: Path) -> None:
    path = written(tmp_path, glb_bytes(*glb([TRIANGLE])))
    ((offset, length),) = check_glb(path)
    assert path.read_bytes()[offset : offset + length].startswith(b"\x89PNG")


def deep(header: dict[str, Any]) -> None:
    header["nodes"] = [{"children": [1]}, {"children": [0]}]


def copies(header: dict[str, Any]) -> None:
    """Few vertices, drawn by many nodes."""
    header["nodes"] = [{"mesh": 0}] * 60_000


def shared(header: dict[str, Any]) -> None:
    """A pyramid of nodes, each of which holds the next twice."""
    header["nodes"] = [{"children": [k + 1, k + 1]} for k in range(40)] + [{"mesh": 0}]


CASES: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "huge count": (lambda h: h["accessors"][0].update(count=10**12), "promises 1000000000000 num"),
    "no data": (lambda h: h["accessors"][0].pop("bufferView"), "numbers that are not in the file"),
    "sparse": (lambda h: h["accessors"][0].update(sparse={}), "numbers that are not in the file"),
    "negative": (lambda h: h["accessors"][0].update(count=-1), "where a count or number must"),
    "not whole": (lambda h: h["accessors"][0].update(count=1.5), "where a count or number must"),
    "strange type": (lambda h: h["accessors"][0].update(type="VEC9"), "no valid GLB file"),
    "long view": (lambda h: h["bufferViews"][0].update(byteLength=10**9), "beyond its data"),
    "far view": (lambda h: h["bufferViews"][0].update(byteOffset=10**9), "beyond its data"),
    "long buffer": (lambda h: h["buffers"][0].update(byteLength=10**9), "bytes of data and has"),
    "other file": (lambda h: h["buffers"][0].update(uri="../../etc/passwd"), "in another file"),
    "other picture": (lambda h: h["images"].append({"uri": "x.png"}), "a picture in another file"),
    "compressed": (
        lambda h: h.update(extensionsRequired=["KHR_draco_mesh_compression"]),
        "compressed by KHR_draco_mesh_compression",
    ),
    "ring": (deep, "hold each other"),
    "copies": (copies, "vertices, more than"),
    "pyramid": (shared, "a node in two places"),
    "many nodes": (lambda h: h.update(nodes=[{}] * 200_000), "200000 nodes"),
    "no list": (lambda h: h.update(accessors=7), "no valid GLB file"),
}


@pytest.mark.parametrize("case", CASES)
def test_hostile_files_are_refused_in_a_sentence(
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


def test_a_torn_file_is_refused(tmp_path: Path) -> None:
    whole = glb_bytes(*glb([TRIANGLE]))
    with pytest.raises(ArchiveError, match="promises"):
        check_glb(written(tmp_path, whole[:-40]))
