"""Bins, baskets, bowls and cups that are filled by their hull are named, task by task."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_archive import make_archive
from mesh_writers import Piece, hollow_staves, merged, write_glb
from pack_fixtures import READS_MESHES

from robospa.harness.packs import convex
from robospa.harness.packs.archive import open_archive
from robospa.harness.packs.convex import convex_pieces
from robospa.harness.packs.index import index
from robospa.harness.packs.mesh_files import read_shapes
from robospa.tasks.official import official_assets, official_models

pytestmark = READS_MESHES
HOLLOW = ("bowl", "bread_basket", "cup", "dustbin", "mug", "table_trash_bin")


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_archive(tmp_path_factory.mktemp("assets"), HOLLOW)


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "cache"))


def test_what_should_be_hollow_is_listed() -> None:
    found = {a for a in official_assets() for model in official_models(a) if model.hollow}
    assert found == {*HOLLOW}


@pytest.mark.parametrize(("height", "share"), [(0.1, 0.9), (0.02, 0.9)])
def test_depth_is_that_of_the_floor(height: float, share: float) -> None:
    """Of staves about y, their floor a tenth of their height thick."""
    staves = hollow_staves(0.05, 0.04, height, 12)
    pieces = convex_pieces([(vertices[:, [1, 2, 0]], faces) for vertices, faces in staves])
    assert convex.depth(pieces) == pytest.approx(share, abs=0.01)
    vertices, faces = merged(staves)
    assert convex.depth(convex_pieces([(vertices[:, [1, 2, 0]], faces)])) < 0.01


def test_models_in_pieces_are_hollow(root: Path) -> None:
    found = index(open_archive(root))
    assert not found.filled and not found.filled_text()


def test_a_model_in_one_node_is_named_with_its_tasks(root: Path) -> None:
    path = root / "objects" / "011_dustbin" / "collision" / "base0.glb"
    whole = path.read_bytes()
    write_glb(path, [Piece(*merged(read_shapes(path, lambda file: file)))], textured=False)
    try:
        found = index(open_archive(root))
        assert {*found.filled} == {
            "Put_Bottles_Dustbin", "Place_Bottle_Cup", "Place_Phone_Press_Stapler"
        }  # fmt: skip
        assert {*found.filled.values()} == {("011_dustbin/base0",)}
        assert "in 3 tasks: Put_Bottles_Dustbin (011_dustbin); " in found.filled_text()
    finally:
        path.write_bytes(whole)


def test_without_the_library_nothing_is_said(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(convex, "reads_meshes", lambda: False)
    monkeypatch.setattr(convex, "colliding_pieces", None)
    assert not index(open_archive(root)).filled
