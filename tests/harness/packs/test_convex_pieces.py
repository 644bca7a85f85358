"""Meshes as convex pieces, and meshes with fewer triangles."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.harness.packs.archive import ArchiveError
from robospa.harness.packs.convex import CORNERS, connected_parts, convex_pieces
from robospa.harness.packs.mesh_files import RawMesh
from robospa.harness.packs.visuals import shaded, thinned
from robospa.tasks.objects import meshes as m
from robospa.tasks.shapes import Mesh

Arrays = tuple[np.ndarray, np.ndarray]


def arrays(mesh: Mesh) -> Arrays:
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces)


def volume(piece: Arrays) -> float:
    vertices, faces = piece
    return m.volume(Mesh(tuple(map(tuple, vertices.tolist())), tuple(map(tuple, faces.tolist()))))


BOX = arrays(m.box_mesh((0.5, 0.5, 0.5)))
BEYOND = arrays(m.box_mesh((0.5, 0.5, 0.5), (1.0, 0.0, 0.0)))


def test_each_mesh_is_one_piece_and_its_parts_only_where_they_are_asked_for() -> None:
    apart = arrays(m.merge(m.box_mesh((1, 1, 1)), m.box_mesh((1, 1, 1), (4.0, 0.0, 0.0))))
    (whole,) = convex_pieces([apart])
    assert volume(whole) == pytest.approx(2 * 2 * 6)
    pieces = convex_pieces(connected_parts(*apart))
    assert [volume(piece) for piece in pieces] == pytest.approx([8.0, 8.0])


def test_meshes_that_touch_stay_two_pieces() -> None:
    assert [volume(p) for p in convex_pieces([BOX, BEYOND])] == pytest.approx([1.0, 1.0])


def test_faces_that_only_share_places_are_one_piece() -> None:
    vertices, faces = BOX
    loose = vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    (piece,) = convex_pieces(connected_parts(*loose))
    assert len(piece[0]) == 8 and volume(piece) == pytest.approx(1.0)


def test_a_fine_mesh_keeps_its_size_with_few_corners() -> None:
    ball = arrays(m.lathe([(np.sin(a), -np.cos(a)) for a in np.linspace(0, np.pi, 60)], 80))
    ((corners, triangles),) = convex_pieces([ball])
    assert len(corners) <= CORNERS
    assert np.ptp(corners, axis=0) == pytest.approx([2, 2, 2], abs=0.02)
    assert 0.75 < volume((corners, triangles)) / (4 / 3 * np.pi) < 1


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
    assert volume((thin.vertices, thin.faces)) == pytest.approx(4 / 3 * np.pi, rel=0.08)


def test_a_small_mesh_is_left_as_it_is() -> None:
    thin = thinned(textured(BOX), 1000)
    assert len(thin.faces) == len(BOX[1])
    assert volume((thin.vertices, thin.faces)) == pytest.approx(1.0)


def test_normals_are_sharp_at_edges_and_smooth_where_it_is_round() -> None:
    _, normals, _, triangles = shaded(textured(BOX))
    assert np.abs(normals).max(axis=1) == pytest.approx(np.ones(len(normals)))
    assert len(triangles) == 12
    tube = textured(arrays(m.lathe([(1.0, -1.0), (1.0, 1.0)], 40, caps=False)))
    vertices, normals, _, _ = shaded(tube)
    assert (vertices[:, :2] * normals[:, :2]).sum(axis=1) == pytest.approx(1, abs=1e-3)
