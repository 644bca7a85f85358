"""A mesh file of the archive as arrays: triangles with their places in one picture.

Reads GLB, OBJ, STL and PLY through trimesh. What a file draws with several materials becomes one
mesh with one picture, because on a CPU each drawn thing of its own costs as much as a thousand
vertices. Of a GLB file every count, length and reference is first held against the file's own size,
so that reading it allocates no more than a small multiple of that; files that point elsewhere are
not followed.
"""

from __future__ import annotations

import io
import json
import math
import re
import struct
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.extras import MissingPackage, need
from robospa.harness.packs.archive import ArchiveError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Piece = tuple[Floats, Ints]
"""Vertices (V, 3) and triangles (F, 3)."""
FORMATS = (".glb", ".obj", ".stl", ".ply")
PICTURE = 256
"""Pixels along a side of a mesh's picture: what is drawn of it is rarely larger than 100."""
LARGE_PICTURE = 1024
"""The same where nothing is to be thinned."""
LARGEST_PICTURE = 8192
"""Pixels along a side of a file's picture."""
PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tga", ".webp", ".tif", ".tiff")
MOST_TILES = 256
GREY = (0.8, 0.8, 0.8)
_MATERIAL = re.compile(rb"^(usemtl|mtllib)[^\n]*", re.MULTILINE)
"""What divides an object of an OBJ file by material."""


@dataclass(frozen=True)
class RawMesh:
    """`vertices` (V, 3) float64 in the file's frame and unit, `faces` (F, 3), `uv` (V, 2) from the
    upper left corner of `picture` (S, S, 4), sRGB uint8."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64]
    picture: NDArray[np.uint8]


def read_mesh(path: Path, inside: Callable[[Path], Path], side: int = PICTURE) -> RawMesh:
    """The mesh in `path`; `inside` refuses files that are not the archive's. ArchiveError, in one
    sentence, for a file that cannot be read or is too large."""
    parts = _parts(path, inside)
    textures = [_Texture.of(part.visual) for part in parts]
    looks = {texture.key: texture for texture in textures}
    if len(looks) > MOST_TILES:
        raise ArchiveError(f"{str(path)!r} has {len(looks)} materials, more than {MOST_TILES}")
    tile = _tile(side, len(looks))
    pictures = [texture.pixels(path, tile) for texture in looks.values()]
    cells = [list(looks).index(texture.key) for texture in textures]
    meshes = [
        (np.asarray(p.vertices, dtype=float), np.asarray(p.faces, dtype=np.int64), t.places(p))
        for p, t in zip(parts, textures, strict=True)
    ]
    return _tiled(meshes, cells, pictures)


def joined_meshes(meshes: Sequence[RawMesh], side: int) -> RawMesh:
    """Several meshes as one, their pictures side by side in one of about `side` pixels."""
    if len(meshes) == 1:
        return meshes[0]
    tile = _tile(side, len(meshes))
    places = [(np.arange(tile) * len(mesh.picture)) // tile for mesh in meshes]
    pictures = [mesh.picture[at][:, at] for mesh, at in zip(meshes, places, strict=True)]
    rows = [(mesh.vertices, mesh.faces, mesh.uv) for mesh in meshes]
    return _tiled(rows, range(len(meshes)), pictures)


def _tile(side: int, count: int) -> int:
    """Pixels along the side of each of `count` pictures in one of about `side`."""
    return max(4, side // math.ceil(math.sqrt(count)))


def _tiled(
    meshes: Sequence[tuple[Floats, Ints, Floats]],
    cells: Sequence[int],
    pictures: Sequence[NDArray[np.uint8]],
) -> RawMesh:
    """Meshes (vertices, faces, uv) as one; each has the picture of its cell, and all pictures, of
    one size, lie in a square."""
    grid, tile = math.ceil(math.sqrt(len(pictures))), len(pictures[0])
    picture = np.full((grid * tile, grid * tile, 4), 255, dtype=np.uint8)
    for index, part in enumerate(pictures):
        row, column = divmod(index, grid)
        picture[row * tile : (row + 1) * tile, column * tile : (column + 1) * tile] = part
    vertices, triangles = joined([(points, faces) for points, faces, _ in meshes])
    uvs = [
        (np.clip(uv, 0.5 / tile, 1 - 0.5 / tile) + np.array(divmod(cell, grid)[::-1])) / grid
        for (_, _, uv), cell in zip(meshes, cells, strict=True)
    ]
    return RawMesh(vertices, triangles, np.concatenate(uvs), picture)


def joined(pieces: Sequence[Piece]) -> Piece:
    """Several pieces as one."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    faces = [faces + start for (_, faces), start in zip(pieces, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in pieces]), np.concatenate(faces)


def read_shapes(path: Path, inside: Callable[[Path], Path]) -> list[Piece]:
    """Vertices (V, 3) and faces (F, 3) of each node in `path`, in the file's frame and unit: its
    materials, which are not read, do not divide it. ArchiveError as `read_mesh`."""
    return [
        (np.asarray(part.vertices, dtype=float), np.asarray(part.faces, dtype=np.int64))
        for part in _parts(path, inside, by_node=True)
    ]


def _parts(path: Path, inside: Callable[[Path], Path], by_node: bool = False) -> list[Any]:
    """The file's trimesh meshes, moved to where the file has them: one for each material, or
    `by_node` one for each node of a GLB file and each object of an OBJ file."""
    try:
        trimesh = need("trimesh")
    except MissingPackage as error:
        raise ArchiveError(f"official assets cannot be read: {error}") from error
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise ArchiveError(
            f"{str(path)!r} is no {', '.join(FORMATS)} file, and others are not read; convert it"
        )
    path = inside(path)
    if not path.is_file():
        raise ArchiveError(f"the mesh {str(path)!r} is missing; unpack the archive again")
    if kind == ".glb":
        for offset, length in check_glb(path):
            _check_picture(path, offset, length)
    _bounded(path)
    content = path.read_bytes()
    if by_node and kind == ".obj":
        content = _MATERIAL.sub(b"", content)
    resolver = _Inside(path.parent, inside)
    options = {".obj": {"split_objects": True}, ".glb": {"merge_primitives": by_node}}
    try:
        scene = trimesh.load_scene(
            io.BytesIO(content),
            file_type=kind[1:],
            resolver=resolver,
            process=False,
            **options.get(kind, {}),
        )
        parts = [part for part in scene.dump() if hasattr(part, "faces") and len(part.faces)]
    except ArchiveError:
        raise
    except Exception as error:  # whatever a reader of a broken file may stumble over
        text = " ".join(str(error).split())[:100] or type(error).__name__
        raise ArchiveError(f"{str(path)!r} cannot be read as a mesh: {text}") from error
    if resolver.trouble:  # which trimesh only notes
        raise ArchiveError(f"{str(path)!r} names a file that is not read: {resolver.trouble}")
    if not parts:
        raise ArchiveError(f"{str(path)!r} holds no triangles")
    for part in parts:
        points = np.asarray(part.vertices)
        if not np.isfinite(points).all() or np.abs(points).max() > 1e6:
            raise ArchiveError(f"{str(path)!r} has vertices at places that no object can have")
        if part.faces.min() < 0 or part.faces.max() >= len(points):
            raise ArchiveError(f"{str(path)!r} has triangles of vertices that do not exist")
    if sum(len(part.vertices) + len(part.faces) // 2 for part in parts) > 2 * MOST_VERTICES:
        raise ArchiveError(f"{str(path)!r} has more than {MOST_VERTICES} vertices")
    return parts


def _bounded(path: Path) -> int:
    """The file's bytes; ArchiveError if they are too many."""
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise ArchiveError(f"{str(path)!r} is larger than {LARGEST_FILE >> 20} MB")
    return size


def _check_picture(path: Path, offset: int, length: int) -> None:
    """ArchiveError for a picture in a file that nobody could unpack; reads its header alone."""
    from PIL import Image

    with path.open("rb") as file:
        file.seek(offset)
        head = io.BytesIO(file.read(length))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            width, height = Image.open(head).size
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise ArchiveError(f"{str(path)!r} has an unreadable picture: {error}") from error
    if max(width, height) > LARGEST_PICTURE:
        raise ArchiveError(
            f"{str(path)!r} has a picture of {width}x{height} pixels, more than "
            f"{LARGEST_PICTURE} along a side"
        )


class _Inside:
    """Gives trimesh the files that a mesh names, such as pictures, if they are the archive's.
    `trouble` is why one was refused; one that is not there leaves the mesh without its colours."""

    def __init__(self, folder: Path, inside: Callable[[Path], Path]) -> None:
        self._folder, self._inside = folder, inside
        self.trouble = ""

    def get(self, name: str) -> bytes:
        """The content of the file that is called so from the mesh's folder."""
        try:
            path = self._inside(self._folder / name)
            size = _bounded(path)
            if path.suffix.lower() in PICTURES:
                _check_picture(path, 0, size)
        except ArchiveError as error:
            self.trouble = self.trouble or str(error)
            raise
        return path.read_bytes()

    __getitem__ = get

    def namespaced(self, namespace: str) -> _Inside:
        return _Inside(self._folder / namespace, self._inside)

    def keys(self) -> list[str]:
        """Nothing is listed: what a mesh does not name is not read."""
        return []


@dataclass(frozen=True)
class _Texture:
    """A material: its `image` (of Pillow), if it has one, tinted by `colour` (sRGB 0..1)."""

    image: Any
    colour: tuple[float, float, float]

    @staticmethod
    def of(visual: Any) -> _Texture:
        material = getattr(visual, "material", None)
        if material is None:
            main = getattr(visual, "main_color", None)
            r, g, b = GREY if main is None else (float(c) / 255 for c in main[:3])
            return _Texture(None, (r, g, b))
        image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        value = getattr(material, "baseColorFactor", None)
        if value is None and image is None:
            value = getattr(material, "diffuse", None)
        if value is None:
            return _Texture(image, (1.0, 1.0, 1.0) if image is not None else GREY)
        rgb = np.asarray(value).ravel()[:3]
        scaled = rgb / 255 if np.issubdtype(rgb.dtype, np.integer) else rgb
        r, g, b = np.clip(scaled.astype(float), 0, 1).tolist()
        return _Texture(image, (r, g, b))

    @property
    def key(self) -> tuple[object, ...]:
        return (id(self.image) if self.image is not None else None, *self.colour)

    def pixels(self, path: Path, side: int) -> NDArray[np.uint8]:
        """(side, side, 4) sRGB."""
        tile = np.full((side, side, 4), 255, dtype=np.uint8)
        tile[..., :3] = np.round(255 * np.array(self.colour))
        if self.image is None:
            return tile
        from PIL import Image

        try:
            self.image.draft("RGB", (2 * side, 2 * side))  # a JPEG need not be read in full
            small = self.image.convert("RGB").resize((side, side), Image.Resampling.BOX)
        except Exception as error:  # whatever Pillow finds wrong with it
            raise ArchiveError(f"{str(path)!r} has an unreadable picture: {error}") from error
        tile[..., :3] = np.round(np.asarray(small, dtype=float) * self.colour)
        return tile

    def places(self, part: Any) -> NDArray[np.float64]:
        """(V, 2) in the tile from its upper left corner; its middle where the file gives none."""
        uv = getattr(part.visual, "uv", None)
        if uv is None or self.image is None or len(uv) != len(part.vertices):
            return np.full((len(part.vertices), 2), 0.5)
        uv = np.nan_to_num(np.asarray(uv, dtype=float))
        if uv.min() < 0 or uv.max() > 1:  # the picture comes round again
            uv = uv - np.floor(uv)
        return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)


def connected(faces: Ints, count: int) -> Ints:
    """For each of `count` vertices the number of the connected part that it belongs to."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = (faces[:, :2].T.ravel(), faces[:, 1:].T.ravel())
    links = coo_array((np.ones(len(pairs[0]), dtype=bool), pairs), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


LARGEST_FILE = 512 << 20
"""Bytes that a mesh file may have; the median official one has 7 MB."""
LARGEST_HEADER = 64 << 20
MOST_VERTICES = 4_000_000
"""Vertices of all that is drawn, every copy counted; likewise corners of triangles, times six."""
MOST_NODES = 100_000
SIZES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
COMPRESSED = ("draco", "meshopt", "basisu")


def check_glb(path: Path) -> tuple[tuple[int, int], ...]:
    """Where its pictures are in the file: offset and length [bytes] of each. ArchiveError, in one
    sentence, if `path` is no GLB file that can be read within bounds."""
    data, binary, start = _chunks(path)
    try:
        _check_header(data, binary)
        views = data.get("bufferViews", ())
        pictures = [views[_whole(image["bufferView"])] for image in data.get("images", ())]
        return tuple((start + view.get("byteOffset", 0), view["byteLength"]) for view in pictures)
    except ArchiveError as error:
        raise ArchiveError(f"{str(path)!r} {error}") from None
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise ArchiveError(
            f"{str(path)!r} is no valid GLB file: its header lacks something, or has it in another "
            "form; unpack the archive again"
        ) from error


def _chunks(path: Path) -> tuple[Mapping[str, Any], int, int]:
    """The file's JSON, and length and offset of its binary chunk."""
    size = _bounded(path)
    with path.open("rb") as file:
        head = file.read(20)
        if len(head) < 20 or head[:4] != b"glTF":
            raise ArchiveError(f"{str(path)!r} is no GLB file; unpack the archive again")
        version, total, length, kind = struct.unpack("<III4s", head[4:])
        if version != 2 or kind != b"JSON":
            raise ArchiveError(f"{str(path)!r} is no GLB file of version 2")
        if total > size or length > min(size - 20, LARGEST_HEADER):
            raise ArchiveError(
                f"{str(path)!r} promises {max(total, length)} bytes and has {size}; unpack the "
                "archive again"
            )
        try:
            data = json.loads(file.read(length))
        except (ValueError, RecursionError) as error:
            raise ArchiveError(f"{str(path)!r} has an unreadable header: {error}") from error
        rest = file.read(8)
        binary = struct.unpack("<I", rest[:4])[0] if len(rest) == 8 else 0
    if binary > size - 28 - length and binary:
        raise ArchiveError(f"{str(path)!r} promises {binary} bytes of data and has fewer")
    if not isinstance(data, dict):
        raise ArchiveError(f"{str(path)!r} has a header that is no JSON object")
    return data, binary, 28 + length


def _check_header(data: Mapping[str, Any], binary: int) -> None:
    for name in (*data.get("extensionsRequired", ()), *data.get("extensionsUsed", ())):
        if any(word in str(name).lower() for word in COMPRESSED):
            raise ArchiveError(f"is compressed by {name}, which is not read; unpack it")
    for buffer in data.get("buffers", ()):
        if "uri" in buffer:
            raise ArchiveError("keeps its data in another file, which is not read")
        if _whole(buffer["byteLength"]) > binary + 3:
            raise ArchiveError(f"promises {buffer['byteLength']} bytes of data and has {binary}")
    for view in data.get("bufferViews", ()):
        length = _whole(data["buffers"][_whole(view["buffer"])]["byteLength"])
        if _whole(view.get("byteOffset", 0)) + _whole(view["byteLength"]) > length:
            raise ArchiveError("has a view that reaches beyond its data")
    counts = [_count(data, accessor) for accessor in data.get("accessors", ())]
    for image in data.get("images", ()):
        if "bufferView" not in image:
            raise ArchiveError("keeps a picture in another file, which is not read")
    _check_drawn(data, counts)


def _count(data: Mapping[str, Any], accessor: Mapping[str, Any]) -> int:
    """How many elements an accessor has, all of them in the file."""
    count = _whole(accessor["count"])
    if "sparse" in accessor or "bufferView" not in accessor:
        raise ArchiveError("has numbers that are not in the file")
    view = data["bufferViews"][_whole(accessor["bufferView"])]
    element = SIZES[accessor["componentType"]] * COMPONENTS[accessor["type"]]
    stride = _whole(view.get("byteStride", 0)) or element
    needed = _whole(accessor.get("byteOffset", 0)) + stride * (count - 1) + element
    if count and needed > _whole(view["byteLength"]):
        raise ArchiveError(f"promises {count} numbers where it has {view['byteLength']} bytes")
    return count


def _check_drawn(data: Mapping[str, Any], counts: Sequence[int]) -> None:
    """Nodes form trees, and all that they draw together is bounded."""
    weights = []
    for mesh in data.get("meshes", ()):
        corners = 0
        for part in mesh["primitives"]:
            corners += counts[_whole(part["attributes"]["POSITION"])]
            corners += counts[_whole(part["indices"])] // 6 if "indices" in part else 0
        weights.append(corners)
    nodes = data.get("nodes", ())
    if len(nodes) > MOST_NODES:
        raise ArchiveError(f"has {len(nodes)} nodes, more than {MOST_NODES}")
    parents = [child for node in nodes for child in node.get("children", ())]
    if len(parents) != len(set(parents)):
        raise ArchiveError("has a node in two places")
    reached, todo = set(), [root for s in data.get("scenes", ()) for root in s.get("nodes", ())]
    while todo:
        node = _whole(todo.pop())
        if node in reached:
            raise ArchiveError("has nodes that hold each other")
        reached.add(node)
        todo += nodes[node].get("children", ())
    drawn = sum(weights[_whole(node["mesh"])] for node in nodes if "mesh" in node)
    if drawn > MOST_VERTICES:
        raise ArchiveError(f"draws {drawn} vertices, more than {MOST_VERTICES}")


def _whole(value: object) -> int:
    """A count, length or number of something else: a whole number that is not negative."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ArchiveError(f"has {value!r} where a count or number must stand")
    return value
