"""What a GLB file promises, before anything is made of it: hostile ones are refused here.

Every count, length and reference is held against the file's own size, so that reading it later
allocates no more than a small multiple of that. Files that point elsewhere are not followed.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from robospa.harness.packs.archive import ArchiveError

LARGEST_FILE = 512 << 20
"""Bytes that a mesh file may have; the median official one has 7 MB."""
LARGEST_HEADER = 64 << 20
MOST_VERTICES = 4_000_000
"""Vertices of all that is drawn, every copy counted; likewise corners of triangles, times six."""
MOST_NODES = 100_000
SIZES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
PARTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
COMPRESSED = ("draco", "meshopt", "basisu")


def check_glb(path: Path) -> tuple[tuple[int, int], ...]:
    """Where its pictures are in the file: offset and length [bytes] of each.

    ArchiveError, in one sentence, if `path` is no GLB file that can be read within bounds.
    """
    data, binary, start = _chunks(path)
    try:
        _check(data, binary)
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
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise ArchiveError(f"{str(path)!r} is larger than {LARGEST_FILE >> 20} MB")
    with path.open("rb") as file:
        head = file.read(20)
        if len(head) < 20 or head[:4] != b"glTF":
            raise ArchiveError(f"{str(path)!r} is no GLB file; unpack the archive again")
        version, total, length, kind = struct.unpack("<II", head[4:12]) + struct.unpack(
            "<I4s", head[12:20]
        )
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


def _check(data: Mapping[str, Any], binary: int) -> None:
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
    element = SIZES[accessor["componentType"]] * PARTS[accessor["type"]]
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
