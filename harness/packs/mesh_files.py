"""A mesh file of the archive as arrays: triangles with their places in one picture.

Reads GLB, OBJ, STL and PLY through trimesh. What a file draws with several materials becomes one
mesh with one picture, because on a CPU each drawn thing of its own costs as much as a thousand
vertices.
"""

from __future__ import annotations

import importlib.util
import io
import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.harness.packs.archive import ArchiveError
from robospa.harness.packs.glb import LARGEST_FILE, MOST_VERTICES, check_glb

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
    """The mesh in `path`; `inside` refuses files that are not the archive's.

    ArchiveError, in one sentence, for a file that cannot be read or is too large.
    """
    parts = _parts(path, inside)
    textures = [_Texture.of(part.visual) for part in parts]
    looks = list(dict.fromkeys(t.key for t in textures))
    if len(looks) > MOST_TILES:
        raise ArchiveError(f"{str(path)!r} has {len(looks)} materials, more than {MOST_TILES}")
    grid = math.ceil(math.sqrt(len(looks)))
    tile = max(4, side // grid)
    picture = np.full((grid * tile, grid * tile, 4), 255, dtype=np.uint8)
    vertices, faces, uvs, count = [], [], [], 0
    for part, texture in zip(parts, textures, strict=True):
        row, column = divmod(looks.index(texture.key), grid)
        picture[row * tile : (row + 1) * tile, column * tile : (column + 1) * tile] = (
            texture.pixels(path, tile)
        )
        margin = 0.5 / tile
        local = np.clip(texture.places(part), margin, 1 - margin)
        uvs.append((local + np.array([column, row])) / grid)
        vertices.append(np.asarray(part.vertices, dtype=float))
        faces.append(np.asarray(part.faces, dtype=np.int64) + count)
        count += len(part.vertices)
    return RawMesh(np.concatenate(vertices), np.concatenate(faces), np.concatenate(uvs), picture)


def read_shapes(
    path: Path, inside: Callable[[Path], Path]
) -> list[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Vertices (V, 3) and faces (F, 3) of each node in `path`, in the file's frame and unit: its
    materials, which are not read, do not divide it.

    ArchiveError as `read_mesh`.
    """
    return [
        (np.asarray(part.vertices, dtype=float), np.asarray(part.faces, dtype=np.int64))
        for part in _parts(path, inside, by_node=True)
    ]


def _parts(path: Path, inside: Callable[[Path], Path], by_node: bool = False) -> list[Any]:
    """The file's trimesh meshes, moved to where the file has them: one for each material, or
    `by_node` one for each node of a GLB file and each object of an OBJ file."""
    trimesh = _library()
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
    if path.stat().st_size > LARGEST_FILE:
        raise ArchiveError(f"{str(path)!r} is larger than {LARGEST_FILE >> 20} MB")
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
        if len(part.faces) and (part.faces.min() < 0 or part.faces.max() >= len(points)):
            raise ArchiveError(f"{str(path)!r} has triangles of vertices that do not exist")
    if sum(len(part.vertices) + len(part.faces) // 2 for part in parts) > 2 * MOST_VERTICES:
        raise ArchiveError(f"{str(path)!r} has more than {MOST_VERTICES} vertices")
    return parts


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

    `trouble` is why one was refused; one that is not there leaves the mesh without its colours.
    """

    def __init__(self, folder: Path, inside: Callable[[Path], Path]) -> None:
        self._folder, self._inside = folder, inside
        self.trouble = ""

    def get(self, name: str) -> bytes:
        """The content of the file that is called so from the mesh's folder."""
        try:
            path = self._inside(self._folder / name)
            size = path.stat().st_size
            if size > LARGEST_FILE:
                raise ArchiveError(f"{str(path)!r} is larger than {LARGEST_FILE >> 20} MB")
            if path.suffix.lower() in PICTURES:
                _check_picture(path, 0, size)
        except ArchiveError as error:
            self.trouble = self.trouble or str(error)
            raise
        return path.read_bytes()

    __getitem__ = get

    def namespaced(self, namespace: str) -> _Inside:
        """The same from a folder below."""
        return _Inside(self._folder / namespace, self._inside)

    def keys(self) -> list[str]:
        """Nothing is listed: what a mesh does not name is not read."""
        return []


def reads_meshes() -> bool:
    """Whether the library that reads meshes is installed."""
    return importlib.util.find_spec("trimesh") is not None


def _library() -> Any:
    try:
        import trimesh
    except ModuleNotFoundError as error:
        raise ArchiveError(
            "reading official assets needs trimesh; install it with: pip install 'robospa[assets]'"
        ) from error
    return trimesh


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
        width, height = self.image.size
        if max(width, height) > LARGEST_PICTURE:
            raise ArchiveError(
                f"{str(path)!r} has a picture of {width}x{height} pixels, more than "
                f"{LARGEST_PICTURE} along a side"
            )
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
