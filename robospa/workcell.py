"""What scenes are drawn for: the table, the head camera, where two arms stand and how far they get.

There is one `WORKCELL` for all robots, so that every robot meets the same scenes; tasks know no
other. Lengths are metres, angles radians, positions in the world frame: x right, y away from the
robot, z up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from robospa.geometry import Pose, Vec3, look_rotation

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Gripper:
    """A parallel gripper in its end-effector frame: x is the approach, y the closing direction.

    The grasp centre, between the fingers, lies `grasp_centre` ahead of the frame; the fingertips
    are `fingertip` farther ahead. Skills hold things `hold` behind the fingertips. `opening` is the
    greatest width between the fingers that skills use; closed, they are `gap` apart.
    """

    grasp_centre: float
    opening: float
    fingertip: float
    hold: float
    finger_half_width: float
    finger_thickness: float
    radius: float
    """How far around the approach axis nothing may stand when the gripper moves sideways."""
    palm_back: tuple[float, ...]
    """How far behind the fingertips the palm is looked at when neighbours are avoided."""
    palm_half: tuple[float, float]
    """How far the palm reaches along the closing direction, and across it."""
    hand_back: float
    """How far behind the fingertips the hand is."""
    hand_half: tuple[float, float]
    """How far the hand reaches along the closing direction, and across it."""
    wrist_back: float
    """How far behind the fingertips the wrist is."""
    wrist_half: float
    """How far the wrist reaches to any side."""
    gap: float = 0.0

    @property
    def tip(self) -> float:
        """How far ahead of the end-effector frame the fingertips are."""
        return self.grasp_centre + self.fingertip

    @property
    def grip(self) -> float:
        """How far ahead of the end-effector frame the point is at which skills hold things."""
        return self.tip - self.hold

    def grasp_point(self, end_effector: Pose) -> Vec3:
        """The grasp centre [m, world] of a gripper whose end-effector frame has this pose."""
        w, x, y, z = end_effector.rotation
        px, py, pz = end_effector.position
        ahead = self.grasp_centre
        return (
            px + ahead * (1 - 2 * (y * y + z * z)),
            py + ahead * 2 * (x * y + w * z),
            pz + ahead * 2 * (x * z - w * y),
        )


def grasp_points(grippers: tuple[Gripper, Gripper], ends: tuple[Pose, Pose]) -> tuple[Vec3, Vec3]:
    """Grasp centres [m, world] of both arms at these poses of their end-effector frames."""
    return grippers[0].grasp_point(ends[0]), grippers[1].grasp_point(ends[1])


WIDTH, HEIGHT = 320, 240
"""Size [px] of the image that scenes have to be seen in."""
TABLE_TOP = 0.74
"""Height of the benchmark's table [m], on which scenes are drawn."""


@dataclass(frozen=True)
class TableGeometry:
    """A table: the height of its top and its size in x and y; its middle is at x = y = 0."""

    top: float = TABLE_TOP
    size: tuple[float, float] = (1.2, 0.7)
    thickness: float = 0.05


@dataclass(frozen=True)
class FixedCamera:
    """A camera that does not move; it looks `forward`, `left` is left in its level picture.

    The two directions need not have unit length. `fov` is the vertical field of view.
    """

    position: Vec3
    forward: Vec3
    left: Vec3
    fov: float

    @cached_property
    def pose(self) -> Pose:
        """Pose of the camera: x looks forward, y is left, z is up in the image."""
        return Pose(self.position, look_rotation(self.forward, self.left))

    @cached_property
    def axes(self) -> tuple[Vec3, Vec3, Vec3]:
        """Unit vectors: forward, and right and up in the image."""
        (a, b, c), (d, e, f) = _unit(self.forward), _unit(self.left)
        return (a, b, c), (-d, -e, -f), (b * f - c * e, c * d - a * f, a * e - b * d)

    @cached_property
    def focal(self) -> float:
        """Focal length [px] in an image of HEIGHT."""
        return HEIGHT / 2 / math.tan(self.fov / 2)

    def pixel(self, x: Array, y: Array, z: Array | float) -> tuple[Array, Array]:
        """Column and row [px] of points [m] in an image of WIDTH x HEIGHT."""
        forward, right, _ = self.axes
        depth = self._along(forward, x, y, z)
        column: Array = WIDTH / 2 + self.focal * self._along(right, x, y, z) / depth
        return column, self.row(x, y, z)

    def row(self, x: Array, y: Array, z: Array | float) -> Array:
        """Row [px] of points [m] alone."""
        forward, _, up = self.axes
        depth = self._along(forward, x, y, z)
        row: Array = HEIGHT / 2 - self.focal * self._along(up, x, y, z) / depth
        return row

    def box(
        self, x: Array, y: Array, radius: Array | float, low: Array | float, high: Array | float
    ) -> tuple[Array, Array, Array, Array]:
        """Left, right, top and bottom [px] of upright cylinders at x, y, from `low` to `high` [m].

        Of a camera with a level picture that does not look sideways.
        """
        depth, eye = self._along(self.axes[0], x, y, high), self.position[0]
        left = WIDTH / 2 + self.focal * (x - radius - eye) / depth
        right = WIDTH / 2 + self.focal * (x + radius - eye) / depth
        return left, right, self.row(x, y + radius, high), self.row(x, y - radius, low)

    def _along(self, axis: Vec3, x: Array, y: Array, z: Array | float) -> Any:
        """Component [m] along the unit vector `axis` of the way from the camera to points."""
        (a, b, c), (ex, ey, ez) = axis, self.position
        if a == 1.0:  # samplers ask for millions of points: do only what counts
            return x - ex
        total = b * (y - ey) + c * (z - ez)
        return total + a * (x - ex) if a else total


def _unit(vector: Vec3) -> Vec3:
    x, y, z = vector
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length)


@dataclass(frozen=True)
class ArmSite:
    """Where an arm stands on the plan, and how far it gets.

    `reach` is the farthest planar distance from `base` at which a tilted grasp still gets there;
    `tool_reach` are the distances at which several grasps of a tool (a hammer) do.
    """

    base: tuple[float, float]
    reach: float
    tool_reach: tuple[float, float]


@dataclass(frozen=True)
class Workcell:
    """Two arms, left and right, before a table, and the camera that sees it.

    Beyond `sideways_from` [m, y] an arm cannot close its fingers along its own direction of reach:
    there the closing direction has to be within `sideways_within` [rad] of the x axis. `head` is
    level and looks straight along the table.
    """

    arms: tuple[ArmSite, ArmSite]
    head: FixedCamera
    sideways_from: float
    sideways_within: float
    table: TableGeometry = TableGeometry()

    def in_reach(self, x: Array, y: Array) -> Mask:
        """Whether the nearer arm can grasp at these places, as a boolean array."""
        import numpy as np

        left, right = (np.hypot(x - a.base[0], y - a.base[1]) <= a.reach for a in self.arms)
        reached: Mask = left | right
        return reached

    def in_view(
        self,
        x: Array,
        y: Array,
        radius: Array | float = 0.0,
        height: Array | float = 0.0,
        margin: tuple[float, float] = (0.02, 0.02),
    ) -> Mask:
        """Whether upright cylinders on the table lie inside the head image, as a boolean array.

        `radius` and `height` bound each object; `margin` is the part of the image's width and
        height that stays free on each side.
        """
        low = self.table.top
        left, right, top, bottom = self.head.box(x, y, radius, low, low + height)
        free_x, free_y = margin[0] * WIDTH, margin[1] * HEIGHT
        inside: Mask = (left >= free_x) & (right <= WIDTH - free_x)
        return inside & (top >= free_y) & (bottom <= HEIGHT - free_y)

    def view_span(
        self, y: float, radius: float = 0.0, height: float = 0.0, margin: float = 0.02
    ) -> tuple[float, float]:
        """The x range in which a cylinder of this `radius` and `height` at `y` is in view."""
        camera = self.head
        ex, ey, ez = camera.position
        _, ahead, down = camera.forward
        depth = ahead * (y - ey) - down * (ez - self.table.top - height)
        half = (0.5 - margin) * WIDTH / camera.focal * depth - radius
        return ex - half, ex + half


WORKCELL = Workcell(
    arms=(ArmSite((-0.3, -0.417), 0.69, (0.25, 0.63)), ArmSite((0.3, -0.417), 0.69, (0.25, 0.63))),
    head=FixedCamera((-0.032, -0.45, 1.35), (0, 0.6, -0.8), (-1, 0, 0), math.radians(37)),
    sideways_from=0.02,
    sideways_within=math.radians(40),
)
"""The benchmark's: scenes of every robot are drawn for it. The arms are about where those of the
default robot stand (-0.297 and 0.306), and reach what these do; the head camera is the official one
of all robots."""
