"""What a trial's bodies look like: coloured triangles of room, robot and objects, by body.

The same shapes as in the simulator's pictures, without its lights and textures; robots are drawn
with the shapes that are built in.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.geometry import Pose, to_matrix
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.sim.render_bodies import surface
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Color, Shape, Skin

TABLE = "table"
STAND = "stand"


@dataclass(frozen=True)
class Mesh:
    """Triangles `faces` (F, 3) of `vertices` (V, 3) [m] in the frame of their body.

    `colors` are sRGB, uint8: (3,) one for all, or (V, 3) one a vertex.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    colors: NDArray[np.uint8]


@dataclass(frozen=True)
class DrawnBody:
    """A body by its name; one that never moves has its `pose` [m, world].

    `box` are centre and size [m] of the box around it, in its frame.
    """

    name: str
    meshes: tuple[Mesh, ...]
    pose: Pose | None = None

    @property
    def box(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Centre and size (3,) [m] of the box around it, in its frame."""
        corners = np.concatenate([mesh.vertices for mesh in self.meshes])
        low, high = corners.min(axis=0), corners.max(axis=0)
        return (low + high) / 2, high - low


def drawn_bodies(scene: Scene, robot: Embodiment) -> list[DrawnBody]:
    """Everything that is seen of `scene`: table, robot, objects with their doors and lids."""
    from robospa.harness.sim import furniture
    from robospa.workcell import WORKCELL

    found = [DrawnBody(TABLE, meshes(furniture.table(WORKCELL.table)), Pose(scene.table_at))]
    found.append(DrawnBody(STAND, meshes(robot.body), Pose()))
    for side, arm in zip(ARMS, robot.arms, strict=True):
        found += [DrawnBody(f"{side} {link}", meshes(arm.shapes[link])) for link in arm.links]
    for item in scene.everything:
        model = object_model(item.asset, item.params)
        found.append(DrawnBody(item.name, meshes(model.shapes, model.skin)))
        if model.hinge is not None:
            part = meshes(model.hinge.shapes, model.hinge.skin)
            found.append(DrawnBody(f"{item.name} part", part))
    return [body for body in found if body.meshes]


def meshes(shapes: Iterable[Shape], skin: Skin | None = None) -> tuple[Mesh, ...]:
    """The visual ones of `shapes`, one mesh a colour, and `skin`."""
    by_color: dict[Color, list[Shape]] = {}
    for shape in shapes:
        if shape.visual:
            by_color.setdefault(shape.color, []).append(shape)
    made = [_merged(same, color) for color, same in by_color.items()]
    return (*made, *([_skinned(skin)] if skin is not None else []))


def srgb(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    """sRGB levels of linear colours, of any shape."""
    levels: NDArray[np.uint8] = np.round(255 * np.clip(linear, 0, 1) ** (1 / 2.2)).astype(np.uint8)
    return levels


def _merged(shapes: Sequence[Shape], color: Color) -> Mesh:
    vertices, faces, count = [], [], 0
    for shape in shapes:
        corners, index = surface(shape.geometry)
        turned = corners[:, :3] @ to_matrix(shape.pose.rotation).T
        vertices.append(turned + np.asarray(shape.pose.position))
        faces.append(index + count)
        count += len(corners)
    return Mesh(
        np.concatenate(vertices).astype(np.float32),
        np.concatenate(faces).astype(np.uint32),
        srgb(np.asarray(color)),
    )


def _skinned(skin: Skin) -> Mesh:
    """The mesh in the file of `skin`, with its picture's colours at its vertices."""
    from robospa.harness.sim.render_bodies import tinted

    with np.load(skin.file, allow_pickle=False) as file:
        vertices, faces, uvs = file["vertices"], file["triangles"], file["uvs"]
        picture = tinted(file["picture"], skin)
    turn = to_matrix(skin.pose.rotation).T
    placed = (vertices * np.asarray(skin.scale)) @ turn + np.asarray(skin.pose.position)
    size = np.array(picture.shape[:2])
    rows, columns = (np.mod(uvs[:, ::-1], 1.0) * size).astype(int).clip(0, size - 1).T
    return Mesh(placed.astype(np.float32), faces.astype(np.uint32), picture[rows, columns, :3])
