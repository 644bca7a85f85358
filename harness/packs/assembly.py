"""The files of a model as arrays in the cache: what is drawn and what collides, of each body.

A rigid model is one body; one with a door is two. Arrays are in the archive's frame, unscaled, so
that an entry depends on nothing but the files.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.harness.packs import cache
from robospa.harness.packs.archive import Archive, ArchiveError, ModelFiles
from robospa.harness.packs.decimate import TRIANGLES, shaded, thinned
from robospa.harness.packs.mesh_files import (
    LARGE_PICTURE,
    PICTURE,
    RawMesh,
    read_mesh,
    read_shapes,
)
from robospa.harness.packs.pieces import connected_parts, convex_pieces
from robospa.harness.packs.urdf import Joint, MeshUse, Robot, check_files, read_urdf

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Piece = tuple[Floats, Ints]


@dataclass(frozen=True)
class Body:
    """`skin` is a file as `robospa.tasks.shapes.Skin` wants it, `box` (2, 3) the corners around
    all of it; `pieces` are convex."""

    skin: Path
    box: Floats
    pieces: tuple[Piece, ...]


@dataclass(frozen=True)
class Parts:
    """The bodies of a model: `door` turns about `joint`. `links` are the links' frames (4, 4) in
    the root's by their names; a rigid model has none."""

    body: Body
    door: Body | None = None
    joint: Joint | None = None
    links: Mapping[str, Floats] = field(default_factory=dict)


def parts_of(archive: Archive, files: ModelFiles, hinge: bool, what: str) -> Parts:
    """Read the model's files, or what was made of them before. ArchiveError, naming `what`."""
    if files.urdf is None:
        assert files.visual is not None and files.collision is not None
        drawn, solid = (MeshUse(file, np.eye(4)) for file in (files.visual, files.collision))
        return Parts(_body(archive, [drawn], [solid]))
    robot = read_urdf(files.urdf, archive.inside)
    joint = door_joint(robot, what) if hinge else None
    moved = robot.moved_by(joint.child) if joint is not None else frozenset()
    body = _of_links(archive, robot, [link for link in robot.visuals if link not in moved], what)
    links = {link: robot.in_root(link) for link in robot.visuals}
    door = None if joint is None else _of_links(archive, robot, sorted(moved), what)
    return Parts(body, door, joint, links)


def door_joint(robot: Robot, what: str) -> Joint:
    """The joint that turns most of the model's meshes: its door. ArchiveError if none turns."""
    turning = [j for j in robot.joints.values() if j.kind in ("revolute", "continuous")]
    with_limits = [j for j in turning if j.limits[0] < j.limits[1]]
    if not with_limits:
        raise ArchiveError(f"{what} has no joint that turns, which its door needs")

    def size(joint: Joint) -> int:
        files = (use.file for link in robot.moved_by(joint.child) for use in robot.visuals[link])
        return sum(file.stat().st_size for file in files if file.is_file())

    return max(with_limits, key=size)


def _of_links(
    archive: Archive, robot: Robot, links: Sequence[str], what: str, whole: bool = False
) -> Body:
    """Links of a URDF file as one body in the root's frame, all joints at 0."""

    def uses(of: dict[str, tuple[MeshUse, ...]]) -> list[MeshUse]:
        return [
            MeshUse(use.file, robot.in_root(link) @ use.transform)
            for link in links
            for use in of[link]
        ]

    drawn, solid = uses(dict(robot.visuals)), uses(dict(robot.collisions))
    if not drawn and not solid:
        raise ArchiveError(f"{what} has no meshes where its parts should be")
    return _body(archive, drawn or solid, solid or drawn, whole)


def hull_of(archive: Archive, robot: Robot, what: str) -> Body:
    """A URDF file as one body that collides as a hull around each of its meshes."""
    return _of_links(archive, robot, list(robot.visuals), what, whole=True)


def _body(
    archive: Archive, drawn: Sequence[MeshUse], solid: Sequence[MeshUse], whole: bool = False
) -> Body:
    skin = skin_of(archive, drawn)
    return Body(skin, cache.load(skin, "box")["box"], solid_pieces(archive, solid, whole))


def solid_pieces(
    archive: Archive, solid: Sequence[MeshUse], whole: bool = False
) -> tuple[Piece, ...]:
    """What collides of the meshes: their convex pieces, or one hull around each if `whole`."""
    files = _files(solid)
    how = f"{'hulls' if whole else 'pieces'} {_transforms(solid)}"
    entry = cache.kept(files, how, lambda: _packed(archive, solid, whole))
    arrays = cache.load(entry)
    corners = np.split(arrays["corners"], np.cumsum(arrays["corner_counts"])[:-1])
    triangles = np.split(arrays["triangles"], np.cumsum(arrays["triangle_counts"])[:-1])
    return tuple(zip(corners, triangles, strict=True))


def skin_of(archive: Archive, drawn: Sequence[MeshUse], full: bool = False) -> Path:
    """The meshes as one to draw; with every triangle and a large picture if `full`."""
    files = _files(drawn)
    how = f"{'full' if full else 'thin'} skin {_transforms(drawn)}"
    return cache.kept(files, how, lambda: _skin(archive, drawn, full))


def _files(uses: Sequence[MeshUse]) -> tuple[Path, ...]:
    files = tuple(use.file for use in uses)
    check_files(files)
    return files


def _transforms(uses: Sequence[MeshUse]) -> str:
    return " ".join(np.array2string(use.transform.ravel(), precision=9) for use in uses)


def _skin(archive: Archive, drawn: Sequence[MeshUse], full: bool) -> cache.Arrays:
    side = LARGE_PICTURE if full else PICTURE
    meshes = [(use, read_mesh(use.file, archive.inside, side)) for use in drawn]
    joined = joined_meshes([_moved(mesh, use.transform) for use, mesh in meshes], side)
    chosen = joined if full else thinned(joined, TRIANGLES)
    vertices, normals, uvs, triangles = shaded(chosen)
    return {
        "vertices": vertices.astype(np.float32),
        "normals": normals.astype(np.float32),
        "uvs": uvs.astype(np.float32),
        "triangles": triangles.astype(np.uint32),
        "picture": chosen.picture,
        "box": np.stack([joined.vertices.min(axis=0), joined.vertices.max(axis=0)]),
    }


def _moved(mesh: RawMesh, transform: Floats) -> RawMesh:
    points = mesh.vertices @ transform[:3, :3].T + transform[:3, 3]
    inverted = np.linalg.det(transform[:3, :3]) < 0
    return RawMesh(points, mesh.faces[:, ::-1] if inverted else mesh.faces, mesh.uv, mesh.picture)


def joined_meshes(meshes: Sequence[RawMesh], side: int) -> RawMesh:
    """Several meshes as one, their pictures side by side in one of about `side` pixels."""
    if len(meshes) == 1:
        return meshes[0]
    grid = int(np.ceil(np.sqrt(len(meshes))))
    tile = max(4, side // grid)
    picture = np.full((grid * tile, grid * tile, 4), 255, dtype=np.uint8)
    vertices, faces, uvs, count = [], [], [], 0
    for k, mesh in enumerate(meshes):
        row, column = divmod(k, grid)
        rows = (np.arange(tile) * len(mesh.picture)) // tile
        small = mesh.picture[rows][:, rows]
        picture[row * tile : (row + 1) * tile, column * tile : (column + 1) * tile] = small
        corner = np.array([column, row])
        uvs.append((np.clip(mesh.uv, 0.5 / tile, 1 - 0.5 / tile) + corner) / grid)
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + count)
        count += len(mesh.vertices)
    return RawMesh(np.concatenate(vertices), np.concatenate(faces), np.concatenate(uvs), picture)


def _packed(archive: Archive, solid: Sequence[MeshUse], whole: bool) -> cache.Arrays:
    """Convex pieces of all meshes, end to end, and how long each is; one of each if `whole`."""
    pieces: list[Piece] = []
    for use in solid:
        turn, shift = use.transform[:3, :3].T, use.transform[:3, 3]
        shapes = read_shapes(use.file, archive.inside)
        if whole:
            shapes = [_joined(shapes)]
        elif use.file.suffix.lower() in (".stl", ".ply"):
            shapes = [part for shape in shapes for part in connected_parts(*shape)]
        shapes = [(v @ turn + shift, f) for v, f in shapes]
        try:
            pieces += convex_pieces(shapes)
        except ArchiveError as error:
            raise ArchiveError(f"{str(use.file)!r} {error}") from None
    return {
        "corners": np.concatenate([corners for corners, _ in pieces]),
        "corner_counts": np.array([len(corners) for corners, _ in pieces]),
        "triangles": np.concatenate([triangles for _, triangles in pieces]),
        "triangle_counts": np.array([len(triangles) for _, triangles in pieces]),
    }


def _joined(shapes: Sequence[Piece]) -> Piece:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
    faces = [faces + start for (_, faces), start in zip(shapes, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in shapes]), np.concatenate(faces)
