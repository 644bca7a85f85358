"""URDF files of the archive: links with their meshes, and the joints between them.

Only what is drawn and collided with is read. A file with a document type (external entities,
expanding ones) is refused before it is parsed, and so is a mesh of a ROS package or one outside the
archive.
"""

import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robospa.geometry import Vec3, vec3
from robospa.harness.packs.archive import ArchiveError
from robospa.harness.packs.mesh_files import Floats

LARGEST_FILE = 16 << 20
MOST_PARTS = 4096


@dataclass(frozen=True)
class MeshUse:
    """A mesh file where a link has it: `transform` (4, 4) [m] takes its points into the link's
    frame, scale included."""

    file: Path
    transform: Floats


@dataclass(frozen=True)
class UrdfJoint:
    """`origin` (4, 4) [m] of the child in the parent at 0; `axis` in the child's frame; limits
    [rad] or [m]."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Floats
    axis: Vec3
    limits: tuple[float, float]


@dataclass(frozen=True)
class Urdf:
    """A URDF file: meshes of each link by its name, joints by the name of their child."""

    visuals: Mapping[str, tuple[MeshUse, ...]]
    collisions: Mapping[str, tuple[MeshUse, ...]]
    joints: Mapping[str, UrdfJoint] = field(default_factory=dict)

    def in_root(self, link: str) -> Floats:
        """(4, 4) frame of `link` in the root's, all joints at 0."""
        found = np.eye(4)
        for one in self.above(link)[:-1]:
            found = self.joints[one].origin @ found
        return found

    def moved_by(self, child: str) -> frozenset[str]:
        """The links that the joint above `child` moves: it and all that hangs on it."""
        return frozenset(link for link in self.visuals if child in self.above(link))

    def above(self, link: str) -> list[str]:
        """`link` and all links that it hangs on, upwards."""
        found = [link]
        while found[-1] in self.joints:
            found.append(self.joints[found[-1]].parent)
        return found


def read_urdf(path: Path, inside: Callable[[Path], Path]) -> Urdf:
    """What `path` says; `inside` refuses files that are not the archive's. ArchiveError, in one
    sentence, for one that cannot be read safely."""
    path = inside(path)
    if path.stat().st_size > LARGEST_FILE:
        raise ArchiveError(f"{str(path)!r} is larger than {LARGEST_FILE >> 20} MB")
    text = path.read_bytes()
    if any(mark in text.replace(b"\0", b"") for mark in (b"<!DOCTYPE", b"<!ENTITY")):
        raise ArchiveError(f"{str(path)!r} defines XML entities, which no robot needs: not read")
    try:
        root = ET.fromstring(text)
        return _robot(root, path, inside)
    except ArchiveError:
        raise
    except (ET.ParseError, ValueError, RecursionError) as error:
        raise ArchiveError(f"{str(path)!r} is no valid URDF file: {error}") from error
    except LookupError as error:
        raise ArchiveError(
            f"{str(path)!r} is no valid URDF file: a link, joint or mesh lacks what it must have"
        ) from error


def check_files(files: Iterable[Path]) -> None:
    """ArchiveError, naming the first, if a mesh file is not there or may not be read."""
    for file in files:
        if not file.is_file():
            raise ArchiveError(f"the mesh {str(file)!r} is missing; unpack the archive again")
        if not os.access(file, os.R_OK):
            raise ArchiveError(f"the mesh {str(file)!r} may not be read by this user")


def key_of(uses: Sequence[MeshUse]) -> tuple[tuple[Path, ...], str]:
    """The files, which have to be there, and where they are used as text: what is made of them
    depends on nothing else."""
    files = tuple(use.file for use in uses)
    check_files(files)
    return files, " ".join(np.array2string(use.transform.ravel(), precision=9) for use in uses)


def _robot(root: ET.Element, path: Path, inside: Callable[[Path], Path]) -> Urdf:
    joints = {joint.child: joint for joint in map(_joint, root.findall("joint"))}
    for child in joints:
        seen, link = {child}, child
        while link in joints:
            link = joints[link].parent
            if link in seen:
                raise ArchiveError(f"{str(path)!r} has joints that form a ring")
            seen.add(link)
    links = root.findall("link")
    parts = sum(len(link) for link in links)
    if max(parts, len(links)) > MOST_PARTS or len(joints) > MOST_PARTS:
        raise ArchiveError(
            f"{str(path)!r} has {max(parts, len(links))} parts, more than {MOST_PARTS}"
        )

    def meshes(kind: str) -> dict[str, tuple[MeshUse, ...]]:
        return {
            link.attrib["name"]: tuple(
                use for part in link.findall(kind) for use in _uses(part, path, inside)
            )
            for link in links
        }

    return Urdf(meshes("visual"), meshes("collision"), joints)


def _uses(part: ET.Element, path: Path, inside: Callable[[Path], Path]) -> list[MeshUse]:
    """The mesh of a visual or collision; none for a box, a ball or a cylinder."""
    mesh = part.find("geometry/mesh")
    if mesh is None:
        return []
    name = mesh.attrib["filename"]
    if "://" in name:
        raise ArchiveError(
            f"{str(path)!r} names the mesh {name!r}, which is no path: write it from the URDF's "
            "own folder"
        )
    scale = np.diag([*_numbers(mesh.get("scale", "1 1 1")), 1.0])
    return [MeshUse(inside(path.parent / name), _origin(part) @ scale)]


def _joint(element: ET.Element) -> UrdfJoint:
    axis, limit = element.find("axis"), element.find("limit")
    about = _numbers(axis.get("xyz", "1 0 0") if axis is not None else "1 0 0")
    lower, upper = (
        float(limit.get(name, 0.0)) if limit is not None else 0.0 for name in ("lower", "upper")
    )
    if not (math.isfinite(lower) and math.isfinite(upper)):
        raise ValueError(f"limits {lower} and {upper} of joint {element.get('name')!r}")
    return UrdfJoint(
        name=element.attrib["name"],
        kind=element.attrib["type"],
        parent=element.findall("parent")[0].attrib["link"],
        child=element.findall("child")[0].attrib["link"],
        origin=_origin(element),
        axis=vec3(about),
        limits=(lower, upper),
    )


def _origin(element: ET.Element) -> Floats:
    """(4, 4) of the element's `origin`, turned about fixed x, y, z in this order."""
    origin = element.find("origin")
    frame = np.eye(4)
    if origin is not None:
        frame[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
        a, b, c = _numbers(origin.get("rpy", "0 0 0"))
        x = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
        y = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
        z = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
        frame[:3, :3] = z @ y @ x
    return frame


def _numbers(text: str) -> list[float]:
    found = [float(word) for word in text.split()]
    if len(found) != 3 or not all(map(math.isfinite, found)) or max(map(abs, found)) > 1e6:
        raise ValueError(f"{text!r} where three numbers must stand")
    return found
