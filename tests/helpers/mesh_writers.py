"""Small GLB and OBJ files, written byte by byte, so that tests can also write broken ones."""

import io
import json
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Triangles = tuple[Floats, Ints]
"""Vertices (V, 3) and faces (F, 3)."""


@dataclass(frozen=True)
class Piece:
    """Triangles `faces` (F, 3) of `vertices` (V, 3) in one sRGB `colour`, 0..255."""

    vertices: Floats
    faces: Ints
    colour: tuple[int, int, int] = (200, 200, 200)


def volume(vertices: ArrayLike, faces: ArrayLike) -> float:
    """Signed volume: positive if the mesh is closed and its triangles look outwards."""
    a, b, c = np.moveaxis(np.asarray(vertices, dtype=float)[np.asarray(faces)], 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6)


def hollow_staves(outer: float, inner: float, height: float, count: int) -> list[Triangles]:
    """A cup about z, open above, as it comes from a convex decomposition: `count` staves and a
    floor, each closed, that share the places where they meet."""
    angles = 2 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)

    def prism(polygon: Floats, low: float, high: float) -> Triangles:
        n = len(polygon)
        rings = [np.column_stack([polygon, np.full(n, z)]) for z in (low, high)]
        i = np.arange(n)
        j = (i + 1) % n
        sides = np.concatenate([np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)])
        fan = np.stack([np.zeros(n - 2, dtype=int), i[1:-1], i[2:]], axis=1)
        return np.concatenate(rings), np.concatenate([sides, fan[:, ::-1], fan + n])

    staves = [
        prism(np.stack([outer * a, outer * b, inner * b, inner * a]), 0.0, height)
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)
    ]
    return [*staves, prism(inner * ring, 0.0, height / 10)]


def palette_png(colours: Sequence[tuple[int, int, int]], side: int = 4) -> bytes:
    """A picture with a square of `side` pixels for each colour, in one row."""
    from PIL import Image

    row = np.repeat(np.array(colours, dtype=np.uint8)[None], side, axis=1)
    stream = io.BytesIO()
    Image.fromarray(np.repeat(row, side, axis=0)).save(stream, "PNG")
    return stream.getvalue()


def empty_png(width: int, height: int) -> bytes:
    """A picture of which only the header is true."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(bytes(100)))


def glb(pieces: Sequence[Piece], textured: bool = True) -> tuple[dict[str, Any], bytes]:
    """Header and data of a GLB file with a mesh of its own for each piece; textured ones take
    their colours from one picture."""
    colours = list(dict.fromkeys(piece.colour for piece in pieces))
    data = bytearray()
    views: list[dict[str, int]] = []
    accessors: list[dict[str, Any]] = []

    def view(content: bytes) -> int:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content)})
        data.extend(content + b"\0" * (-len(content) % 4))
        return len(views) - 1

    def accessor(values: NDArray[Any], component: int, kind: str) -> int:
        rows = values.reshape(len(values), -1)
        accessors.append(
            {
                "bufferView": view(np.ascontiguousarray(values).tobytes()),
                "componentType": component,
                "count": len(values),
                "type": kind,
                "min": rows.min(axis=0).tolist(),
                "max": rows.max(axis=0).tolist(),
            }
        )
        return len(accessors) - 1

    meshes = []
    for piece in pieces:
        attributes = {"POSITION": accessor(piece.vertices.astype("<f4"), 5126, "VEC3")}
        if textured:
            place = (colours.index(piece.colour) + 0.5) / len(colours)
            uv = np.tile(np.array([place, 0.5], dtype="<f4"), (len(piece.vertices), 1))
            attributes["TEXCOORD_0"] = accessor(uv, 5126, "VEC2")
        indices = accessor(piece.faces.astype("<u4").ravel(), 5125, "SCALAR")
        part = {"attributes": attributes, "indices": indices, "material": 0}
        meshes.append({"primitives": [part]})
    material: dict[str, Any] = {"pbrMetallicRoughness": {"roughnessFactor": 0.5}}
    header: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "nodes": [{"mesh": k} for k in range(len(meshes))],
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "materials": [material],
    }
    if textured:
        header["images"] = [{"bufferView": view(palette_png(colours)), "mimeType": "image/png"}]
        header["textures"] = [{"source": 0}]
        material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    header["buffers"] = [{"byteLength": len(data)}]
    return header, bytes(data)


def glb_bytes(header: dict[str, Any], data: bytes) -> bytes:
    """A GLB file of them."""
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    total = 28 + len(text) + len(data)
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, total),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(data), b"BIN\0"),
            data,
        ]
    )


def write_glb(path: Path, pieces: Sequence[Piece], textured: bool = True) -> None:
    """Write the pieces to `path`, making its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(glb_bytes(*glb(pieces, textured)))


def write_textured_obj(path: Path, piece: Piece) -> None:
    """Write a piece that shows a picture of its colour, which the MTL file beside it names."""
    write_obj(path, [Piece(piece.vertices, piece.faces)], material=False)
    rows = [row for row in path.read_text().splitlines() if row]
    faces = [row.split()[1:] for row in rows if row.startswith("f ")]
    body = [row for row in rows if not row.startswith("f ")]
    text = ["mtllib textured.mtl", *body, "vt 0.5 0.5", "usemtl picture"]
    text += ["f " + " ".join(f"{index}/1" for index in face) for face in faces]
    path.write_text("\n".join(text) + "\n")
    (path.parent / "textured.mtl").write_text("newmtl picture\nmap_Kd textured.png\n")
    (path.parent / "textured.png").write_bytes(palette_png([piece.colour]))


def write_obj(path: Path, pieces: Sequence[Piece], material: bool = True) -> None:
    """Write the pieces as objects of an OBJ file, with an MTL file of their colours beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines, count = [f"mtllib {path.stem}.mtl"] if material else [], 1
    colours = list(dict.fromkeys(piece.colour for piece in pieces))
    for k, piece in enumerate(pieces):
        lines.append(f"o part_{k}")
        lines += [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in piece.vertices.tolist()]
        if material:
            lines.append(f"usemtl colour_{colours.index(piece.colour)}")
        lines += ["f {} {} {}".format(*(i + count for i in face)) for face in piece.faces.tolist()]
        count += len(piece.vertices)
    path.write_text("\n".join(lines) + "\n")
    if material:
        rows = [
            f"newmtl colour_{k}\nKd {r / 255:.4f} {g / 255:.4f} {b / 255:.4f}"
            for k, (r, g, b) in enumerate(colours)
        ]
        path.with_suffix(".mtl").write_text("\n".join(rows) + "\n")
