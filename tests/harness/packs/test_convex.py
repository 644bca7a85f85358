"""Convex pieces of meshes, and hollow things that are filled by their hull, task by task."""

from pathlib import Path

import numpy as np
import pytest
from made_archive import READS_MESHES, SCALE, make_archive, official_pack_in
from mesh_writers import Piece, glb, glb_bytes, hollow_staves, volume, write_glb, write_obj

from robospa.geometry import Pose
from robospa.harness.packs import convex
from robospa.harness.packs.archive import ArchiveError, open_archive
from robospa.harness.packs.convex import CORNERS, connected_parts, convex_pieces
from robospa.harness.packs.mesh_files import RawMesh, joined, read_shapes
from robospa.harness.packs.official import index
from robospa.harness.packs.visuals import shaded, thinned
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects import object_model
from robospa.tasks.official import official_model, official_size
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.shapes import Mesh
from robospa.workcell import TABLE_TOP

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
    for meshes, share in ((staves, 0.9), ([joined(staves)], 0.0)):
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
    write_glb(path, [Piece(*joined(read_shapes(path, lambda file: file)))], textured=False)
    found = index(open_archive(root))
    tasks = {"Put_Bottles_Dustbin", "Place_Bottle_Cup", "Place_Phone_Press_Stapler"}
    assert {*found.filled} == tasks
    assert {*found.filled.values()} == {("011_dustbin/base0",)}
    assert "Put_Bottles_Dustbin (011_dustbin)" in found.filled_text()


# ------------------------------------ in the simulator what is dropped into a bin ends on its floor


BIN = "table_trash_bin"


def staves_of_bin() -> tuple[Path, list[Piece], float]:
    """Where the bin's collision file of look 0 is in an archive, pieces for it, and the height of
    the rim [m]."""
    model = official_model(BIN, 0)
    assert model is not None
    size = official_size(model)
    assert size is not None
    across, height = size.size[0] / 2, size.size[1]
    up = np.array([0.0, size.centre[1] - height / 2, 0.0])
    staves = hollow_staves(0.9 * across, 0.75 * across, height, 12)
    pieces = [Piece((vertices[:, [1, 2, 0]] + up) / SCALE, faces) for vertices, faces in staves]
    path = Path("objects", model.folder, "collision", f"base{model.model}.glb")
    return path, pieces, height


def of_sapien(path: Path) -> list[int]:
    """How many corners each shape has that SAPIEN makes of a file, as the official code does."""
    from sapien import physx

    shapes = physx.PhysxCollisionShapeConvexMesh.load_multiple(
        str(path), np.full(3, SCALE), physx.PhysxMaterial(0.5, 0.5, 0.0)
    )
    return sorted(len(shape.vertices) for shape in shapes)


@pytest.mark.parametrize("hollow", [True, False])
@pytest.mark.sim
def test_what_is_dropped_into_a_hollow_model_ends_inside(
    hollow: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same staves in a node each, and in one, where the official reader fills them too."""
    root = make_archive(tmp_path / "assets", [BIN])
    path, pieces, height = staves_of_bin()
    whole = Piece(*joined([(piece.vertices, piece.faces) for piece in pieces]))
    write_glb(root / path, pieces if hollow else [whole], textured=False)
    look = {"look": 0, "pack": "official"}
    block = {"half": [0.01] * 3, "color": [1.0, 0.0, 0.0]}
    objects = (
        SceneObject("bin", BIN, Pose((0.0, 0.0, TABLE_TOP)), look, fixed=True),
        SceneObject("block", "block", Pose((0.0, 0.0, TABLE_TOP + height + 0.02)), block),
    )
    scene = Scene("Test", 1, 100_000, "aloha-agilex", "clean", objects, {})
    with official_pack_in(root, tmp_path / "cache", monkeypatch):
        ours = sum(shape.collision for shape in object_model(BIN, look).shapes)
        assert len(of_sapien(root / path)) == ours == (13 if hollow else 1)
        world = SapienWorld(render=False)
        world.load(scene)
        x, y, z = world.snapshot().poses["block"].position
    assert np.hypot(x, y) < 0.03
    floor = height / 10 if hollow else height
    assert z == pytest.approx(TABLE_TOP + floor + 0.01, abs=0.002)


def several_materials(path: Path) -> None:
    """Two nodes, of which the first has two materials."""
    pieces = [Piece(*one) for one in hollow_staves(0.05, 0.04, 0.1, 8)[:3]]
    header, data = glb(pieces, textured=False)
    header["meshes"][0]["primitives"] += header["meshes"][1]["primitives"]
    header["nodes"], header["scenes"] = [{"mesh": 0}, {"mesh": 2}], [{"nodes": [0, 1]}]
    path.write_bytes(glb_bytes(header, data))


@pytest.mark.parametrize("kind", ["nodes.glb", "materials.glb", "objects.obj", "one.obj"])
@pytest.mark.sim
def test_pieces_are_those_of_the_official_reader(kind: str, tmp_path: Path) -> None:
    staves = hollow_staves(0.05, 0.04, 0.1, 8)
    pieces = [Piece(*stave, (40 * (k % 2), 0, 0)) for k, stave in enumerate(staves)]
    path = tmp_path / kind
    if kind == "materials.glb":
        several_materials(path)
    elif kind == "nodes.glb":
        write_glb(path, pieces)
    else:
        write_obj(path, pieces if kind == "objects.obj" else [Piece(*joined(staves))])
    shapes = read_shapes(path, lambda path: path)
    made = [len(corners) for corners, _ in convex_pieces(shapes)]
    assert sorted(made) == of_sapien(path)
