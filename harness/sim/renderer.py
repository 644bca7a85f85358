"""Rendering: a scene that is only drawn, posed like the physics when the picture is taken.

Drawing has its own scene, without physics: a world that never looks pays nothing, and looking
cannot change a trial. Robot, room and cameras stay from trial to trial (they hold no
state); objects are those of the trial. Rasterised with a shader of our own, on any Vulkan device,
Mesa's software one included. A camera that nobody asks for costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import sapien
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.geometry import Pose
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.sim import cameras as pictures
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.sim.furniture import DrawnFurniture
from robospa.harness.sim.render_bodies import render_body
from robospa.harness.sim.vulkan import Device, VulkanError, devices
from robospa.harness.world import OTHER, TABLE, CameraView, RenderUnavailable
from robospa.observation import CameraSpec
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Hinge, Shape, Skin

if TYPE_CHECKING:
    from robospa.harness.packs.visuals import RobotSkins

Links = Sequence[Mapping[str, Pose]]
"""World pose of every link of the left and of the right arm."""

HEAD_NEAR, WRIST_NEAR = 0.1, 0.01
"""[m]: the fingers are nearer to the wrist cameras than the official near plane."""
WRISTS = {f"{arm}_wrist": i for i, arm in enumerate(ARMS)}
LARGEST = 4096
"""[px] of an image's width or height."""
SOFTWARE = "llvmpipe"
"""How the name of Mesa's software device begins, which draws pictures side by side."""
ADVICE = "run `robospa check` to see what is missing"


def open_render_system() -> sapien.render.RenderSystem:
    """A SAPIEN render system; RenderUnavailable, with the reason, where there is no device."""
    try:
        return sapien.render.RenderSystem()
    except RuntimeError as error:
        raise RenderUnavailable(f"cannot draw on this machine ({error}); {ADVICE}") from error


class Renderer:
    """The drawn scene of one world. Raises RenderUnavailable if nothing can be drawn here.

    `skins` gives meshes that are drawn instead of a robot's own shapes.
    """

    def __init__(self, skins: Callable[[Embodiment], RobotSkins] | None = None) -> None:
        self._skins = skins
        self._system = open_render_system()
        self._scene: sapien.Scene = sapien.Scene([self._system])
        self._copies = pictures.MOST if self._system.device.name.startswith(SOFTWARE) else 1
        self._cameras: dict[tuple[CameraSpec, Path], sapien.render.RenderCameraComponent] = {}
        self._robot: list[dict[str, sapien.Entity]] = []
        self._objects: dict[str, sapien.Entity] = {}
        self._parts: dict[str, tuple[sapien.Entity, Hinge]] = {}
        self._loaded: Scene | None = None
        self._embodiment: Embodiment | None = None
        self._stand: sapien.Entity | None = None
        self._room = DrawnFurniture(self._scene, self._copies)
        self._abreast = pictures.TiledRenderer(self._scene)
        self._grew = False

    def _draw(
        self, shapes: Sequence[Shape], name: str, skin: Skin | None = None
    ) -> sapien.Entity | None:
        """An entity in the drawn scene; None if none of the shapes is visual and it has no skin."""
        entity = render_body(shapes, name, self._copies, skin)
        if entity is not None:
            pictures.add_copies(self._scene, entity)
            self._grew = True
        return entity

    def sync(self, scene: Scene, embodiment: Embodiment) -> None:
        """Take the objects of `scene` and the robot; costs nothing if they are here already."""
        new_robot = self._embodiment is not embodiment
        if new_robot:
            self._set_robot(embodiment)
        if self._loaded is not scene or new_robot:
            for name in list(self._objects):
                self._remove(name)
            self._loaded = scene
            self._room.dress(scene.surroundings, scene.table_at)
            self._grew = True

    def _set_robot(self, embodiment: Embodiment) -> None:
        old = [e for links in self._robot for e in links.values()]
        for entity in [*old, *([self._stand] if self._stand is not None else [])]:
            self._scene.remove_entity(entity)
        skins = self._skins(embodiment) if self._skins is not None else None
        self._robot = []
        for a, (name, arm) in enumerate(zip(ARMS, embodiment.arms, strict=True)):
            links = {}
            for link in arm.links:
                skin = skins.arms[a].get(link) if skins is not None else None
                shapes = () if skin is not None else arm.shapes[link]
                entity = self._draw(shapes, f"{name} {link}", skin)
                if entity is not None:
                    links[link] = entity
            self._robot.append(links)
        has_stand = skins is not None and skins.stand
        self._stand = None if has_stand else self._draw(embodiment.body, "stand")
        self._cameras = {}
        self._embodiment = embodiment

    def render(
        self,
        cameras: Sequence[CameraSpec],
        links: Links,
        poses: Mapping[str, Pose],
        hinges: Mapping[str, float] = MappingProxyType({}),
        step: int = 0,
    ) -> list[NDArray[np.uint8]]:
        """One RGB image (height, width, 3) per camera, of the links and objects as posed.

        The lights of some scenes depend on `step`, the physics step of this instant; for the rest
        see `_pose`. ValueError for a camera that this robot does not have, or a size that no image
        can have.
        """
        self._pose(links, poses, hinges)
        if self._loaded is not None:
            self._room.light(self._loaded.surroundings.lights, step)
        return self._take([self.view(spec, links) for spec in cameras], cameras)

    def identify(
        self,
        spec: CameraSpec,
        links: Links,
        poses: Mapping[str, Pose],
        hinges: Mapping[str, float] = MappingProxyType({}),
    ) -> NDArray[np.int16]:
        """What each pixel of that picture shows, (height, width): see `World.identify`."""
        self._pose(links, poses, hinges)
        assert self._loaded is not None
        for index, item in enumerate(self._loaded.everything):
            for entity in (self._objects.get(item.name), self._parts.get(item.name, (None,))[0]):
                if entity is not None:
                    pictures.mark(entity, index + 1)
        table = len(self._loaded.everything) + 1
        pictures.mark(self._room.table(), table)
        camera = self._camera(spec, self.view(spec, links), pictures.IDS)
        self._scene.update_render()
        camera.take_picture()
        number, up = pictures.numbers(camera)
        found = np.where(number == 0, OTHER, number - 1)
        found[number == table] = OTHER
        found[(number == table) & (up > 0)] = TABLE
        return found.astype(np.int16)

    def _pose(self, links: Links, poses: Mapping[str, Pose], hinges: Mapping[str, float]) -> None:
        """Put the links and objects where they are. Doors and lids stand at their angle [rad] in
        `hinges`, closed if that is not given; objects that are not in `poses` do not exist yet."""
        for entities, here in zip(self._robot, links, strict=True):
            for link, entity in entities.items():
                self._place(entity, here[link])
        for name in [name for name in self._objects if name not in poses]:  # of a later instant
            self._remove(name)
        for name, pose in poses.items():
            if name not in self._objects:
                self._objects[name] = self._new_object(name)
            if self._objects[name] is not None:
                self._place(self._objects[name], pose)
            if name in self._parts:
                part, hinge = self._parts[name]
                self._place(part, pose * hinge.turned(hinges.get(name, 0.0)))
        if self._grew:
            self._room.draw_last()
            self._grew = False

    def _take(
        self, views: Sequence[CameraView], cameras: Sequence[CameraSpec]
    ) -> list[NDArray[np.uint8]]:
        sky, taken = self._room.sky(), dict[int, NDArray[np.uint8]]()
        alone = {}
        for row in pictures.rows(cameras):
            if len(row) == 1 or self._copies == 1:
                alone.update({index: self._camera(cameras[index], views[index]) for index in row})
            else:
                size = cameras[row[0]].width, cameras[row[0]].height
                images = self._abreast.draw([views[index] for index in row], *size, sky)
                taken.update(zip(row, images, strict=True))
        if alone:
            self._scene.update_render()
        for camera in alone.values():  # the device draws one while the next is handed over
            camera.take_picture()
        taken.update({index: pictures.pixels(camera, sky)[0] for index, camera in alone.items()})
        return [taken[index] for index in range(len(cameras))]

    def _remove(self, name: str) -> None:
        for entity in (self._objects.pop(name), self._parts.pop(name, (None,))[0]):
            if entity is not None:
                self._scene.remove_entity(entity)

    def _new_object(self, name: str) -> sapien.Entity | None:
        assert self._loaded is not None
        item = self._loaded.object(name)
        model = object_model(item.asset, item.params)
        if model.hinge is not None:
            self._parts[name] = (
                self._draw(model.hinge.shapes, f"{name} part", model.hinge.skin),
                model.hinge,
            )
        return self._draw(model.shapes, name, model.skin)

    @staticmethod
    def _place(entity: sapien.Entity, pose: Pose) -> None:
        entity.pose = to_sapien(pose)

    def view(self, spec: CameraSpec, links: Links) -> CameraView:
        """Where the camera of this picture is; ValueError as for `render`."""
        assert self._embodiment is not None
        if not (0 < spec.width <= LARGEST and 0 < spec.height <= LARGEST):
            raise ValueError(
                f"camera {spec.name!r} cannot be {spec.width}x{spec.height}; "
                f"sizes are 1 to {LARGEST}"
            )
        view = camera_view(self._embodiment, spec.name, links)
        view = replace(view, aspect=spec.width / spec.height)
        if self._loaded is None:
            return view
        if spec.name == "head":
            return replace(view, pose=Pose(self._loaded.surroundings.camera_shift) * view.pose)
        if spec.name in WRISTS and any(shift := self._loaded.wrist_shifts[WRISTS[spec.name]]):
            return replace(view, pose=view.pose * Pose(shift))
        return view

    def _camera(
        self, spec: CameraSpec, view: CameraView, shader: Path = pictures.SHADER
    ) -> sapien.render.RenderCameraComponent:
        """The camera of `spec`, made on first use and put there."""
        key = (spec, shader)
        if key not in self._cameras:
            camera = pictures.new_camera(self._scene, spec.width, spec.height, str(shader))
            camera.set_fovy(view.fov, compute_x=True)
            camera.near, camera.far = view.near, pictures.FAR
            self._cameras[key] = camera
        camera = self._cameras[key]
        self._place(camera.entity, view.pose)
        return camera

    def textures(self) -> Mapping[str, object]:
        """Where the images of randomised scenes come from."""
        return self._room.textures.about()

    def device(self) -> Mapping[str, str]:
        """Name of the device that draws, its driver and the driver's version."""
        name = str(self._system.device.name)
        try:
            found = [device for device in devices() if device.name == name]
        except VulkanError:
            found = []
        return asdict(found[0] if found else Device(name, "", ""))

    def close(self) -> None:
        """Free what was drawn."""
        self._cameras, self._objects, self._parts, self._robot = {}, {}, {}, []
        self._stand = None
        self._scene.clear()


def camera_view(embodiment: Embodiment, name: str, links: Links) -> CameraView:
    """Where this camera of a robot is, in the world.

    ValueError, listing the cameras there are, for a name that this robot does not have.
    """
    if name in WRISTS:
        arm = embodiment.arms[WRISTS[name]]
        pose = links[WRISTS[name]][arm.last_link] * arm.camera
        return CameraView(pose, arm.wrist_fov, WRIST_NEAR)
    fixed_cameras = embodiment.cameras
    if name in fixed_cameras:
        fixed = fixed_cameras[name]
        return CameraView(fixed.pose, fixed.fov, HEAD_NEAR)
    known = ", ".join([*fixed_cameras, *WRISTS])
    raise ValueError(f"{embodiment.name} has no camera {name!r}; it has {known}")
