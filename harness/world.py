"""The interface of a world: the only thing that knows the simulator.

`SapienWorld` (`robospa.harness.sim.sapien_world`) is the first implementation.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose, Vec3, rotate
from robospa.observation import CameraSpec, Observation
from robospa.protocol.policy import PolicySpec
from robospa.results.records.action_problems import ProblemKind
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Contact, Snapshot

ROBOT_ASSETS = ("builtin", "official", "official-full")
"""What robots are drawn with: our shapes, or the vendors' meshes, thinned or in full."""
Poll = Callable[[Snapshot], bool]
"""Called at 50 Hz of simulated time; returning True ends the action at once."""


class SceneUnstable(Exception):
    """The scene did not come to rest: this seed is not valid."""


class ActionError(Exception):
    """The policy's action cannot be executed; the message says which part and why."""


class RenderUnavailable(Exception):
    """No image can be drawn on this machine; the message says why and what to do."""


@dataclass(frozen=True)
class ActionProblem:
    """What of an action was executed otherwise than it was sent: which arm, what was asked for."""

    kind: ProblemKind
    text: str


@dataclass(frozen=True)
class StepResult:
    """One executed action: how many physics steps it took, and whether the poll ended it.
    `problems` says what was executed otherwise than it was sent: clipped, or not at all. Of a pose
    action `joints` (D,) is the joint action that was executed in its place."""

    physics_steps: int
    stopped: bool
    problems: tuple[ActionProblem, ...] = ()
    joints: NDArray[np.float32] | None = None


JOINTS_FROM_EE = "joint_of_ee"
"""Joint actions that were executed in the place of `ee` actions, to be played again: like those,
and unlike a policy's joint actions, they begin where the arms are, not where they should be."""
FROM_MEASURED = ("ee", JOINTS_FROM_EE)
"""Actions that begin where the arms are."""


TABLE, OTHER = -1, -2
"""What a pixel shows besides objects: the table's top; anything else or nothing."""


@dataclass(frozen=True)
class CameraView:
    """Where a camera is: `pose` in the world (x forward, y left, z up), vertical field of view
    [rad], near plane [m] and width of the picture over its height.

    A place in the picture is u to the right and v down, from its upper left corner, both 0 to 1.
    """

    pose: Pose
    fov: float
    near: float
    aspect: float = 4 / 3

    def pixel(self, point: Vec3) -> tuple[float, float] | None:
        """Where (u, v) a point [m, world] is seen, perhaps outside the picture; None behind it."""
        x, y, z = self.pose.inverse().apply(point)
        if x < self.near:
            return None
        half = x * math.tan(self.fov / 2)
        return 0.5 - 0.5 * y / (half * self.aspect), 0.5 - 0.5 * z / half

    def onto(self, u: float, v: float, height: float) -> Vec3 | None:
        """The point [m, world] seen at (u, v) of the level at `height`, as `Scene.table_top` is;
        None if the level is not seen there."""
        half = math.tan(self.fov / 2)
        way = (1.0, (1 - 2 * u) * half * self.aspect, (1 - 2 * v) * half)
        x, y, z = rotate(self.pose.rotation, way)
        at = self.pose.position
        far = (height - at[2]) / z if z else -1.0
        return (at[0] + far * x, at[1] + far * y, height) if far > 0 else None


class RenderableState(Protocol):
    """What an instant of a world looks like; equal ones have equal images."""

    def draw(self, cameras: Sequence[CameraSpec]) -> list[NDArray[np.uint8]]:
        """Its images, uint8 (height, width, 3), while the world has the same scene loaded; raises
        RenderUnavailable."""


class World(Protocol):
    """One simulated table with robot. Not thread-safe; one trial at a time."""

    def load(self, scene: Scene, contacts: bool = False) -> None:
        """Build `scene` afresh and settle it; nothing of an earlier trial survives. Simulated time
        is 0 afterwards. `contacts`: fill `Snapshot.contacts` when polling (costs time). Raises
        SceneUnstable."""

    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        """Execute one policy action of `space` "joint", "ee" or "delta_ee", or when a trial is
        played again JOINTS_FROM_EE; raises ActionError. `poll` is called whenever simulated time
        passes a multiple of 1/50 s. After a refused action (ActionError) nothing has moved."""

    def observe(self, spec: PolicySpec) -> Observation:
        """The observation that `spec` asks for, at this instant: see `robospa.observation`."""

    def render(self, camera: CameraSpec) -> NDArray[np.uint8]:
        """One RGB image, uint8 of shape (height, width, 3); raises RenderUnavailable."""

    def identify(self, camera: CameraSpec) -> NDArray[np.int16]:
        """What each pixel of its image shows, (height, width): an index in `scene.everything`, or
        TABLE or OTHER. Doors and handles are their object's. Raises RenderUnavailable."""

    def view(self, camera: CameraSpec) -> CameraView:
        """Where this camera is at this instant: which points its pixels show."""

    def still(self) -> RenderableState:
        """This instant, to be drawn later or never: as cheap as drawing is expensive."""

    def snapshot(self) -> Snapshot:
        """The state at this instant (contacts included if `load` was asked for them)."""

    def contacts(self) -> tuple[Contact, ...]:
        """All contacts at this instant, for rare queries: independent of the argument of `load`."""

    def digest(self) -> str:
        """Hash of the exact state (poses, velocities, joints): equal only if equal to the bit."""

    def info(self) -> Mapping[str, object]:
        """Simulator, version, device and renderer, for the run's manifest."""

    def close(self) -> None:
        """Free the simulator's resources."""
