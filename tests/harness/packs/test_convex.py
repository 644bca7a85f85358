"""Convex pieces of meshes, and hollow things that are filled by their hull, task by task."""

from pathlib import Path

import numpy as np
import pytest
from made_archive import READS_MESHES, make_archive
from mesh_writers import Piece, hollow_staves, merged, volume, write_glb

from robospa.harness.packs import convex
from robospa.harness.packs.archive import ArchiveError, open_archive
from robospa.harness.packs.convex import CORNERS, connected_parts, convex_pieces
from robospa.harness.packs.mesh_files import RawMesh, read_shapes
from robospa.harness.packs.official import index
from robospa.harness.packs.visuals import shaded, thinned
from robospa.tasks.objects import meshes as m
from robospa.tasks.shapes import Mesh

pytestmark = READS_MESHES
Arrays = tuple[np.ndarray, np.ndarray]


def arrays(mesh: Mesh) -> Arrays:
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces)


BOX = arrays(m.box_mesh((0.5, 0.5, 0.5)))


def test_each_mesh_is_one_piece_and_its_parts_only_where_they_are_asked_for() -> None:
    apart = arrays(m.merge(m.box_mesh((1, 1, 1)), m.box_mesh((1, 1, 1), (4.0, 0.0, 0.0))))
    (whole,) = convex_pieces([apart])
    assert volume(*whole) == pytest.approx(2 * 2 * 6)
    pieces = convex_pieces(connected_parts(*apart))
    assert [volume(*piece) for piece in pieces] == pytest.approx([8.0, 8.0])


def test_faces_that_only_share_places_are_one_piece() -> None:
    vertices, faces = BOX
    loose = vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    (piece,) = convex_pieces(connected_parts(*loose))
    assert len(piece[0]) == 8 and volume(*piece) == pytest.approx(1.0)


def test_a_fine_mesh_keeps_its_size_with_few_corners() -> None:
    ball = arrays(m.lathe([(np.sin(a), -np.cos(a)) for a in np.linspace(0, np.pi, 60)], 80))
    ((corners, triangles),) = convex_pieces([ball])
    assert len(corners) <= CORNERS
    assert np.ptp(corners, axis=0) == pytest.approx([2, 2, 2], abs=0.02)
    assert 0.75 < volume(corners, triangles) / (4 / 3 * np.pi) < 1


def test_a_sheet_gets_a_thickness_and_nothing_is_refused() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    sheet = square, np.array([[0, 1, 2], [0, 2, 3]])
    ((corners, _),) = convex_pieces([sheet])
    assert np.ptp(corners[:, 2]) == pytest.approx(1e-3)
    line = np.zeros((3, 3)), np.array([[0, 1, 2]])
    with pytest.raises(ArchiveError, match="no part with a volume"):
        convex_pieces([line])


def textured(mesh: Arrays) -> RawMesh:
    """The mesh with a picture whose left half is its lower part."""
    vertices, faces = mesh
    uv = np.stack([(vertices[:, 2] > 0) * 0.5 + 0.25, np.full(len(vertices), 0.5)], axis=1)
    return RawMesh(vertices, faces, uv, np.zeros((4, 4, 4), dtype=np.uint8))


def test_a_thinned_mesh_keeps_its_place_and_outside() -> None:
    ball = textured(
        arrays(m.lathe([(np.sin(a), -np.cos(a)) for a in np.linspace(0, np.pi, 80)], 80))
    )
    thin = thinned(ball, 1000)
    assert 400 < len(thin.faces) <= 1000 < len(ball.faces)
    assert np.ptp(thin.vertices, axis=0) == pytest.approx([2, 2, 2], abs=0.1)
    assert volume(thin.vertices, thin.faces) == pytest.approx(4 / 3 * np.pi, rel=0.08)


def test_normals_are_sharp_at_edges_and_smooth_where_it_is_round() -> None:
    _, normals, _, triangles = shaded(textured(BOX))
    assert np.abs(normals).max(axis=1) == pytest.approx(np.ones(len(normals)))
    assert len(triangles) == 12
    tube = textured(arrays(m.lathe([(1.0, -1.0), (1.0, 1.0)], 40, caps=False)))
    vertices, normals, _, _ = shaded(tube)
    assert (vertices[:, :2] * normals[:, :2]).sum(axis=1) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("height", [0.1, 0.02])
def test_depth_is_that_of_the_floor(height: float) -> None:
    """Of staves about y, their floor a tenth of their height thick."""
    staves = hollow_staves(0.05, 0.04, height, 12)
    for meshes, share in ((staves, 0.9), ([merged(staves)], 0.0)):
        pieces = convex_pieces([(vertices[:, [1, 2, 0]], faces) for vertices, faces in meshes])
        assert convex.depth(pieces) == pytest.approx(share, abs=0.01)


def test_a_model_in_one_node_is_filled_and_named_with_its_tasks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "cache"))
    hollow = ("bowl", "bread_basket", "cup", "dustbin", "mug", "table_trash_bin")
    root = make_archive(tmp_path / "assets", hollow)
    found = index(open_archive(root))
    assert not found.filled and not found.filled_text()
    path = root / "objects" / "011_dustbin" / "collision" / "base0.glb"
    write_glb(path, [Piece(*merged(read_shapes(path, lambda file: file)))], textured=False)
    found = index(open_archive(root))
    tasks = {"Put_Bottles_Dustbin", "Place_Bottle_Cup", "Place_Phone_Press_Stapler"}
    assert {*found.filled} == tasks
    assert {*found.filled.values()} == {("011_dustbin/base0",)}
    assert "Put_Bottles_Dustbin (011_dustbin)" in found.filled_text()
