"""From `robospa.tasks.shapes` to what SAPIEN draws. Needs an open render system.

Shapes of equal geometry and material share their mesh on the device. Meshes get one normal per
corner: smooth across flat angles, sharp across creases, so that a lathed can looks round and its
rim does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien import render

from robospa.harness.sim.bodies import local_pose
from robospa.tasks.shapes import Box, Color, Cylinder, Geometry, Mesh, Shape, Sphere

Array = NDArray[np.float64]

CREASE = np.cos(np.radians(40.0))
"""Faces that meet at a sharper angle than this are shaded apart."""
SIDES = 24
"""Of a drawn cylinder."""
RINGS = 10
"""Of a drawn sphere, from pole to pole."""


def render_body(shapes: Sequence[Shape], name: str) -> sapien.Entity | None:
    """An entity with the visual ones of `shapes`; None if there is none."""
    visual = [shape for shape in shapes if shape.visual]
    if not visual:
        return None
    component = render.RenderBodyComponent()
    for shape in visual:
        drawn = _prototype(shape.geometry, shape.color, shape.roughness, shape.metallic).clone()
        drawn.local_pose = local_pose(shape)
        component.attach(drawn)
    entity = sapien.Entity()
    entity.add_component(component)
    entity.name = name
    return entity


@lru_cache(maxsize=4096)
def _prototype(
    geometry: Geometry, color: Color, roughness: float, metallic: float
) -> render.RenderShape:
    """A drawable of which clones are used; it belongs to no entity."""
    material = render.RenderMaterial(
        base_color=[*color, 1.0], roughness=roughness, metallic=metallic, specular=0.5
    )
    if isinstance(geometry, Box):
        return render.RenderShapeBox(geometry.half, material)
    if isinstance(geometry, Sphere):
        return render.RenderShapeSphere(geometry.radius, material)
    if isinstance(geometry, Cylinder):
        return render.RenderShapeCylinder(geometry.radius, geometry.half_length, material)
    return _mesh(geometry, material)


def _mesh(mesh: Mesh, material: render.RenderMaterial) -> render.RenderShape:
    vertices, normals = shaded_corners(mesh)
    return render.RenderShapeTriangleMesh(
        vertices=vertices.astype(np.float32),
        triangles=np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3),
        normals=normals.astype(np.float32),
        uvs=np.zeros((len(vertices), 2), dtype=np.float32),
        material=material,
    )


def shaded_corners(mesh: Mesh) -> tuple[Array, Array]:
    """Corners (3 F, 3) of all faces and their unit normals.

    A corner's normal is the area-weighted mean over the faces at that vertex which lie within the
    crease angle of its own face.
    """
    points = np.asarray(mesh.vertices, dtype=float)
    faces = np.asarray(mesh.faces, dtype=int)
    a, b, c = (points[faces[:, i]] for i in range(3))
    areas = np.cross(b - a, c - a)
    length = np.linalg.norm(areas, axis=1)
    unit = areas / np.maximum(length, 1e-15)[:, None]
    at_vertex: list[list[int]] = [[] for _ in points]
    for index, face in enumerate(faces.tolist()):
        for vertex in face:
            at_vertex[vertex].append(index)
    normals = np.empty((len(faces), 3, 3))
    for vertex, around in enumerate(at_vertex):
        if not around:
            continue
        near = np.array(around)
        alike = unit[near] @ unit[near].T >= CREASE
        summed = alike @ areas[near]
        summed /= np.maximum(np.linalg.norm(summed, axis=1), 1e-15)[:, None]
        rows, corners = np.nonzero(faces[near] == vertex)
        normals[near[rows], corners] = summed[rows]
    return points[faces].reshape(-1, 3), normals.reshape(-1, 3)
