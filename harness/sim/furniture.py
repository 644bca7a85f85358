"""Table, wall and floor: as data, and drawn with the lights, plain or as a scene has them.

Wall and table top have a second, textured form each, made once; a new scene uploads its image into
it. Nothing here holds state of a trial: `dress` sets all that a scene can change.
"""

import math

import numpy as np
import sapien
from numpy.typing import NDArray

from robospa.geometry import Pose, look_rotation
from robospa.harness import textures
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.sim.cameras import add_copies
from robospa.harness.sim.render_bodies import image_texture, render_body, textured_body
from robospa.harness.textures.field import SIZE
from robospa.tasks.colors import TABLE_COLOR
from robospa.tasks.scene import WHITE, Lights, Surroundings, Texture
from robospa.tasks.shapes import Box, Color, Shape
from robospa.workcell import WORKCELL, TableGeometry

LEGS: Color = (0.86, 0.86, 0.85)
WALL: Color = (1.0, 0.9, 0.9)
FLOOR: Color = (0.15, 0.18, 0.21)

LEG = 0.05
"""Side of the square legs, and how far they stand in from the edge [m]."""


def table(dimensions: TableGeometry) -> tuple[Shape, ...]:
    """Top and four legs; the frame's origin is on the floor below the table's centre."""
    width, depth = dimensions.size
    under = dimensions.top - dimensions.thickness
    top = Shape(
        Box((width / 2, depth / 2, dimensions.thickness / 2)),
        Pose((0.0, 0.0, dimensions.top - dimensions.thickness / 2)),
        TABLE_COLOR,
    )
    x, y = width / 2 - LEG - LEG / 2, depth / 2 - LEG - LEG / 2
    legs = tuple(
        Shape(Box((LEG / 2, LEG / 2, under / 2)), Pose((a * x, b * y, under / 2)), LEGS)
        for a in (-1, 1)
        for b in (-1, 1)
    )
    return (top, *legs)


def wall() -> tuple[Shape, ...]:
    """Behind the table, its front at y = 0.4."""
    return (Shape(Box((3.0, 0.6, 1.5)), Pose((0.0, 1.0, 1.5)), WALL),)


def floor() -> tuple[Shape, ...]:
    """A slab below z = 0, only drawn."""
    return (Shape(Box((4.0, 4.0, 0.01)), Pose((0.0, 0.0, -0.01)), FLOOR, collision=False),)


AMBIENT = 0.5
SUN_DIRECTION = (0.0, 0.5, -1.0)
LAMPS = ((1.0, 0.0, 1.8), (-1.0, 0.0, 1.8))
"""Ambient light, the directional light's way and the lamps' places [m] (official)."""
SHADOW_HALF, SHADOW_SIZE = 0.64, 384
"""Half the side [m] of what the sun's shadow map covers, and its side [px]: 3.3 mm a pixel."""
SHADOW_CENTRE = (0.0, -0.367, 1.317)
"""Middle of the map [m]: it covers the whole table, the floor before it down to where robots stand
and the wall up to 1 m; things further out are lit and throw no shadow."""
LAMP_SIZE = 320
LAMP_TILT, LAMP_VIEW = math.radians(38.0), math.radians(50.0)
"""How far from the vertical the lamps' shadow maps look towards the table, and their field of view:
they cover table and wall, 4 mm a pixel. The lamps shine in all directions."""
GAMMA = 2.2
FLICKER = 0.1
"""A flickering scene's ambient light is at most so much off (official: one step of its walk)."""


class Surface:
    """Boxes that are drawn plain, or the first of them with an image over each of its faces."""

    def __init__(
        self, scene: sapien.Scene, shapes: tuple[Shape, ...], name: str, copies: int
    ) -> None:
        self._scene, self._shapes, self._name, self._copies = scene, shapes, name, copies
        self._plain = render_body(shapes, name, copies)
        self._textured: sapien.Entity | None = None
        self._image: sapien.render.RenderTexture2D | None = None
        self.shown = self._plain
        add_copies(scene, self.shown)

    def show(self, image: NDArray[np.uint8] | None) -> None:
        """With this sRGB image (height, width, 3), or plain."""
        wanted = self._plain if image is None else self._with(image)
        if wanted is not self.shown:
            self._scene.remove_entity(self.shown)
            add_copies(self._scene, wanted)
            self.shown = wanted

    def _with(self, image: NDArray[np.uint8]) -> sapien.Entity:
        pixels = np.dstack([image, np.full(image.shape[:2], 255, np.uint8)])
        if self._image is None:
            self._image = image_texture(pixels)
            self._textured = textured_body(self._shapes, self._name, self._image, self._copies)
        else:
            self._image.upload(pixels)
        return self._textured

    def draw_last(self) -> None:
        """Come behind all else that is in the scene by now."""
        self._scene.remove_entity(self.shown)
        add_copies(self._scene, self.shown)

    def place(self, pose: Pose) -> None:
        """Stand there, plain or not."""
        for entity in (self._plain, self._textured):
            if entity is not None:
                entity.pose = to_sapien(pose)


class DrawnFurniture:
    """Table, wall, floor and lights of a drawn scene.

    ValueError if the user's folder of textures is not as it should be.
    """

    def __init__(self, scene: sapien.Scene, copies: int = 1) -> None:
        self.textures = textures.source()
        self._scene = scene
        self._wall = Surface(scene, wall(), "wall", copies)
        self._table = Surface(scene, table(WORKCELL.table), "table", copies)
        self._floor = Surface(scene, floor(), "floor", copies)
        usual = Lights()
        self._sun = scene.add_directional_light(
            SUN_DIRECTION,
            usual.sun,
            shadow=True,
            shadow_scale=SHADOW_HALF,
            shadow_near=-2.0,
            shadow_far=4.0,
            shadow_map_size=SHADOW_SIZE,
        )
        upright = look_rotation(SUN_DIRECTION, (-1.0, 0.0, 0.0))  # the map's rows run along x
        self._sun.entity.pose = to_sapien(Pose(SHADOW_CENTRE, upright))
        self._lamps = [self._lamp(at, color) for at, color in zip(LAMPS, usual.lamps, strict=True)]
        self._ambient = AMBIENT
        scene.set_ambient_light([AMBIENT] * 3)

    def _lamp(
        self, at: tuple[float, float, float], color: tuple[float, float, float]
    ) -> sapien.render.RenderSpotLightComponent:
        way = (-at[0] * math.sin(LAMP_TILT), 0.0, -math.cos(LAMP_TILT))
        lamp = self._scene.add_spot_light(
            at, way, LAMP_VIEW, LAMP_VIEW, color, shadow=True,
            shadow_near=0.3, shadow_far=4.0, shadow_map_size=LAMP_SIZE,
        )  # fmt: skip
        lamp.entity.pose = to_sapien(Pose(at, look_rotation(way, (0.0, 1.0, 0.0))))
        return lamp

    def sky(self) -> NDArray[np.uint8]:
        """Colour (3,) of what lies outside the room: that of the ambient light."""
        return np.full(3, round(255 * min(1.0, self._ambient) ** (1 / GAMMA)), dtype=np.uint8)

    def dress(self, surroundings: Surroundings, table_at: tuple[float, float, float]) -> None:
        """As a scene has it; `table_at` [m] is how far the table is from its usual place."""
        self._wall.show(self._image(surroundings.wall))
        self._table.show(self._image(surroundings.table))
        self._table.place(Pose(table_at))
        self._shine(surroundings.lights, AMBIENT)

    def table(self) -> sapien.Entity:
        """The table as it is shown."""
        return self._table.shown

    def draw_last(self) -> None:
        """Be drawn behind all that is in the scene by now: what it hides then costs nothing."""
        for surface in (self._table, self._wall, self._floor):
            surface.draw_last()

    def light(self, lights: Lights, step: int) -> None:
        """As it is at this physics step of a trial: nothing to do but where lights flicker."""
        if lights.flicker is not None:
            rng = np.random.default_rng([lights.flicker, step])
            (sun, left, right), off = rng.random((3, 3)).tolist(), rng.uniform(-FLICKER, FLICKER)
            self._shine(Lights(tuple(sun), (tuple(left), tuple(right))), AMBIENT + float(off))

    def _shine(self, lights: Lights, ambient: float) -> None:
        self._ambient = ambient
        self._scene.set_ambient_light([ambient] * 3)
        self._sun.color = lights.sun
        for lamp, color in zip(self._lamps, lights.lamps, strict=True):
            lamp.color = color

    def _image(self, texture: Texture | None) -> NDArray[np.uint8] | None:
        if texture is None or texture.split != WHITE:
            return None if texture is None else self.textures.image(texture)
        return np.full((SIZE, SIZE, 3), 255, dtype=np.uint8)
