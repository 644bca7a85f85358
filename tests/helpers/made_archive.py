"""A made-up archive laid out as the official one: stand-ins of every model that the tasks name.

Stand-ins have the official heights, frames and numbers of points; their widths and shapes are those
of our built-in objects, which were chosen within the official bounds. Meshes are in other units
than metres and turned as official ones are, so that scale and frame matter.
"""

import importlib.util
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from mesh_writers import Piece, palette_png, write_glb, write_obj, write_textured_obj
from numpy.typing import NDArray

from robospa.geometry import Vec3, to_matrix, to_transform
from robospa.harness.packs.placing import Y_UP
from robospa.harness.robots import embodiment
from robospa.harness.robots.embodiment import Arm
from robospa.tasks import packs
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects import object_model
from robospa.tasks.objects.build import points_of
from robospa.tasks.official import (
    OfficialModel,
    OfficialSize,
    official_assets,
    official_models,
    official_size,
)
from robospa.tasks.shapes import Box, Cylinder, Mesh, ObjectModel, Shape, Sphere

Floats = NDArray[np.float64]

SCALE = 0.125
"""Metres per unit of the made-up meshes."""
THINGS = ("bottle/0", "marker/0", "plush/0", "toothbrush/0", "toothbrush/12", "toothbrush/3")
"""Of objaverse; the last is not in the list, and of "plush" nothing is known."""
TURNED = 0.7
"""By how much [rad] models stand turned whose direction has to be found."""


READS_MESHES = pytest.mark.skipif(
    importlib.util.find_spec("trimesh") is None,
    reason="reading meshes needs trimesh: pip install 'robospa[assets]'",
)


@contextmanager
def official_pack_in(root: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Until the end the official pack is that of the archive in `root`, with its own cache."""
    monkeypatch.setenv("ROBOSPA_ASSETS", str(root))
    monkeypatch.setenv("ROBOSPA_CACHE", str(cache))
    packs.pack.cache_clear()
    try:
        yield
    finally:
        packs.pack.cache_clear()


def make_archive(
    root: Path, assets: Iterable[str] | None = None, parts: Sequence[str] = ("objects",)
) -> Path:
    """Write stand-ins of `assets` (default: all) below `root`, and of the other `parts` of an
    archive, "background_texture" and "clutter"; returns `root`."""
    if "objects" in parts:
        for asset in official_assets() if assets is None else assets:
            done = set()
            for look, model in enumerate(official_models(asset)):
                if model.name not in done:
                    done.add(model.name)
                    _write_model(root / "objects" / model.folder, model, asset, look)
    if "background_texture" in parts:
        for split in ("seen", "unseen"):
            folder = root / "background_texture" / split
            folder.mkdir(parents=True)
            for k in range(2):
                (folder / f"{k}.png").write_bytes(palette_png([(90 * k, 120, 200), (200, 90, 30)]))
    if "clutter" in parts:
        _write_clutter(root / "objects" / "objaverse")
    return root


@dataclass(frozen=True)
class StandIn:
    """Takes points of the built-in model to those of the made-up file."""

    factors: Floats
    shift: Floats
    turn: Floats

    def points(self, points: Floats) -> Floats:
        """In the file's frame and unit."""
        found: Floats = ((points * self.factors + self.shift) @ self.turn) / SCALE
        return found

    def frame(self, at: Vec3, x: Vec3, z: Vec3) -> list[list[float]]:
        """A 4x4 frame at a point of the built-in model, its x and z axes in these directions."""
        found = np.eye(4)
        found[:3, 3] = self.points(np.array([at]))[0]
        axes = np.array([x, np.cross(z, x), z]).T
        found[:3, :3] = self.turn.T @ axes
        return [[round(value, 6) for value in row] for row in found.tolist()]


def _stand_in(builtin: ObjectModel, model: OfficialModel, size: OfficialSize | None) -> StandIn:
    points = np.concatenate([points_of(shape) for shape in builtin.shapes])
    low, high = points.min(axis=0), points.max(axis=0)
    turn = np.eye(3) if model.lies or model.jointed else Y_UP
    found = (math.pi if model.lies else TURNED) if model.faces else 0.0
    bearing = model.turns * math.pi / 2 + found
    c, s = math.cos(bearing), math.sin(bearing)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ turn
    factors, shift = np.ones(3), np.zeros(3)
    if size is not None:
        up = 1 if model.lies else 2
        factors[up] = size.size[1] / (high[up] - low[up])
        shift[up] = size.centre[1] - size.size[1] / 2 - low[up] * factors[up]
        if model.lies:
            shift[2] = size.centre[2] - high[2] / 2
    return StandIn(factors, shift, turn)


def mesh_of(shape: Shape) -> Mesh:
    """The shape as triangles in its own frame."""
    geometry = shape.geometry
    if isinstance(geometry, Mesh):
        return geometry
    if isinstance(geometry, Box):
        return m.box_mesh(geometry.half)
    if isinstance(geometry, Cylinder):
        r, h = geometry.radius, geometry.half_length
        return m.lathe([(r, -h), (r, h)], 16)
    assert isinstance(geometry, Sphere)
    angles = np.linspace(-math.pi / 2, math.pi / 2, 9)
    return m.lathe([(geometry.radius * math.cos(a), geometry.radius * math.sin(a)) for a in angles])


def pieces_of(shapes: Iterable[Shape], solid: bool, stand_in: StandIn | None = None) -> list[Piece]:
    """What collides of the shapes, if `solid`, or what is drawn."""
    found = []
    for shape in shapes:
        if not (shape.collision if solid else shape.visual):
            continue
        mesh = mesh_of(shape)
        points = np.array(mesh.vertices) @ to_matrix(shape.pose.rotation).T + shape.pose.position
        if stand_in is not None:
            points = stand_in.points(points)
        r, g, b = (round(255 * min(1.0, c) ** (1 / 2.2)) for c in shape.color)
        found.append(Piece(points, np.array(mesh.faces), (r, g, b)))
    return found


def _write_model(folder: Path, model: OfficialModel, asset: str, look: int) -> None:
    builtin, size = object_model(asset, {"look": look}), official_size(model)
    stand_in = _stand_in(builtin, model, size)
    data: dict[str, object] = {"scale": [SCALE] * 3, "stable": True}
    contacts = _contacts(builtin, model, stand_in, size.contacts if size else 2)
    if size is None:
        _write_jointed(folder / model.model, builtin, stand_in, data, contacts)
        return
    write_glb(
        folder / "visual" / f"base{model.model}.glb", pieces_of(builtin.shapes, False, stand_in)
    )
    solid = pieces_of(builtin.shapes, True, stand_in)
    write_glb(folder / "collision" / f"base{model.model}.glb", solid, textured=False)
    support = builtin.frames["support"].position
    places = {point: builtin.frames[frame].position for frame, point in model.points.items()}
    if model.faces.startswith("functional"):
        point, _, frame = model.faces.partition(" = ")
        places[point] = builtin.frames[frame].position
    data |= {
        "center": [c / SCALE for c in size.centre],
        "extents": [s / SCALE for s in size.size],
        "contact_points_pose": contacts,
        "functional_matrix": [
            stand_in.frame(places.get(f"functional {k}", support), (1, 0, 0), (0, 0, 1))
            for k in range(size.functional)
        ],
    }
    (folder / f"model_data{model.model}.json").write_text(json.dumps(data))


def _contacts(
    builtin: ObjectModel, model: OfficialModel, stand_in: StandIn, count: int
) -> list[list[list[float]]]:
    """As many contact points as the official model has: where our frames are said to be at one,
    there; else where the built-in object is held; where it is not held, at its top."""
    places = {point: builtin.frames[frame].position for frame, point in model.points.items()}
    found = []
    for k in range(count):
        if f"contact {k}" in places:
            found.append(stand_in.frame(places[f"contact {k}"], (1, 0, 0), (0, 0, -1)))
        elif builtin.grasps:
            grasp = builtin.grasps[k % len(builtin.grasps)]
            found.append(stand_in.frame(grasp.point, grasp.closing, grasp.approach))
        else:
            found.append(stand_in.frame((0, 0, builtin.size[2]), (1, 0, 0), (0, 0, -1)))
    return found


def _write_jointed(
    folder: Path,
    builtin: ObjectModel,
    stand_in: StandIn,
    data: dict[str, object],
    contacts: list[list[list[float]]],
) -> None:
    """A URDF file whose meshes have y up, as those of the official ones, which the first joint
    turns; a door hangs on a second joint. Contact points are in the frame of what is taken."""
    at = np.zeros(3)
    links = {"body": (builtin.shapes, at)}
    joint = ""
    if builtin.hinge is not None:
        at = stand_in.points(np.array([builtin.hinge.point]))[0]
        links["door"] = (builtin.hinge.shapes, at)
        way = stand_in.turn.T @ np.array(builtin.hinge.axis)
        axis = " ".join(f"{v:.6g}" for v in (Y_UP.T @ way).tolist())
        origin = " ".join(f"{v:.6g}" for v in (Y_UP.T @ at).tolist())
        joint = (
            f'<joint name="joint_0" type="revolute"><parent link="body"/><child link="door"/>'
            f'<origin xyz="{origin}"/><axis xyz="{axis}"/>'
            f'<limit lower="0" upper="{builtin.hinge.upper}"/></joint>'
        )
    taken = [*links][-1]
    data["contact_points_pose"] = [
        {"base": taken, "matrix": _in_link(frame, at)} for frame in contacts
    ]
    text = ['<robot name="made_up"><link name="base"/>']
    for name, (shapes, at) in links.items():
        text.append(f'<link name="{name}">')
        for kind, solid in (("visual", False), ("collision", True)):
            pieces = [
                Piece((piece.vertices - at) @ Y_UP, piece.faces, piece.colour)
                for piece in pieces_of(shapes, solid, stand_in)
            ]
            file = f"textured_objs/{name}_{kind}.obj"
            write_obj(folder / file, pieces)
            text.append(f'<{kind}><geometry><mesh filename="{file}"/></geometry></{kind}>')
        text.append("</link>")
    text.append(
        '<joint name="up" type="fixed"><parent link="base"/><child link="body"/>'
        f'<origin rpy="{math.pi / 2} 0 0"/></joint>{joint}</robot>'
    )
    (folder / "mobility.urdf").write_text("\n".join(text))
    (folder / "model_data.json").write_text(json.dumps(data))


def _in_link(frame: list[list[float]], at: Floats) -> list[list[float]]:
    """A frame of the root in that of a link whose axes have y up and whose origin is `at`."""
    found = np.array(frame)
    found[:3, 3] -= at
    found[:3] = Y_UP.T @ found[:3]
    return [[round(value, 6) for value in row] for row in found.tolist()]


def _write_clutter(root: Path) -> None:
    """Things of four categories, two of which our kinds may be taken for or are not known; the list
    leaves one of them out."""
    for name in THINGS:
        _write_thing(root / name)
    listed: dict[str, list[str]] = {}
    for name in THINGS[:-1]:
        category, _, number = name.partition("/")
        listed.setdefault(category, []).append(number)
    (root / "list.json").write_text(
        json.dumps({"item_names": [*listed], "list_of_items": listed, "radius": {}, "z_max": {}})
    )


def _write_thing(folder: Path) -> None:
    """An upright U, red by its picture, whose hull fills it; its origin is above its underside."""
    parts = [
        m.box_mesh((0.01, 0.02, 0.03), (-0.02, 0.0, 0.0)),
        m.box_mesh((0.01, 0.02, 0.03), (0.02, 0.0, 0.0)),
        m.box_mesh((0.01, 0.02, 0.005), (0.0, 0.0, -0.025)),
    ]
    cup = m.merge(*parts)
    piece = Piece(np.array(cup.vertices), np.array(cup.faces), (200, 20, 20))
    write_textured_obj(folder / "textured.obj", piece)
    solid = [Piece(np.array(part.vertices), np.array(part.faces)) for part in parts]
    write_obj(folder / "coacd_collision.obj", solid, material=False)
    meshes = {"visual": "textured.obj", "collision": "coacd_collision.obj"}
    uses = [
        f'<{kind}><geometry><mesh filename="{file}"/></geometry></{kind}>'
        for kind, file in meshes.items()
    ]
    (folder / "model.urdf").write_text(
        f'<robot name="x"><link name="a">{"".join(uses)}</link></robot>'
    )


# --- robots: URDF files with the official joints, our shapes as meshes

MOVED = 0.25
"""Where [m] the arms' bases are in the URDF's root, along x."""


def make_robot(root: Path, robot: str, rounds: int = 0) -> Path:
    """Write the meshes of `robot` below `root`/embodiments, with so many `rounds` of splitting each
    triangle in four; returns `root`."""
    arms = embodiment(robot).arms
    both = arms[0].joints[0].name != arms[1].joints[0].name
    folder = root / "embodiments" / robot / "urdf"
    mesh = m.box_mesh((0.1, 0.1, 0.005))
    plate = Piece(np.array(mesh.vertices), np.array(mesh.faces), (40, 40, 200))  # stands still
    text = ['<robot name="made_up"><link name="root">', _visual(folder, "root", [plate])]
    text.append("</link>")
    for k, arm in enumerate(arms if both else arms[:1]):
        text += _links(folder, arm, f"arm{k}_", rounds)
    folder.joinpath("robot.urdf").write_text("\n".join([*text, "</robot>"]))
    folder.joinpath("other.urdf").write_text('<robot name="other"><link name="a"/></robot>')
    return root


def _links(folder: Path, arm: Arm, prefix: str, rounds: int) -> list[str]:
    origin = np.eye(4)
    origin[0, 3] = MOVED
    text = [_joint(f"{prefix}mount", "fixed", "root", prefix + arm.base_link, origin)]
    for link in arm.links:
        pieces = [split(piece, rounds) for piece in pieces_of(arm.shapes[link], False)]
        body = _visual(folder, prefix + link, pieces) if pieces else ""
        text.append(f'<link name="{prefix}{link}">{body}</link>')
    for joint in (*arm.joints, *arm.fingers):
        axis = " ".join(f"{v:.9g}" for v in joint.axis)
        limits = f'<axis xyz="{axis}"/><limit lower="{joint.lower}" upper="{joint.upper}"/>'
        parent, child = prefix + joint.parent, prefix + joint.child
        text.append(
            _joint(joint.name, joint.kind, parent, child, to_transform(joint.origin), limits)
        )
    return text


def split(piece: Piece, rounds: int) -> Piece:
    """The piece with every triangle cut in four, `rounds` times: vendors' meshes have many."""
    vertices, faces = piece.vertices, piece.faces
    for _ in range(rounds):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = index.ravel().reshape(3, -1) + len(vertices)
        vertices = np.concatenate([vertices, vertices[unique].mean(axis=1)])
        a, b, c = faces.T
        faces = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return Piece(vertices, faces, piece.colour)


def _visual(folder: Path, name: str, pieces: list[Piece]) -> str:
    write_glb(folder / "meshes" / f"{name}.glb", pieces)
    return f'<visual><geometry><mesh filename="meshes/{name}.glb"/></geometry></visual>'


def _joint(name: str, kind: str, parent: str, child: str, origin: Floats, more: str = "") -> str:
    x, y, z = origin[:3, 3]
    r = origin[:3, :3]
    roll, pitch = math.atan2(r[2, 1], r[2, 2]), math.asin(max(-1.0, min(1.0, -r[2, 0])))
    yaw = math.atan2(r[1, 0], r[0, 0])
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x:.9g} {y:.9g} {z:.9g}" rpy="{roll:.9g} {pitch:.9g} {yaw:.9g}"/>{more}'
        "</joint>"
    )
