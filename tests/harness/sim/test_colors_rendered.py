"""Named colours and bodies of many materials as the head camera shows them."""

import itertools
from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
import sapien
from numpy.typing import NDArray

from robospa.geometry import Pose
from robospa.harness.robots import embodiment
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.sim.cameras import new_camera
from robospa.harness.sim.renderer import Renderer
from robospa.observation import CameraSpec
from robospa.tasks.colors import LOOK_ALIKES, NAMED, difference, lab
from robospa.tasks.families.basic_color import COLORS as TINTED
from robospa.tasks.families.distance import BLOCK_COLORS
from robospa.tasks.families.table import COLORS
from robospa.tasks.objects import assets, object_model, variant_count
from robospa.tasks.objects.tint import TINTS
from robospa.tasks.objects.tools import PADS
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Box, Cylinder, ObjectModel, Shape, Sphere
from robospa.workcell import TABLE_TOP

pytestmark = pytest.mark.sim

ROBOT = embodiment("aloha-agilex")
AWAY = [{link: Pose((0.0, -30.0, 0.0)) for link in arm.links} for arm in ROBOT.arms]
BARE = Scene("Test_Colors", 1, 100000, ROBOT.name, "clean", (), {})
HEAD = CameraSpec("head", 320, 240)
Image = NDArray[np.uint8]


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    made = Renderer()
    made.sync(BARE, ROBOT)
    return made


@cache
def usual_camera_of(renderer: Renderer) -> sapien.render.RenderCameraComponent:
    """A head camera with SAPIEN's own shader, which tells what each pixel shows."""
    head = next(made for (spec, _), made in renderer._cameras.items() if spec == HEAD)
    camera = new_camera(renderer._scene, HEAD.width, HEAD.height, shader="")
    camera.set_fovy(head.fovy, compute_x=True)
    camera.near, camera.far = head.near, head.far
    camera.entity.pose = head.entity.pose
    renderer._scene.update_render()
    return camera


def usual_camera(renderer: Renderer) -> sapien.render.RenderCameraComponent:
    """That camera, after it has taken a picture of what `renderer` drew last."""
    camera = usual_camera_of(renderer)
    camera.take_picture()
    return camera


def seen(renderer: Renderer, bodies: list[tuple[Sequence[Shape], Pose]]) -> tuple[Image, Image]:
    """The head's picture of shapes at poses, and which of them (1, 2, ...) each pixel shows."""
    entities = [renderer._draw(shapes, "thing") for shapes, _ in bodies]
    for entity, (_, pose) in zip(entities, bodies, strict=True):
        assert entity is not None and len(entity.components[0].render_shapes) == 1
        entity.pose = to_sapien(pose)
    (image,) = renderer.render([HEAD], AWAY, {})
    ids = usual_camera(renderer).get_picture("Segmentation")[..., 1]
    owner = np.zeros(ids.shape, dtype=np.uint8)
    for number, entity in enumerate(entities, 1):
        owner[ids == entity.per_scene_id] = number
        renderer._scene.remove_entity(entity)
    return image, owner


def drawn(model: ObjectModel) -> list[Shape]:
    """All that is drawn of it, with its door closed."""
    return [*model.shapes, *(model.hinge.shapes if model.hinge else ())]


def test_named_colors_of_a_scene_are_told_apart(renderer: Renderer) -> None:
    tinted = {
        object_model(asset, {"tint": "red"}).shapes[i].roughness
        for asset, rule in TINTS.items()
        for i in rule.body
    }
    blocks = tuple(dict.fromkeys((*COLORS, *BLOCK_COLORS)))
    together = [
        (PADS, 0.8),
        (blocks, 0.6),
        *(((*TINTED, "white"), rough) for rough in sorted(tinted)),
    ]
    kinds = sorted({(word, rough) for words, rough in together for word in words})
    assert len(kinds) <= 160
    places = [(-0.23 + 0.024 * (i % 20), -0.18 + 0.035 * (i // 20)) for i in range(len(kinds))]
    patch = Box((0.010, 0.010, 0.0005))
    bodies = [
        ([Shape(patch, color=NAMED[word], roughness=rough)], Pose((x, y, TABLE_TOP + 0.0005)))
        for (word, rough), (x, y) in zip(kinds, places, strict=True)
    ]
    image, owner = seen(renderer, bodies)
    shown = {kind: lab(np.median(image[owner == i], axis=0)) for i, kind in enumerate(kinds, 1)}
    table = lab(np.median(image[100:], axis=(0, 1)))
    for kind, color in shown.items():
        assert difference(color, table) >= 15, kind
    for words, rough in together:
        for a, b in itertools.combinations(words, 2):
            gap = difference(shown[a, rough], shown[b, rough])
            assert gap >= 20 or any({a, b} <= set(some) for some in LOOK_ALIKES), (a, b, rough, gap)


def test_every_object_stands_out_from_the_table(renderer: Renderer) -> None:
    models = [object_model(a, {"look": k}) for a in assets() for k in range(variant_count(a))]
    models = [m for m in models if m.size[2] <= 0.3]  # higher ones stand on the floor
    faint, least = [], 0.0
    for most, row, rows in ((0.12, 4, 3), (0.20, 3, 2), (0.50, 2, 1)):
        fit = [m for m in models if least < max(m.size) <= most]
        least = most
        for group in (fit[i : i + row * rows] for i in range(0, len(fit), row * rows)):
            pitch = 0.56 / row
            places = [
                (-0.28 + pitch * (i % row + 0.5), -0.17 + pitch * (i // row))
                for i in range(len(group))
            ]
            bodies = [
                (drawn(model), Pose((x, y, TABLE_TOP - model.bottom)))
                for model, (x, y) in zip(group, places, strict=True)
            ]
            image, owner = seen(renderer, bodies)
            table = lab(np.median(image[owner == 0][-20_000:], axis=0))
            for number, model in enumerate(group, 1):
                gap = float(np.median(difference(lab(image[owner == number]), table)))
                if gap < 15:
                    faint.append((model.asset, model.phrases[:1], round(gap, 1)))
    assert not faint


MIXED = (
    Shape(Box((0.05, 0.03, 0.02)), Pose((0.0, 0.0, 0.02), (0.8, 0.0, 0.0, 0.6)), (0.7, 0.1, 0.1)),
    Shape(Sphere(0.04), Pose((0.12, 0.0, 0.04)), (0.1, 0.6, 0.2), roughness=0.9),
    Shape(Cylinder(0.03, 0.05), Pose((-0.1, 0.05, 0.05)), (0.2, 0.2, 0.7), metallic=0.8),
)


def picture(renderer: Renderer, *bodies: Sequence[Shape]) -> np.ndarray:
    """The head's picture of bodies in one place."""
    image, _ = seen(renderer, [(shapes, Pose((0.0, 0.0, TABLE_TOP))) for shapes in bodies])
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
