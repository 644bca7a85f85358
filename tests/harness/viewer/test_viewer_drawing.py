"""What a trial's bodies look like."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robospa.geometry import Pose
from robospa.tasks.shapes import Box, Shape, Skin

pytest.importorskip("sapien", reason="shapes are made by the simulator's extra `sim`")
from robospa.harness.viewer.playback import drawn_bodies, meshes, srgb

RED, WHITE = (1.0, 0.0, 0.0), (1.0, 1.0, 1.0)


def test_shapes_of_one_colour_are_one_mesh_and_what_only_collides_is_left_out() -> None:
    box = Box((0.1, 0.2, 0.3))
    red, white = meshes(
        [
            Shape(box, color=RED),
            Shape(box, color=WHITE),
            Shape(box, Pose((1.0, 0.0, 0.0)), RED),
            Shape(box, Pose((9.0, 0.0, 0.0)), RED, visual=False),
        ]
    )
    assert red.colors.tolist() == [255, 0, 0]
    assert white.colors.tolist() == [255, 255, 255]
    assert len(red.faces) == 2 * len(white.faces) == 24
    assert np.allclose(red.vertices.max(axis=0), [1.1, 0.2, 0.3])
    assert red.faces.max() < len(red.vertices)


def test_linear_colours_become_srgb() -> None:
    assert srgb(np.array([0.0, 0.5, 2.0])).tolist() == [0, 186, 255]


def test_a_model_from_a_file_has_the_colours_of_its_picture(tmp_path: Path) -> None:
    picture = np.zeros((2, 2, 4), np.uint8)
    picture[0, 1] = (10, 20, 30, 255)  # upper right
    np.savez(
        tmp_path / "skin.npz",
        vertices=np.eye(3, dtype=np.float32),
        normals=np.eye(3, dtype=np.float32),
        triangles=np.array([[0, 1, 2]], np.uint32),
        uvs=np.array([[0.9, 0.1], [0.1, 0.1], [0.9, 0.9]], np.float32),
        picture=picture,
    )
    skin = Skin(str(tmp_path / "skin.npz"), scale=(2.0, 1.0, 1.0), pose=Pose((0.0, 0.0, 1.0)))
    (mesh,) = meshes((), skin)
    assert mesh.colors.tolist() == [[10, 20, 30], [0, 0, 0], [0, 0, 0]]
    assert mesh.vertices.tolist() == [[2, 0, 1], [0, 1, 1], [0, 0, 2]]


def test_every_robot_and_every_object_of_a_scene_is_drawn() -> None:
    from robospa.harness.robots import embodiment
    from robospa.tasks.catalog import build_scene

    scene = build_scene("Click_Bell_Open_Microwave_Place_Object", 3, 100000)
    names = [body.name for body in drawn_bodies(scene, embodiment("franka-panda"))]
    assert names[0] == "table"
    assert len(set(names)) == len(names)
    assert {item.name for item in scene.objects} <= set(names)
    oven = next(item.name for item in scene.objects if "microwave" in item.asset)
    assert f"{oven} part" in names
    still = [b for b in drawn_bodies(scene, embodiment("aloha-agilex")) if b.pose is not None]
    assert [body.name for body in still] == ["table", "stand"]
