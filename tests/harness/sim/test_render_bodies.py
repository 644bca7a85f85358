"""A body is drawn as one mesh, and looks as its shapes do. Needs a Vulkan device."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.geometry import Pose
from robospa.harness.robots import embodiment
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.sim.renderer import Renderer
from robospa.harness.world import RenderUnavailable
from robospa.observation import CameraSpec
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Box, Cylinder, Shape, Sphere
from robospa.workcell import TABLE_TOP

pytestmark = pytest.mark.sim

ROBOT = embodiment("aloha-agilex")
AWAY = [{link: Pose((0.0, -30.0, 0.0)) for link in arm.links} for arm in ROBOT.arms]
HEAD = CameraSpec("head", 320, 240)
MIXED = (
    Shape(Box((0.05, 0.03, 0.02)), Pose((0.0, 0.0, 0.02), (0.8, 0.0, 0.0, 0.6)), (0.7, 0.1, 0.1)),
    Shape(Sphere(0.04), Pose((0.12, 0.0, 0.04)), (0.1, 0.6, 0.2), roughness=0.9),
    Shape(Cylinder(0.03, 0.05), Pose((-0.1, 0.05, 0.05)), (0.2, 0.2, 0.7), metallic=0.8),
)


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    try:
        made = Renderer()
    except RenderUnavailable as error:
        pytest.fail(f"nothing can be drawn here, see `robospa check`: {error}")
    made.sync(Scene("Test_Bodies", 1, 100000, ROBOT.name, "clean", (), {}), ROBOT, object_model)
    return made


def picture(renderer: Renderer, *bodies: tuple[Shape, ...]) -> np.ndarray:
    """The head's picture of bodies in one place."""
    entities = [renderer._draw(shapes, "thing") for shapes in bodies]
    for entity in entities:
        assert entity is not None and len(entity.components[0].render_shapes) == 1
        entity.pose = to_sapien(Pose((0.0, 0.0, TABLE_TOP)))
    (image,) = renderer.render([HEAD], AWAY, {})
    for entity in entities:
        renderer._scene.remove_entity(entity)
    return image.astype(int)


@pytest.mark.parametrize("name", ["mixed", "hammer", "stapler", "french_fries"])
def test_a_body_of_many_materials_is_one_mesh_that_looks_as_its_shapes_do(
    renderer: Renderer, name: str
) -> None:
    shapes = MIXED if name == "mixed" else object_model(name).shapes
    drawn = tuple(shape for shape in shapes if shape.visual)
    assert len({(s.color, s.roughness, s.metallic) for s in drawn}) > 1
    apart = picture(renderer, *((shape,) for shape in drawn))
    assert np.abs(picture(renderer, drawn) - apart).max() <= 2
    empty = picture(renderer)
    assert (apart != empty).any()


def test_faces_of_round_shapes_look_outwards(renderer: Renderer) -> None:
    from robospa.harness.sim.render_bodies import surface

    for geometry in (Sphere(0.03), Cylinder(0.02, 0.05), Box((0.01, 0.02, 0.03))):
        corners, triangles = surface(geometry)
        a, b, c = (corners[triangles[:, i], :3] for i in range(3))
        outward = np.cross(b - a, c - a)
        assert (np.einsum("ij,ij->i", outward, (a + b + c) / 3) > 0).all()
        normals = corners[triangles, 3:].sum(axis=1)
        assert (np.einsum("ij,ij->i", outward, normals) > 0).all()
        volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
        exact = {Sphere: 4 / 3 * np.pi * 0.03**3, Cylinder: np.pi * 0.02**2 * 0.1, Box: 4.8e-5}
        assert volume == pytest.approx(exact[type(geometry)], rel=0.03)
