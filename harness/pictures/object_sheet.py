"""Look at the object library: every look of every asset alone, and all of them on one sheet.

`python -m robospa.harness.pictures.object_sheet OUT [ASSET ...]` writes OUT/<asset>.png, a row of
looks (large, and below as the head camera would see it in a 320x240 frame, magnified), and
OUT/sheet.png with the first look of every asset. Needs a device that draws.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, Vec3, look_rotation, yaw_rotation
from robospa.tasks.objects import assets, object_model, variant_count
from robospa.tasks.shapes import Hinge, ObjectModel, Shape
from robospa.workcell import TABLE_TOP

if TYPE_CHECKING:
    import sapien
    from PIL import Image

HEAD = (-0.032, -0.45, 1.35)
"""Where the head camera is [m] (official)."""
FOV = math.radians(37.0)
LARGE, ZOOM = 256, 4
"""Size of a portrait [px]; magnification of the cut from the head camera's frame."""
TALL, FLOOR = 0.3, (0.0, -1.3, 0.0)
"""Objects higher than this [m] stand on the floor, there."""
PLACE: Vec3 = (0.0, -0.05, TABLE_TOP)
TURN = 0.45
"""Yaw [rad] at which objects are shown, so that two sides are seen."""
COLUMNS = 7


class Booth:
    """A table with the official lights, on which one object at a time is photographed."""

    def __init__(self) -> None:
        import sapien

        from robospa.harness.sim.drawn_room import DrawnRoom
        from robospa.harness.sim.render_bodies import render_body
        from robospa.harness.sim.renderer import open_render_system

        self._render_body = render_body
        self._scene = sapien.Scene([open_render_system()])
        self._room = DrawnRoom(self._scene)
        self._near = self._camera(LARGE, LARGE)
        self._head = self._camera(320, 240)

    def _camera(self, width: int, height: int) -> sapien.render.RenderCameraComponent:
        from robospa.harness.sim.cameras import new_camera

        camera = new_camera(self._scene, width, height)
        camera.set_fovy(FOV, compute_x=True)
        camera.near, camera.far = 0.01, 100.0
        return camera

    def portrait(
        self, model: ObjectModel, turn: float = TURN
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """(large picture, magnified cut of the head camera's frame), both uint8 RGB, square."""
        from robospa.harness.sim.bodies import to_sapien

        shapes = (*model.shapes, *_opened(model.hinge))
        entity = self._render_body(shapes, model.asset)
        if entity is None:
            raise ValueError(f"asset {model.asset!r} has no visual shape to draw")
        place = FLOOR if model.size[2] > TALL else PLACE
        origin = (place[0], place[1], place[2] - model.bottom)
        entity.pose = to_sapien(Pose(origin, yaw_rotation(turn)))
        self._scene.add_entity(entity)
        middle = np.array((place[0], place[1], place[2] + model.size[2] / 2))
        reach = 0.62 * float(np.linalg.norm(model.size)) / math.tan(FOV / 2)
        eye = np.array(HEAD) + np.array(place) - np.array(PLACE)
        toward = eye - middle
        toward /= np.linalg.norm(toward)
        self._near.entity.pose = to_sapien(_looking(middle + toward * max(reach, 0.12), middle))
        self._head.entity.pose = to_sapien(_looking(eye, middle))
        self._scene.update_render()
        large, frame = self._take(self._near), self._take(self._head)
        self._scene.remove_entity(entity)
        zoom = ZOOM if model.radius < 0.07 else ZOOM // 2 if model.radius < 0.15 else 1
        side = min(LARGE // zoom, 240)
        top, left = (240 - side) // 2, (320 - side) // 2
        cut = frame[top : top + side, left : left + side]
        shown = np.full((LARGE, LARGE, 3), 255, dtype=np.uint8)
        shown[: side * zoom, : side * zoom] = cut.repeat(zoom, axis=0).repeat(zoom, axis=1)
        return large, shown

    def _take(self, camera: sapien.render.RenderCameraComponent) -> NDArray[np.uint8]:
        from robospa.harness.sim.cameras import pixels

        camera.take_picture()
        return pixels(camera, self._room.sky())


def _opened(hinge: Hinge | None) -> tuple[Shape, ...]:
    """A door's shapes, half open: both its sides and what is behind it are seen."""
    if hinge is None:
        return ()
    turn = hinge.turned(hinge.upper / 2)
    return tuple(replace(shape, pose=turn * shape.pose) for shape in hinge.shapes)


def _looking(eye: NDArray[np.float64], target: NDArray[np.float64]) -> Pose:
    forward = target - eye
    left = np.cross((0.0, 0.0, 1.0), forward)
    return Pose((float(eye[0]), float(eye[1]), float(eye[2])), look_rotation(forward, left))


def asset_row(booth: Booth, asset: str) -> NDArray[np.uint8]:
    """All looks of `asset`: portraits above, head camera cuts below."""
    pairs = [booth.portrait(object_model(asset, {"look": k})) for k in range(variant_count(asset))]
    return np.concatenate([np.concatenate(pair, axis=0) for pair in pairs], axis=1)


def sheet(booth: Booth, names: Sequence[str]) -> Image.Image:
    """The first look of every asset of `names` in a grid, each with its name."""
    from PIL import Image, ImageDraw

    rows = math.ceil(len(names) / COLUMNS)
    page = Image.new("RGB", (COLUMNS * LARGE, rows * (LARGE + 20)), "white")
    draw = ImageDraw.Draw(page)
    for i, name in enumerate(names):
        x, y = i % COLUMNS * LARGE, i // COLUMNS * (LARGE + 20)
        page.paste(Image.fromarray(booth.portrait(object_model(name))[0]), (x, y))
        draw.text((x + 6, y + LARGE + 4), f"{name} ({variant_count(name)} looks)", fill="black")
    return page


def write(out: Path, names: Iterable[str] = ()) -> list[Path]:
    """Write the pictures of `names` (default: all, and the sheet) into `out`; their paths."""
    from PIL import Image

    out.mkdir(parents=True, exist_ok=True)
    chosen = tuple(names) or assets()
    booth = Booth()
    written = []
    for name in chosen:
        written.append(out / f"{name}.png")
        Image.fromarray(asset_row(booth, name)).save(written[-1])
    written.append(out / "sheet.png")
    sheet(booth, chosen).save(written[-1])
    return written


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python -m robospa.harness.pictures.object_sheet OUT [ASSET ...]")
    for path in write(Path(sys.argv[1]), sys.argv[2:]):
        print(path)
