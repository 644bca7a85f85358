"""The world on SAPIEN: CPU PhysX at 250 Hz, official action timing, images only when asked for.

A trial gets a fresh physics scene; what it draws with (`robospa.harness.sim.renderer`) is made on
the first image and holds no physical state. All drive targets of an action are computed before its
first physics step, and between two polls there is nothing but SAPIEN's own calls.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose
from robospa.harness import world
from robospa.harness.action_decoder import ActionDecoder
from robospa.harness.robots import embodiment as embodiment_named
from robospa.harness.sim import motion
from robospa.harness.sim.bodies import DENSITY
from robospa.harness.sim.lazy_snapshot import LazySnapshot, Pair, PoseTable, StateLayout, unpack
from robospa.harness.sim.physics import Drives, Physics, settle
from robospa.observation import CameraSpec, Observation
from robospa.protocol.policy import PolicySpec
from robospa.tasks.environment_state import EnvironmentState
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Contact, Snapshot, snapshot_to_json

if TYPE_CHECKING:
    from robospa.harness.sim.renderer import Links, Renderer

POLL_STEPS = 5
"""Physics steps between two polls (50 Hz)."""
CONTROLS = ("rest_to_rest", "fixed_rate")


class SapienWorld:
    """A `robospa.harness.world.World`.

    `render`: False never draws, True opens the renderer at once (and fails at once where there is
    none), None opens it when the first image is asked for. `control`: "rest_to_rest" is the
    official timing; "fixed_rate" lets every action last `action_steps` physics steps. `limits`,
    if not those of a policy's actions, are for recording demonstrations. `robot_assets` other than
    "builtin" draws robots with the vendors' meshes of the official archive, thinned or in full; it
    changes pictures alone.
    """

    def __init__(
        self,
        render: bool | None = None,
        control: str = "rest_to_rest",
        action_steps: int = 10,
        limits: motion.SpeedLimits = motion.ACTION_LIMITS,
        robot_assets: str = "builtin",
    ) -> None:
        if robot_assets not in world.ROBOT_ASSETS:
            known = ", ".join(world.ROBOT_ASSETS)
            raise ValueError(f"no robot assets {robot_assets!r}; there are {known}")
        self._robot_assets = robot_assets
        if control not in CONTROLS:
            raise ValueError(f"no control {control!r}; there are {' and '.join(CONTROLS)}")
        if action_steps < 1:
            raise ValueError(f"action_steps is {action_steps}; it must be at least 1")
        self._render = render
        self._control = control
        self._action_steps = action_steps
        self._limits = limits
        self._physics: Physics | None = None
        self._renderer: Renderer | None = None
        self._decoders: dict[str, ActionDecoder] = {}
        if render:
            self._open_renderer()

    # -- loading ------------------------------------------------------------------------------

    def load(self, scene: Scene, contacts: bool = False) -> None:
        """Build `scene` afresh, put the arms at home with open grippers, let everything settle.

        Time is 0 afterwards. Raises SceneUnstable, naming the object that still moves after one
        second or has left the table; ValueError for an unknown asset or embodiment.
        """
        self._drop_physics()
        self._embodiment = embodiment_named(scene.embodiment)
        if scene.embodiment not in self._decoders:
            self._decoders[scene.embodiment] = ActionDecoder(self._embodiment)
        self._decoder = self._decoders[scene.embodiment]
        self._scene = scene
        self._objects: EnvironmentState | None = None
        self._contacts = contacts
        self._steps = 0
        physics = self._physics = Physics(self._embodiment, scene.table_at)
        grip = 1 - scene.strengths.get("weak-grip", 0.0) / 100
        self._drives = Drives(self._embodiment, physics.arms, grip)
        self._layout = StateLayout(
            tuple(
                (physics.links[a][arm.last_link], arm.tool)
                for a, arm in enumerate(self._embodiment.arms)
            ),
            self._embodiment.action_space("joint").joints,
            self._embodiment.grippers,
        )
        self._later = sorted(
            (math.ceil(item.appears_at * motion.RATE - 1e-9), i)
            for i, item in enumerate(scene.everything)
            if item.appears_at is not None
        )
        for i, item in enumerate(scene.everything):
            if item.appears_at is None:
                self._create(physics, i)
        try:
            settle(physics, f"{scene.task} level {scene.level} seed {scene.seed}")
        except world.SceneUnstable:
            self._drop_physics()
            raise
        self._appear(physics)

    def _create(self, physics: Physics, index: int) -> None:
        """Number `index` of everything in the scene comes into existence.

        Clutter weighs what its volume of water does (official), objects what their models say.
        """
        item = self._scene.everything[index]
        model = object_model(item.asset, item.params)
        density = DENSITY if index >= len(self._scene.objects) else None
        physics.add_object(item.name, model, item.pose, item.fixed, density)

    def _appear(self, physics: Physics) -> None:
        while self._later and self._later[0][0] <= self._steps:
            self._create(physics, self._later.pop(0)[1])

    # -- acting -------------------------------------------------------------------------------

    def step(self, action: NDArray[np.float32], space: str, poll: world.Poll) -> world.StepResult:
        """Execute one action; see `robospa.harness.action_decoder` for what is clipped and refused.

        `poll` gets a snapshot whenever simulated time passes a multiple of POLL_STEPS steps; if it
        returns True the arms are told to stay where they were told to be, and the action ends.
        """
        physics = self.loaded()
        drives = self._drives
        goals = self._decoder.decode(action, space, drives.joints)
        start = (
            self._measured_start(goals.joints) if space in world.FROM_MEASURED else drives.joints
        )
        change = (start, goals.joints, drives.gripper, goals.gripper, drives.opening)
        if self._control == "rest_to_rest":
            path = motion.rest_to_rest(*change, self._limits)
        else:
            path = motion.fixed_rate(*change, self._action_steps)
        done, stopped = self._follow(physics, path, poll)
        joints = None if space == "joint" else self._decoder.joint_action(goals)
        return world.StepResult(done, stopped, goals.problems, joints)

    def _measured_start(self, goals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where the arms are, (2, J) [rad]: pose actions are planned from there (official). An arm
        whose goal is what it was commanded to holds that."""
        start = self._drives.joints.copy()
        for a, joints in enumerate(self._drives.measured()):
            if (start[a] != goals[a]).any():
                start[a, : len(joints)] = joints
        return start

    def _follow(
        self, physics: Physics, path: motion.Trajectory, poll: world.Poll
    ) -> tuple[int, bool]:
        """Drive along `path`; physics steps taken and whether `poll` ended it."""
        drives = self._drives
        writers, table = drives.schedule(path)
        total, done, step = len(path), 0, physics.step
        while done < total:
            upto = min(total, done + POLL_STEPS - self._steps % POLL_STEPS)
            if self._later:
                upto = min(upto, done + self._later[0][0] - self._steps)
            for row in table[done:upto].tolist():
                for write, value in zip(writers, row, strict=True):
                    write(value)
                step()
            self._steps += upto - done
            done = upto
            drives.now = (path, done - 1)
            if self._later:
                self._appear(physics)
            if self._steps % POLL_STEPS == 0 and poll(self._snapshot(physics)):
                drives.stop()
                return done, True
        return done, False

    # -- looking ------------------------------------------------------------------------------

    def snapshot(self) -> Snapshot:
        """The state at this instant."""
        seen = self._snapshot(self.loaded())
        _ = seen.measured, seen.contacts  # kept from now on, whatever the world does
        return seen

    def _snapshot(self, physics: Physics) -> Snapshot:
        return LazySnapshot(
            self._steps,
            physics.packed(),
            physics.rows,
            self._layout,
            self._drives.now,
            self._measured_at,
            self._touching_at,
            physics.hinges(),
        )

    def _measured_at(self, steps: int) -> Pair:
        """Measured joints for a poll: read only if asked for, because that costs microseconds."""
        self._still_at(steps)
        return self._drives.measured()

    def _touching_at(self, steps: int) -> tuple[Contact, ...]:
        """Contacts for a poll, likewise; none if `load` was not asked for them."""
        self._still_at(steps)
        return self.loaded().contacts() if self._contacts else ()

    def _still_at(self, steps: int) -> None:
        if steps != self._steps:
            raise RuntimeError(
                "a poll's contacts or measured joints were asked for after the world moved on"
            )

    def observe(self, spec: PolicySpec) -> Observation:
        """Images, state and poses that `spec` asks for; see `robospa.observation`.

        `state` is left out if the spec wants none, `privileged` and `environment_state` unless it
        wants them; TooManyObjects for a scene that has no such state. The caller adds instruction,
        step and history.
        """
        snapshot = self.snapshot()
        images = self.draw(self.still(), spec.cameras) if spec.cameras else []
        out: Observation = {
            "images": {c.name: image for c, image in zip(spec.cameras, images, strict=True)}
        }
        if spec.state != "none":
            out["state"] = self._drives.state(spec.state == "measured")
        out["ee"] = np.array(
            [
                [*snapshot.end_effector[a].position, *snapshot.end_effector[a].rotation, grip]
                for a, grip in enumerate(snapshot.gripper)
            ],
            dtype=np.float32,
        )
        if spec.privileged:
            out["privileged"] = snapshot_to_json(snapshot)
        if spec.environment_state:
            if self._objects is None:
                self._objects = EnvironmentState(self._scene)
            out["environment_state"] = self._objects.row(snapshot)
        return out

    def render(self, camera: CameraSpec) -> NDArray[np.uint8]:
        """One RGB image (height, width, 3); RenderUnavailable where nothing can be drawn."""
        return self.still().draw((camera,))[0]

    def still(self) -> SapienState:
        """This instant, to be drawn while its scene is loaded."""
        physics = self.loaded()
        hinges = tuple(physics.hinges().items())
        lights = self._scene.surroundings.lights
        # Only flickering lights know the time: elsewhere two instants at rest look the same.
        rows, step = physics.rows, self._steps if lights.flicker is not None else 0
        return SapienState(physics.packed(), rows, hinges, step, self, self._scene)

    def draw(self, still: SapienState, cameras: Sequence[CameraSpec]) -> list[NDArray[np.uint8]]:
        """Images of a still of the loaded scene; RuntimeError for that of another one."""
        return self._drawing().render(cameras, *self._posed(still), still.step)

    def identify(self, camera: CameraSpec) -> NDArray[np.int16]:
        """See `robospa.harness.world.World`."""
        return self._drawing().identify(camera, *self._posed(self.still()))

    def view(self, camera: CameraSpec) -> world.CameraView:
        """See `robospa.harness.world.World`."""
        return self._drawing().view(camera, self._posed(self.still())[0])

    def _drawing(self) -> Renderer:
        """The renderer with the loaded scene."""
        self.loaded()
        renderer = self._renderer or self._open_renderer()
        renderer.sync(self._scene, self._embodiment)
        return renderer

    def _posed(self, still: SapienState) -> tuple[Links, PoseTable, dict[str, float]]:
        """Poses of links and objects, and angles of doors and lids [rad]."""
        if still.scene is not self._scene:
            raise RuntimeError("a still was to be drawn after its world had loaded another scene")
        links = [
            {link: unpack(still.packed, row) for link, row in rows.items()}
            for rows in self.loaded().links
        ]
        return links, PoseTable(still.packed, still.rows), dict(still.hinges)

    def _open_renderer(self) -> Renderer:
        if self._render is False:
            raise world.RenderUnavailable(
                "this world was made with render=False and draws no images"
            )
        from robospa.harness.sim.renderer import Renderer

        skins = None
        if self._robot_assets != "builtin":
            from robospa.harness.packs.archive import open_archive
            from robospa.harness.packs.visuals import robot_skins

            full = self._robot_assets == "official-full"
            skins = partial(robot_skins, open_archive(), full=full)
        self._renderer = Renderer(skins)
        return self._renderer

    def bodies(self) -> dict[str, Pose]:
        """World pose of everything that moves; see `Physics.bodies`."""
        return self.loaded().bodies()

    def contacts(self) -> tuple[Contact, ...]:
        """All contacts at this instant."""
        return self.loaded().contacts()

    def digest(self) -> str:
        """Hash of the exact state: poses, velocities, joints."""
        return self.loaded().digest()

    def info(self) -> Mapping[str, object]:
        """Simulator, versions, control, and the render device if it is open."""
        return {
            "simulator": "sapien",
            **versions(),
            "backend": "physx-cpu",
            "physics_hz": motion.RATE,
            "control": self._control,
            **({"action_steps": self._action_steps} if self._control == "fixed_rate" else {}),
            **({} if self._robot_assets == "builtin" else {"robot_assets": self._robot_assets}),
            "renderer": self._renderer.device() if self._renderer else None,
            "textures": self._renderer.textures() if self._renderer else None,
        }

    def close(self) -> None:
        """Free the scenes; the world cannot be used afterwards until it loads again."""
        self._drop_physics()
        if self._renderer:
            self._renderer.close()
            self._renderer = None

    def _drop_physics(self) -> None:
        if self._physics:
            self._physics.close()
            self._physics = None

    def loaded(self) -> Physics:
        """Of the loaded scene; RuntimeError if there is none."""
        if self._physics is None:
            raise RuntimeError("no scene is loaded; call load(scene) first")
        return self._physics


@dataclass(frozen=True)
class SapienState:
    """A `RenderableState`: packed poses of all bodies, the rows of objects and,
    where lights flicker, the physics step."""

    packed: bytes
    rows: Mapping[str, int]
    hinges: tuple[tuple[str, float], ...]
    step: int
    world: SapienWorld = field(compare=False, repr=False)
    scene: Scene = field(compare=False, repr=False)

    def draw(self, cameras: Sequence[CameraSpec]) -> list[NDArray[np.uint8]]:
        return self.world.draw(self, cameras)


def versions() -> dict[str, str]:
    """Versions of SAPIEN and PhysX."""
    import sapien

    return {"sapien": str(sapien.__version__), "physx": str(sapien.physx.version())}
