"""Meshes as convex pieces to collide with, one for each, as officially.

SAPIEN, which the official code loads them with, gives each node of a GLB or OBJ file one convex
shape around all of it, and each connected part of an STL or PLY file. Pieces of different nodes
stay apart even where they touch: a bowl that was cut into them is hollow, one in a single node is
filled, here as in SAPIEN: nothing can be put into it then, and no finger reaches into it to take it
at its rim. Pieces keep at most `CORNERS` corners: those farthest in evenly spread directions.
"""

from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np

from robospa.geometry import Pose, from_matrix, vec3
from robospa.harness.packs import mesh_files
from robospa.harness.packs.archive import Archive, ArchiveError, Arrays, cached, load_arrays
from robospa.harness.packs.mesh_files import Floats, Ints, Piece
from robospa.harness.packs.urdf import MeshUse, key_of
from robospa.tasks.official import OfficialModel
from robospa.tasks.shapes import Box, Mesh, Shape

CORNERS = 48
MOST_PIECES = 64
"""Only the largest are kept."""
FLAT = 1e-3
"""A part thinner than this share of the mesh is thickened by it, for nothing can collide with a
sheet."""


def convex_pieces(meshes: Sequence[Piece]) -> list[Piece]:
    """Corners (C, 3) and outward triangles (T, 3) of each piece, largest first. `meshes` are
    vertices (V, 3) and faces (F, 3). ArchiveError if nothing of them has a volume."""
    from scipy.spatial import ConvexHull, QhullError

    span = float(np.ptp(np.concatenate([points for points, _ in meshes]), axis=0).max())
    found = []
    for vertices, faces in meshes:
        points = np.unique(vertices[np.unique(faces)], axis=0)
        if len(points) < 3:
            continue
        corners = _corners(points, span)
        try:
            hull = ConvexHull(corners)
        except QhullError:
            continue
        used = np.unique(hull.simplices)
        number = np.zeros(len(corners), dtype=np.int64)
        number[used] = np.arange(len(used))
        triangles = _outwards(corners, hull.simplices, hull.equations[:, :3])
        found.append((float(hull.volume), corners[used], number[triangles]))
    if not found:
        raise ArchiveError("holds no part with a volume, so nothing can collide with it")
    found.sort(key=lambda piece: -piece[0])
    return [(corners, triangles) for _, corners, triangles in found[:MOST_PIECES]]


def connected_parts(vertices: Floats, faces: Ints) -> list[Piece]:
    """The mesh as its connected parts; vertices at the same place are connected."""
    span = max(float(np.ptp(vertices, axis=0).max()), 1e-12)
    _, first, index = np.unique(
        np.round(vertices / span, 6), axis=0, return_index=True, return_inverse=True
    )
    places, faces = vertices[first], index.ravel()[faces]
    label = mesh_files.connected(faces, len(places))
    return [(places, faces[label[faces[:, 0]] == part]) for part in range(label.max() + 1)]


def _directions(count: int) -> Floats:
    """(count, 3) unit vectors, evenly spread, and those along the axes."""
    i = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * i / count), np.pi * (1 + 5**0.5) * i
    spread = np.stack(
        [np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], axis=1
    )
    found: Floats = np.concatenate([np.eye(3), -np.eye(3), spread])
    return found


def _corners(points: Floats, span: float) -> Floats:
    """The points that lie farthest in some direction, at most `CORNERS`; a sheet thickened."""
    middle = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(middle, full_matrices=False)
    thin = axes[-1]
    if np.ptp(middle @ thin) < FLAT * span:
        points = np.concatenate([points - thin * FLAT * span / 2, points + thin * FLAT * span / 2])
    if len(points) <= CORNERS:
        return points
    far = np.unique(np.argmax(points @ _directions(CORNERS - 6).T, axis=0))
    chosen: Floats = points[far]
    return chosen


def _outwards(corners: Floats, triangles: Ints, normals: Floats) -> Ints:
    """Triangles whose corners run counter-clockwise seen from outside."""
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    inwards = (np.cross(b - a, c - a) * normals).sum(axis=1) < 0
    turned = np.asarray(triangles, dtype=np.int64).copy()
    turned[inwards] = turned[inwards][:, ::-1]
    return turned


def planes(corners: Floats, triangles: Ints) -> tuple[Floats, Floats]:
    """Unit normals (T, 3) outwards and offsets (T,) [m] of a convex piece's faces."""
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-15)[:, None]
    return normals, (normals * a).sum(axis=1)


def colliding_pieces(
    archive: Archive, solid: Sequence[MeshUse], whole: bool = False
) -> tuple[Piece, ...]:
    """What collides of the meshes: their convex pieces, or one hull around each if `whole`."""
    files, where = key_of(solid)
    how = f"{'hulls' if whole else 'pieces'} {where}"
    arrays = load_arrays(cached(files, how, lambda: _packed(archive, solid, whole)))
    corners = np.split(arrays["corners"], np.cumsum(arrays["corner_counts"])[:-1])
    triangles = np.split(arrays["triangles"], np.cumsum(arrays["triangle_counts"])[:-1])
    return tuple(zip(corners, triangles, strict=True))


def _packed(archive: Archive, solid: Sequence[MeshUse], whole: bool) -> Arrays:
    """Convex pieces of all meshes, end to end, and how long each is; one of each if `whole`."""
    pieces: list[Piece] = []
    for use in solid:
        turn, shift = use.transform[:3, :3].T, use.transform[:3, 3]
        shapes = mesh_files.read_shapes(use.file, archive.inside)
        if whole:
            shapes = [mesh_files.joined(shapes)]
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


SQUARE = 1e-3
"""Cosine below which two faces of a box meet at right angles."""


def convex_shapes(pieces: Sequence[Piece]) -> tuple[Shape, ...]:
    """The pieces [m] as shapes: boxes where they are some, which cost least."""
    return tuple(_shape(*piece) for piece in pieces)


def _shape(corners: Floats, triangles: Ints) -> Shape:
    normals, _ = planes(corners, triangles)
    axes = [normals[0]]
    for normal in normals:
        if all(abs(normal @ axis) < SQUARE for axis in axes):
            axes.append(normal)
    straight = len(axes) == 3 and (np.abs(normals @ np.array(axes).T).max(axis=1) > 1 - 1e-6).all()
    if len(corners) != 8 or not straight:
        vertices = tuple((x, y, z) for x, y, z in corners.tolist())
        faces = tuple((i, j, k) for i, j, k in triangles.tolist())
        return Shape(Mesh(vertices, faces), visual=False)
    turn = np.array([axes[0], axes[1], np.cross(axes[0], axes[1])]).T
    along = corners @ turn
    middle, half = (along.max(axis=0) + along.min(axis=0)) / 2, np.ptp(along, axis=0) / 2
    pose = Pose(vec3(turn @ middle), from_matrix(turn))
    return Shape(Box(vec3(half)), pose, visual=False)


SHALLOW = 0.25
"""A hollow no deeper than this share of the height is filled; those of our bowls have 0.6."""
MIDDLE = (0.4, 0.5, 0.6)
"""Shares of the footprint, along each side, at which depth is measured: inside a mug, whichever
side its handle is on."""
LEVEL = 1e-9
"""A face whose unit normal rises less than this is upright."""
Y = 1
"""The archive's axis that points up (not of models that lie)."""


def is_filled(archive: Archive, model: OfficialModel) -> bool:
    """Whether `model` should be hollow and its collision pieces, which are read or taken from the
    cache, close its mouth; False where meshes cannot be read, because trimesh is not installed.
    ArchiveError, in one sentence, for a file that cannot be used."""
    if not model.hollow or find_spec("trimesh") is None:
        return False
    collision = archive.files(model).collision
    if collision is None:
        return False
    return depth(colliding_pieces(archive, [MeshUse(collision, np.eye(4))])) <= SHALLOW


def depth(pieces: Sequence[Piece]) -> float:
    """How far the deepest place of the middle lies below the top, as a share of the height."""
    points = np.concatenate([corners for corners, _ in pieces])
    low, high = points.min(axis=0), points.max(axis=0)
    height = max(float(high[Y] - low[Y]), 1e-12)
    places = low + (high - low) * np.array([[a, 0.0, b] for a in MIDDLE for b in MIDDLE])
    tops = np.full(len(places), float(low[Y]))
    for corners, triangles in pieces:
        tops = np.maximum(tops, _tops(corners, triangles, places))
    return (float(high[Y]) - float(tops.min())) / height


def _tops(corners: Floats, triangles: Ints, places: Floats) -> Floats:
    """(P,) height at which vertical lines through `places` (P, 3) leave a convex piece whose
    triangles face outwards; minus infinity where they miss it."""
    normals, offsets = planes(corners, triangles)
    rise = normals[:, Y]
    room = offsets - places @ normals.T + np.outer(places[:, Y], rise)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = room / rise
    upper = np.where(rise > LEVEL, at, np.inf).min(axis=1)
    lower = np.where(rise < -LEVEL, at, -np.inf).max(axis=1)
    beside = ((np.abs(rise) <= LEVEL) & (room < 0)).any(axis=1)
    return np.where(beside | (lower >= upper) | np.isinf(upper), -np.inf, upper)
