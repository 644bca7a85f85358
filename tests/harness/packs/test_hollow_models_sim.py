"""Hollow models of an archive are as hollow as officially: what is dropped into a bin ends on its
floor, and pieces are those that SAPIEN's own reader makes."""

from pathlib import Path

import numpy as np
import pytest
from made_archive import READS_MESHES, SCALE, make_archive, official_pack_in
from mesh_writers import Piece, glb, glb_bytes, hollow_staves, merged, write_glb, write_obj
from sapien import physx

from robospa.geometry import Pose
from robospa.harness.packs.convex import convex_pieces
from robospa.harness.packs.mesh_files import read_shapes
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.tasks.objects import object_model
from robospa.tasks.official import official_model, official_size
from robospa.tasks.scene import Scene, SceneObject
from robospa.workcell import TABLE_TOP

pytestmark = [pytest.mark.sim, READS_MESHES]

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
    shapes = physx.PhysxCollisionShapeConvexMesh.load_multiple(
        str(path), np.full(3, SCALE), physx.PhysxMaterial(0.5, 0.5, 0.0)
    )
    return sorted(len(shape.vertices) for shape in shapes)


@pytest.mark.parametrize("hollow", [True, False])
def test_what_is_dropped_into_a_hollow_model_ends_inside(
    hollow: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same staves in a node each, and in one, where the official reader fills them too."""
    root = make_archive(tmp_path / "assets", [BIN])
    path, pieces, height = staves_of_bin()
    joined = Piece(*merged([(piece.vertices, piece.faces) for piece in pieces]))
    write_glb(root / path, pieces if hollow else [joined], textured=False)
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
def test_pieces_are_those_of_the_official_reader(kind: str, tmp_path: Path) -> None:
    staves = hollow_staves(0.05, 0.04, 0.1, 8)
    pieces = [Piece(*stave, (40 * (k % 2), 0, 0)) for k, stave in enumerate(staves)]
    path = tmp_path / kind
    if kind == "materials.glb":
        several_materials(path)
    elif kind == "nodes.glb":
        write_glb(path, pieces)
    else:
        write_obj(path, pieces if kind == "objects.obj" else [Piece(*merged(staves))])
    shapes = read_shapes(path, lambda path: path)
    made = [len(corners) for corners, _ in convex_pieces(shapes)]
    assert sorted(made) == of_sapien(path)
