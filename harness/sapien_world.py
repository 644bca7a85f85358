"""The world on SAPIEN: CPU PhysX at 250 Hz, official action timing, images only when asked for.

A trial gets a fresh physics scene; what it draws with (`robospa.harness.cameras`) is made on the
first image and holds no physical state. All drive targets of an action are computed before its
first physics step, and between two polls there is nothing but SAPIEN's own calls.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robospa.harness.actions import ActionReader
from robospa.harness.motion import RATE, Trajectory, fixed_rate, rest_to_rest
from robospa.harness.physics import FLOATS, Physics, unpack
from robospa.harness.robots import embodiment as embodiment_named
from robospa.harness.world import Poll, RenderUnavailable, SceneUnstable, StepResult
from robospa.protocol.policy import CameraSpec, PolicySpec
from robospa.tasks.geometry import Pose
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import ObjectModel
from robospa.tasks.snapshot import Snapshot, snapshot_to_json

if TYPE_CHECKING:
    from robospa.harness.cameras import Studio

Array = NDArray[np.float64]
Models = Callable[[str, Mapping[str, Any]], ObjectModel]

POLL_STEPS = 5
"""Physics steps between two polls (50 Hz)."""
CONTROLS = ("rest_to_rest", "fixed_rate")

SETTLE_WINDOW = 25
SETTLE_WINDOWS = 10
"""At most this many windows of SETTLE_WINDOW steps: 1 s of simulated time."""
QUIET_WINDOWS = 2
REST_DISTANCE = 2e-4  # [m] in one window
REST_ANGLE = math.radians(0.2)  # in one window
FALLEN = 0.5  # [m] an object whose origin is below this is not on the table


@dataclass(frozen=True)
class _Writers:
    """SAPIEN's setters of one arm's drives, and where its joints are in qpos."""

    position: list[Callable[[float], None]]
    velocity: list[Callable[[float], None]]
    fingers: list[Callable[[float], None]]
    columns: list[int]
    finger_columns: list[int]


class SapienWorld:
    """A `robospa.harness.world.World`.

    `render`: False never draws, True opens the renderer at once (and fails at once where there is
    none), None opens it when the first image is asked for. `control`: "rest_to_rest" is the
    official timing; "fixed_rate" lets every action last `action_steps` physics steps. `models`
    makes an object's shapes from asset name and parameters.
    """

    def __init__(
        self,
        render: bool | None = None,
        control: str = "rest_to_rest",
        action_steps: int = 10,
        models: Models | None = None,
    ) -> None:
        if control not in CONTROLS:
            raise ValueError(f"no control {control!r}; there are {' and '.join(CONTROLS)}")
        if action_steps < 1:
            raise ValueError(f"action_steps is {action_steps}; it must be at least 1")
        self._render = render
        self._control = control
        self._action_steps = action_steps
        self._models = models
        self._physics: Physics | None = None
        self._studio: Studio | None = None
        self._readers: dict[str, ActionReader] = {}
        if render:
            self._open_studio()

    # -- loading ------------------------------------------------------------------------------

    def load(self, scene: Scene, contacts: bool = False) -> None:
        """Build `scene` afresh, put the arms at home with open grippers, let everything settle.

        Time is 0 afterwards. Raises SceneUnstable, naming the object that still moves after one
        second or has left the table; ValueError for an unknown asset or embodiment.
        """
        self._drop_physics()
        self._embodiment = embodiment_named(scene.embodiment)
        self._reader = self._readers.setdefault(scene.embodiment, ActionReader(self._embodiment))
        self._scene = scene
        self._contacts = contacts
        self._steps = 0
        physics = self._physics = Physics(self._embodiment, scene.table_shift)
        self._arrange_arms(physics)
        self._later = sorted(
            (math.ceil(item.appears_at * RATE - 1e-9), i)
            for i, item in enumerate(scene.objects)
            if item.appears_at is not None
        )
        for i, item in enumerate(scene.objects):
            if item.appears_at is None:
                self._create(physics, i)
        self._settle(physics)
        self._appear(physics)

    def _arrange_arms(self, physics: Physics) -> None:
        """Both arms at home, grippers open, targets where they are."""
        arms = self._embodiment.arms
        self._joints = np.array([arm.home for arm in arms], dtype=float)
        self._gripper = np.ones(2)
        self._drive = np.ones(2)
        self._last_links = [physics.links[a][arms[a].last_link] for a in range(2)]
        self._writers: list[_Writers] = []
        for a, arm in enumerate(arms):
            articulation = physics.arms[a]
            travel = self._travel(a, 1.0)
            moving = articulation.active_joints
            by_name = {joint.name: joint for joint in moving}
            at_home = {j.name: q for j, q in zip(arm.joints, arm.home, strict=True)}
            at_home |= {finger.name: travel for finger in arm.fingers}
            qpos = np.array([at_home[joint.name] for joint in moving], dtype=np.float32)
            articulation.qpos = qpos
            articulation.qvel = np.zeros_like(qpos)
            for joint in moving:
                joint.set_drive_target(at_home[joint.name])
                joint.set_drive_velocity_target(0.0)
            names = [joint.name for joint in moving]
            self._writers.append(
                _Writers(
                    position=[by_name[j.name].set_drive_target for j in arm.joints],
                    velocity=[by_name[j.name].set_drive_velocity_target for j in arm.joints],
                    fingers=[by_name[j.name].set_drive_target for j in arm.fingers],
                    columns=[names.index(j.name) for j in arm.joints],
                    finger_columns=[names.index(j.name) for j in arm.fingers],
                )
            )

    def _create(self, physics: Physics, index: int) -> None:
        """Object `index` of the scene comes into existence."""
        item = self._scene.objects[index]
        model = self._model(item.asset, item.params)
        physics.add_object(item.name, model, item.pose, item.fixed)

    def _model(self, asset: str, params: Mapping[str, Any]) -> ObjectModel:
        if self._models is None:
            from robospa.tasks.objects import object_model

            self._models = object_model
        return self._models(asset, params)

    def _appear(self, physics: Physics) -> None:
        """Create the objects whose time has come."""
        while self._later and self._later[0][0] <= self._steps:
            self._create(physics, self._later.pop(0)[1])

    def _settle(self, physics: Physics) -> None:
        """Step until nothing moves; SceneUnstable after SETTLE_WINDOWS windows."""
        names = list(physics.moving())
        if not names:
            return
        before = _state(physics, names)
        quiet, restless = 0, ""
        for _ in range(SETTLE_WINDOWS):
            for _ in range(SETTLE_WINDOW):
                physics.step()
            after = _state(physics, names)
            restless = _restless(names, before, after)
            quiet = 0 if restless else quiet + 1
            before = after
            if quiet == QUIET_WINDOWS:
                break
        else:
            still = restless or names[0]
            raise SceneUnstable(
                f"object {still!r} of {self._where()} still moves after "
                f"{SETTLE_WINDOWS * SETTLE_WINDOW / RATE:g} s; this seed is not valid"
            )
        fallen = [name for name, row in zip(names, before, strict=True) if row[6] < FALLEN]
        if fallen:
            raise SceneUnstable(
                f"object {fallen[0]!r} of {self._where()} fell off the table while the scene "
                f"settled; this seed is not valid"
            )

    def _where(self) -> str:
        return f"{self._scene.task} level {self._scene.level} seed {self._scene.seed}"

    # -- acting -------------------------------------------------------------------------------

    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        """Execute one action; see `robospa.harness.actions` for what is clipped and refused.

        `poll` gets a snapshot whenever simulated time passes a multiple of POLL_STEPS steps; if it
        returns True the arms are told to stay where they were told to be, and the action ends.
        """
        physics = self._loaded()
        goals = self._reader.goals(action, space, self._joints)
        before = (self._joints, goals.joints, self._gripper, goals.gripper, self._drive)
        if self._control == "rest_to_rest":
            path = rest_to_rest(*before)
        else:
            path = fixed_rate(*before, self._action_steps)
        done, stopped = self._follow(physics, path, poll)
        return StepResult(done, stopped, goals.problems)

    def _follow(self, physics: Physics, path: Trajectory, poll: Poll) -> tuple[int, bool]:
        """Drive along `path`; physics steps taken and whether `poll` ended it."""
        writers, rows = self._program(path)
        total, done, step = len(path), 0, physics.step
        while done < total:
            upto = min(total, done + POLL_STEPS - self._steps % POLL_STEPS)
            if self._later:
                upto = min(upto, done + self._later[0][0] - self._steps)
            for row in rows[done:upto]:
                for write, value in zip(writers, row, strict=True):
                    write(value)
                step()
            self._steps += upto - done
            done = upto
            self._joints = path.joints[:, done - 1]
            self._gripper = path.commanded[:, done - 1]
            self._drive = path.gripper[:, done - 1]
            if self._later:
                self._appear(physics)
            if self._steps % POLL_STEPS == 0 and poll(self.snapshot()):
                self._halt()
                return done, True
        return done, False

    def _program(self, path: Trajectory) -> tuple[list[Callable[[float], None]], list[list[float]]]:
        """What to call in every physics step, and with which values: only drives that change."""
        calls: list[Callable[[float], None]] = []
        columns: list[Array] = []
        for a, writers in enumerate(self._writers):
            moves = (path.joints[a] != self._joints[a]).any(axis=0)
            moves |= (path.velocities[a] != 0.0).any(axis=0)
            for j in np.flatnonzero(moves):
                calls += [writers.position[j], writers.velocity[j]]
                columns += [path.joints[a, :, j], path.velocities[a, :, j]]
            if (path.gripper[a] != self._drive[a]).any():
                travel = self._travel(a, path.gripper[a])
                for write in writers.fingers:
                    calls.append(write)
                    columns.append(travel)
        if not calls:
            return [], [[] for _ in range(len(path))]
        return calls, np.stack(columns, axis=1).tolist()

    def _travel(self, arm: int, opening: Any) -> Any:
        """Finger travel [m] of gripper values 0..1."""
        closed, opened = self._embodiment.arms[arm].gripper
        return closed + opening * (opened - closed)

    def _halt(self) -> None:
        """No joint is to move on: velocity targets to zero."""
        for writers in self._writers:
            for write in writers.velocity:
                write(0.0)

    # -- looking ------------------------------------------------------------------------------

    def snapshot(self) -> Snapshot:
        """The state at this instant."""
        physics = self._loaded()
        values = physics.packed()
        left, right = self._joints.tolist()
        grip_left, grip_right = self._gripper.tolist()
        tools = [
            _upright(unpack(values, self._last_links[a]) * self._embodiment.arms[a].tool)
            for a in range(2)
        ]
        measured = []
        for a, writers in enumerate(self._writers):
            qpos = physics.arms[a].qpos.tolist()
            measured.append(tuple([qpos[c] for c in writers.columns]))
        return Snapshot(
            time=self._steps / RATE,
            poses=physics.poses(values),
            gripper=(grip_left, grip_right),
            end_effector=(tools[0], tools[1]),
            joints=(tuple(left), tuple(right)),
            measured=(measured[0], measured[1]),
            contacts=physics.contacts() if self._contacts else (),
        )

    def observe(self, spec: PolicySpec) -> dict[str, Any]:
        """Images, state and poses that `spec` asks for; see `robospa.protocol.policy`.

        `state` is left out if the spec wants none, `privileged` unless it wants it. The caller adds
        instruction, step and history.
        """
        snapshot = self.snapshot()
        images = self._pictures(spec.cameras)
        out: dict[str, Any] = {
            "images": {c.name: image for c, image in zip(spec.cameras, images, strict=True)}
        }
        if spec.state != "none":
            out["state"] = self._state(spec.state == "measured")
        out["ee"] = np.array(
            [
                [*snapshot.end_effector[a].position, *snapshot.end_effector[a].rotation, grip]
                for a, grip in enumerate(snapshot.gripper)
            ],
            dtype=np.float32,
        )
        if spec.privileged:
            out["privileged"] = snapshot_to_json(snapshot)
        return out

    def _state(self, measured: bool) -> NDArray[np.float32]:
        """Joints and grippers (D,): as commanded, or as they are."""
        physics = self._loaded()
        parts: list[float] = []
        for a, writers in enumerate(self._writers):
            if measured:
                qpos = physics.arms[a].qpos.astype(float)
                closed, opened = self._embodiment.arms[a].gripper
                travel = float(qpos[writers.finger_columns].mean())
                parts += qpos[writers.columns].tolist()
                parts.append(min(1.0, max(0.0, (travel - closed) / (opened - closed))))
            else:
                parts += [*self._joints[a].tolist(), float(self._gripper[a])]
        return np.array(parts, dtype=np.float32)

    def render(self, camera: CameraSpec) -> NDArray[np.uint8]:
        """One RGB image (height, width, 3); RenderUnavailable where nothing can be drawn."""
        return self._pictures((camera,))[0]

    def _pictures(self, cameras: Sequence[CameraSpec]) -> list[NDArray[np.uint8]]:
        if not cameras:
            return []
        physics = self._loaded()
        studio = self._studio or self._open_studio()
        studio.arrange(self._scene, self._embodiment, self._model)
        values = physics.packed()
        links = [
            {link: unpack(values, row) for link, row in rows.items()} for rows in physics.links
        ]
        return studio.pictures(cameras, links, physics.poses(values))

    def _open_studio(self) -> Studio:
        if self._render is False:
            raise RenderUnavailable("this world was made with render=False and draws no images")
        from robospa.harness.cameras import Studio

        self._studio = Studio()
        return self._studio

    def digest(self) -> str:
        """Hash of the exact state: poses, velocities, joints."""
        return self._loaded().digest()

    def info(self) -> Mapping[str, Any]:
        """Simulator, versions, control, and the render device if it is open."""
        renderer = None
        if self._studio:
            from robospa.harness.cameras import device_summary

            renderer = device_summary()
        return {
            "simulator": "sapien",
            **versions(),
            "backend": "physx-cpu",
            "physics_hz": RATE,
            "control": self._control,
            **({"action_steps": self._action_steps} if self._control == "fixed_rate" else {}),
            "renderer": renderer,
        }

    def close(self) -> None:
        """Free the scenes; the world cannot be used afterwards until it loads again."""
        self._drop_physics()
        if self._studio:
            self._studio.close()
            self._studio = None

    def _drop_physics(self) -> None:
        if self._physics:
            self._physics.close()
            self._physics = None

    def _loaded(self) -> Physics:
        if self._physics is None:
            raise RuntimeError("no scene is loaded; call load(scene) first")
        return self._physics


def _state(physics: Physics, names: list[str]) -> Array:
    """Packed poses (N, 7: rotation, position) of the named objects."""
    values = physics.packed()
    first = [FLOATS * physics.rows[name] for name in names]
    return np.array([values[i : i + FLOATS] for i in first])


def _upright(pose: Pose) -> Pose:
    """The same pose with the quaternion whose w is not negative."""
    if pose.rotation[0] >= 0.0:
        return pose
    w, x, y, z = pose.rotation
    return Pose(pose.position, (-w, -x, -y, -z))


def _restless(names: list[str], before: Array, after: Array) -> str:
    """The object that moved most between two states, or "" if all are at rest."""
    shift = np.linalg.norm(after[:, 4:] - before[:, 4:], axis=1)
    cosine = np.abs((after[:, :4] * before[:, :4]).sum(axis=1))
    turn = 2.0 * np.arccos(np.clip(cosine, 0.0, 1.0))
    unrest = np.maximum(shift / REST_DISTANCE, turn / REST_ANGLE)
    worst = int(np.argmax(unrest))
    return names[worst] if unrest[worst] > 1.0 else ""


def versions() -> dict[str, str]:
    """Versions of SAPIEN and PhysX."""
    import sapien

    return {"sapien": str(sapien.__version__), "physx": str(sapien.physx.version())}
