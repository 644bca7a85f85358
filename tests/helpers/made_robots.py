"""Stand-ins of the official robots: URDF files with the official joints, our shapes as meshes."""

import math
from pathlib import Path

import numpy as np
from made_archive import pieces_of
from mesh_writers import Piece, write_glb
from numpy.typing import NDArray

from robospa.geometry import to_transform
from robospa.harness.robots import embodiment
from robospa.harness.robots.embodiment import Arm
from robospa.tasks.objects import meshes as m

MOVED = 0.25
"""Where [m] the arms' bases are in the URDF's root, along x."""


def make_robot(root: Path, robot: str, rounds: int = 0) -> Path:
    """Write the meshes of `robot` below `root`/embodiments, with so many `rounds` of splitting each
    triangle in four; returns `root`."""
    arms = embodiment(robot).arms
    both = arms[0].joints[0].name != arms[1].joints[0].name
    folder = root / "embodiments" / robot / "urdf"
    text = ['<robot name="made_up"><link name="root">', _visual(folder, "root", [_plate()])]
    text.append("</link>")
    for k, arm in enumerate(arms if both else arms[:1]):
        text += _links(folder, arm, f"arm{k}_", rounds)
    folder.joinpath("robot.urdf").write_text("\n".join([*text, "</robot>"]))
    folder.joinpath("other.urdf").write_text('<robot name="other"><link name="a"/></robot>')
    return root


def _plate() -> Piece:
    """Something that stands still."""
    plate = m.box_mesh((0.1, 0.1, 0.005))
    return Piece(np.array(plate.vertices), np.array(plate.faces), (40, 40, 200))


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


def _joint(
    name: str, kind: str, parent: str, child: str, origin: NDArray[np.float64], more: str = ""
) -> str:
    x, y, z = origin[:3, 3]
    r = origin[:3, :3]
    roll, pitch = math.atan2(r[2, 1], r[2, 2]), math.asin(max(-1.0, min(1.0, -r[2, 0])))
    yaw = math.atan2(r[1, 0], r[0, 0])
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x:.9g} {y:.9g} {z:.9g}" rpy="{roll:.9g} {pitch:.9g} {yaw:.9g}"/>{more}'
        "</joint>"
    )
