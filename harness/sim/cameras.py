"""SAPIEN cameras of a drawn scene, with our own shader, and their pictures as bytes.

The shader in the folder `shader` draws what such a scene holds and no more: opaque bodies under
ambient light, one sun and two lamps, all with shadow maps, in one pass that writes nothing but the
picture. SAPIEN's default one takes three times as long: it has passes for transparent surfaces,
lines and points, images of positions and segmentation, and on its first picture it integrates a
table for environment maps, five seconds of two cores in software.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from threading import get_ident

import numpy as np
import sapien
from numpy.typing import NDArray

from robospa.geometry import Pose, rotate
from robospa.harness.sim.antialiasing import Smoother
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.world import CameraView
from robospa.observation import CameraSpec

SHADER = Path(__file__).parent / "shader"
"""Folder of the shader; its files are compiled when a process makes its first camera."""
BYTES, FLOATS = "R8G8B8A8Unorm", "R32G32B32A32Sfloat"


IDS = SHADER / "ids"
"""Folder of the shader that draws numbers of bodies in the place of colours."""


def new_camera(
    scene: sapien.Scene, width: int, height: int, shader: str = str(SHADER)
) -> sapien.render.RenderCameraComponent:
    """A camera of `width` by `height` px on an entity of its own; `shader` "" is SAPIEN's."""
    camera = sapien.render.RenderCameraComponent(width, height, shader)
    entity = sapien.Entity()
    entity.add_component(camera)
    sapien.render.set_picture_format("Color", BYTES)  # read when a camera comes into a scene
    scene.add_entity(entity)
    sapien.render.set_picture_format("Color", FLOATS)
    return camera


def pixels(
    camera: sapien.render.RenderCameraComponent, sky: NDArray[np.uint8], count: int = 1
) -> list[NDArray[np.uint8]]:
    """The picture taken last, as `count` of equal width, RGB (height, width, 3).

    `sky` (3,) is where nothing was drawn; edges are smoothed.
    """
    row = camera.get_picture("Color")
    colors = row.view(np.uint32)
    if colors.min() == 0:
        colors[colors == 0] = np.array([*sky, 255], dtype=np.uint8).view(np.uint32)
    height, width = row.shape[:2]
    row = _smoother(get_ident(), height, width, count)(row)
    images = []
    for picture in np.split(row, count, axis=1):
        image = np.empty((height, width // count, 3), dtype=np.uint8)
        for channel in range(3):  # a third of the time of one copy
            image[..., channel] = picture[..., channel]
        images.append(image)
    return images


def mark(entity: sapien.Entity, number: int) -> None:
    """Give what is drawn of a body the number (1 to 65,535) that `IDS` draws."""
    for component in entity.components:
        for drawn in component._internal_node.children:
            drawn.set_segmentation([0, 0, 0, number])


def numbers(camera: sapien.render.RenderCameraComponent) -> tuple[NDArray[np.int32], ...]:
    """Of the picture taken last by a camera of `IDS`: the body's number at each pixel, 0 where it
    has none, and whether its surface looks up there, (height, width) each."""
    low, high, up, _ = np.moveaxis(camera.get_picture("Color").astype(np.int32), 2, 0)
    return low + 256 * high, up


@lru_cache(maxsize=8)
def _smoother(thread: int, height: int, width: int, count: int) -> Smoother:
    return Smoother(height, width, count)


MOST = 3
"""Pictures side by side; the shader has room for so many."""
NEAR, FAR = 0.01, 100.0
"""[m], of all pictures: nothing comes nearer to a head camera than to a wrist camera's fingers."""


def visibility(picture: int) -> float:
    """Visibility of a body's copy in picture 0, 1 or 2 of a row, by which the shader knows it."""
    return 1.0 - picture / 4


def rows(cameras: Sequence[CameraSpec]) -> list[list[int]]:
    """Which of `cameras` are drawn together: indices of those of one size, `MOST` at a time."""
    sizes: dict[tuple[int, int], list[int]] = {}
    for index, camera in enumerate(cameras):
        sizes.setdefault((camera.width, camera.height), []).append(index)
    return [same[i : i + MOST] for same in sizes.values() for i in range(0, len(same), MOST)]


class TiledRenderer:
    """Draws rows of pictures of `scene`, whose bodies have `MOST` copies."""

    def __init__(self, scene: sapien.Scene) -> None:
        self._scene = scene
        self._marks = [scene.add_point_light((0, 0, 0), (0, 0, 0)) for _ in range(2 * MOST)]
        self._cameras: dict[tuple[int, int, int], sapien.render.RenderCameraComponent] = {}

    def draw(
        self, views: Sequence[CameraView], width: int, height: int, sky: NDArray[np.uint8]
    ) -> list[NDArray[np.uint8]]:
        """The picture (height, width, 3) of each of `views`, `sky` where nothing was drawn."""
        for view, place, way in zip(views, self._marks[::2], self._marks[1::2], strict=False):
            upwards = 1.0 / math.tan(view.fov / 2)
            across = upwards * height / width
            forward, left, up = (
                rotate(view.pose.rotation, axis)
                for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
            )
            place.entity.pose = to_sapien(Pose(view.pose.position))
            place.color = tuple(-across * x for x in left)
            way.entity.pose = to_sapien(Pose(forward))
            way.color = tuple(-upwards * x for x in up)
        self._scene.update_render()
        camera = self._camera(len(views), width, height)
        camera.take_picture()
        return pixels(camera, sky, len(views))

    def _camera(self, count: int, width: int, height: int) -> sapien.render.RenderCameraComponent:
        """The camera of rows of `count` pictures, made on first use."""
        key = (count, width, height)
        if key not in self._cameras:
            camera = new_camera(self._scene, count * width, height, str(SHADER / "abreast"))
            camera.near, camera.far = NEAR, FAR
            camera.skew = -count * count * width / 2  # the matrix has -2 skew / width there
            self._cameras[key] = camera
        return self._cameras[key]


def add_copies(scene: sapien.Scene, entity: sapien.Entity) -> None:
    """Put a body into the scene; only the first of its copies throws shadows."""
    scene.add_entity(entity)
    for copy in entity.components[1:]:
        for drawn in copy._internal_node.children:
            drawn.cast_shadow = False
