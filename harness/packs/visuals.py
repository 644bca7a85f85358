"""What is drawn of the archive's meshes: thinned, and of robots link by link.

A thinned mesh has fewer triangles because vertices that share a cell of a grid become one. The grid
is as fine as the number of triangles allows. Patches of the picture stay apart (their borders are
drawn twice at the same place), so that no triangle reaches across the picture.

A link of a robot of ours stands for all links of the URDF file that move with it, from one of our
joints to the next. Joints are found by their names, which are the official ones; where a link's
frame differs from the URDF's, its meshes are moved by the difference, so that with all joints at 0
everything is where the URDF has it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import to_transform
from robospa.harness.packs import mesh_files
from robospa.harness.packs.archive import Archive, ArchiveError, Arrays, cached
from robospa.harness.packs.mesh_files import Floats, Ints, RawMesh
from robospa.harness.packs.urdf import MeshUse, Urdf, check_files, key_of, read_urdf
from robospa.harness.robots.embodiment import Arm, Embodiment
from robospa.tasks.objects.meshes import shaded_corners
from robospa.tasks.shapes import Skin

TRIANGLES = 1500
"""Of a thinned mesh, at most."""
FINEST, COARSEST = 160, 4
"""Cells along the longest side of the mesh's box."""


def thinned(mesh: RawMesh, triangles: int = TRIANGLES) -> RawMesh:
    """`mesh` with at most about so many triangles; itself if it has no more."""
    welded = _welded(mesh)
    if len(welded.faces) <= triangles:
        return welded
    patches = mesh_files.connected(welded.faces, len(welded.vertices))
    low, high = COARSEST, FINEST
    best = _clustered(welded, patches, low)
    while low < high - 1:
        middle = (low + high) // 2
        tried = _clustered(welded, patches, middle)
        if len(tried.faces) <= triangles:
            low, best = middle, tried
        else:
            high = middle
    return best


def _welded(mesh: RawMesh) -> RawMesh:
    """Vertices that share place and point of the picture are one; no empty triangles."""
    span = max(float(np.ptp(mesh.vertices, axis=0).max()), 1e-12)
    rows = np.hstack([np.round(mesh.vertices / span, 6), np.round(mesh.uv, 4)])
    _, first, index = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return RawMesh(
        mesh.vertices[first], _proper(index.ravel()[mesh.faces]), mesh.uv[first], mesh.picture
    )


def _proper(faces: Ints) -> Ints:
    """Faces of three different corners, each once."""
    faces = faces[_distinct(faces)]
    first = np.argmin(faces, axis=1)[:, None]
    turned = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    return np.unique(turned, axis=0)


def _clustered(mesh: RawMesh, patches: Ints, cells: int) -> RawMesh:
    low = mesh.vertices.min(axis=0)
    size = max(float(np.ptp(mesh.vertices, axis=0).max()), 1e-12) / cells
    grid = np.floor((mesh.vertices - low) / size).astype(np.int64)
    _, cell = np.unique(grid, axis=0, return_inverse=True)
    cell = cell.ravel()
    _, group = np.unique(np.stack([cell, patches], axis=1), axis=0, return_inverse=True)
    group = group.ravel()
    faces = mesh.faces[_distinct(cell[mesh.faces])]
    count = int(group.max()) + 1
    middle = _means(mesh.vertices, cell, int(cell.max()) + 1)
    of_group = np.zeros(count, dtype=np.int64)
    of_group[group] = cell
    uv = _means(mesh.uv, group, count)
    return RawMesh(middle[of_group], _proper(group[faces]), uv, mesh.picture)


def _distinct(faces: Ints) -> NDArray[np.bool_]:
    a, b, c = faces.T
    found: NDArray[np.bool_] = (a != b) & (b != c) & (a != c)
    return found


def _means(values: Floats, group: Ints, count: int) -> Floats:
    """Mean of the rows of each group, (count, columns)."""
    share = np.bincount(group, minlength=count)[:, None]
    sums = [np.bincount(group, weights=column, minlength=count) for column in values.T]
    return np.stack(sums, axis=1) / share


def shaded(mesh: RawMesh) -> tuple[Floats, Floats, Floats, Ints]:
    """Vertices (V, 3), unit normals (V, 3), places in the picture (V, 2) and triangles (F, 3),
    shaded as built-in objects are: across borders of the picture as if there were none."""
    places, place = np.unique(np.round(mesh.vertices, 9), axis=0, return_inverse=True)
    points, normals = shaded_corners(places, place.ravel()[mesh.faces])
    corners = np.hstack([points, normals, mesh.uv[mesh.faces].reshape(-1, 2)])
    rows, index = np.unique(corners.astype(np.float32), axis=0, return_inverse=True)
    found = np.asarray(rows, dtype=np.float64)
    triangles = np.asarray(index, dtype=np.int64).reshape(-1, 3)
    return found[:, :3], found[:, 3:6], found[:, 6:], triangles


def skin_of(archive: Archive, drawn: Sequence[MeshUse], full: bool = False) -> Path:
    """The meshes as one to draw; with every triangle and a large picture if `full`."""
    files, where = key_of(drawn)
    how = f"{'full' if full else 'thin'} skin {where}"
    return cached(files, how, lambda: _skin(archive, drawn, full))


def _skin(archive: Archive, drawn: Sequence[MeshUse], full: bool) -> Arrays:
    side = mesh_files.LARGE_PICTURE if full else mesh_files.PICTURE
    meshes = [(use, mesh_files.read_mesh(use.file, archive.inside, side)) for use in drawn]
    joined = mesh_files.joined_meshes([_moved(mesh, use.transform) for use, mesh in meshes], side)
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


MOST_FILES = 200
"""URDF files in a robot's folder that are looked at."""


@dataclass(frozen=True)
class RobotSkins:
    """What is drawn of the links of the left and of the right arm instead of our shapes, by link.
    If `stand`, what stands still beside the arms is among it, with the left arm's base."""

    arms: tuple[Mapping[str, Skin], Mapping[str, Skin]]
    stand: bool = False


def robot_skins(archive: Archive, robot: Embodiment, full: bool = False) -> RobotSkins:
    """The meshes of `robot`, every triangle of them if `full`. ArchiveError, in one sentence, if
    they are not there or cannot be read."""
    left, right = robot.arms
    urdf = _robot_urdf(archive, robot)
    own = {joint.name for joint in right.joints} - {joint.name for joint in left.joints}
    both = bool(own) and own <= {*_names(urdf)}
    arms = robot.arms if both else robot.arms[:1]
    moving = frozenset(link for arm in arms for link in _carriers(urdf, arm))
    skins = (
        _arm_skins(archive, urdf, left, moving, full, still=True),
        _arm_skins(archive, urdf, right, moving, full, still=not both),
    )
    return RobotSkins(skins, stand=both)


def check_robot(archive: Archive, robot: Embodiment) -> None:
    """ArchiveError, in one sentence, if the meshes of `robot` are not all there; none is read."""
    check_files(use.file for uses in _robot_urdf(archive, robot).visuals.values() for use in uses)


def _robot_urdf(archive: Archive, robot: Embodiment) -> Urdf:
    """The URDF file of the robot's folder that has its arm's joints; of several the first by
    name."""
    arm, kind = robot.arms[0], robot.name.partition(":")[0]  # its arms may stand farther apart
    folder = archive.root / "embodiments" / kind
    if not folder.is_dir():
        raise ArchiveError(
            f"there are no meshes of {robot.name} in {str(archive.root / 'embodiments')!r}; unpack "
            "embodiments.zip of the official data there"
        )
    for file in sorted(folder.rglob("*.urdf"))[:MOST_FILES]:
        urdf = read_urdf(file, archive.inside)
        if all(joint.name in _names(urdf) for joint in arm.joints):
            return urdf
    missing = ", ".join(joint.name for joint in arm.joints)
    raise ArchiveError(f"no URDF file in {str(folder)!r} has the joints {missing}")


def _carriers(urdf: Urdf, arm: Arm) -> dict[str, str]:
    """Our link for each link of the URDF file that carries others: the base, and all that our
    joints move."""
    children = _names(urdf)
    found = {children[j.name]: j.child for j in arm.all_joints if j.name in children}
    return {urdf.joints[children[arm.joints[0].name]].parent: arm.base_link, **found}


def _names(urdf: Urdf) -> dict[str, str]:
    """The child link of each joint by the joint's name."""
    return {joint.name: child for child, joint in urdf.joints.items()}


def _arm_skins(
    archive: Archive, urdf: Urdf, arm: Arm, moving: frozenset[str], full: bool, still: bool
) -> dict[str, Skin]:
    """Skins of the arm's links; if `still`, the base's has all besides that hangs on none of the
    links that are `moving`."""
    ours = _carriers(urdf, arm)
    root = urdf.in_root(next(iter(ours)))
    frames = _frames_at_zero(arm)
    groups: dict[str, list[MeshUse]] = {}
    for link, uses in urdf.visuals.items():
        # Other joints (wheels, a second pair of arms) stay at 0.
        carrier = next((one for one in urdf.above(link) if one in moving), "")
        if carrier in ours:
            target = ours[carrier]
        elif carrier == "" and still:
            target = arm.base_link
        else:
            continue
        to_ours = np.linalg.inv(root @ frames[target]) @ urdf.in_root(link)
        groups.setdefault(target, []).extend(
            MeshUse(use.file, to_ours @ use.transform) for use in uses
        )
    return {link: Skin(str(skin_of(archive, uses, full))) for link, uses in groups.items() if uses}


def _frames_at_zero(arm: Arm) -> dict[str, Floats]:
    """(4, 4) frame of each of our links in the base link's, all joints at 0."""
    found: dict[str, Floats] = {arm.base_link: np.eye(4)}
    for joint in arm.all_joints:
        found[joint.child] = found[joint.parent] @ to_transform(joint.origin)
    return found
