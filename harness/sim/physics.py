"""One trial's physics: a fresh SAPIEN scene with table, robot and objects, and its exact state.

Nothing is carried from one instance to the next, so a trial does not depend on what ran before it
in the same process. There is no render system in here (drawing happens in another scene), and
bodies are created in an order that follows from the trial alone.
"""

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien import physx

from robospa.action_space import ARMS
from robospa.geometry import Pose, Vec3, angle_between
from robospa.harness.robots.embodiment import Arm, Embodiment
from robospa.harness.sim import bodies, furniture
from robospa.harness.sim.lazy_snapshot import FLOATS, NO_HINGES, Pair, unpack
from robospa.harness.sim.motion import RATE, Trajectory
from robospa.harness.world import SceneUnstable
from robospa.tasks.shapes import Hinge, ObjectModel
from robospa.tasks.snapshot import Contact
from robospa.workcell import WORKCELL

Array = NDArray[np.float64]

FURNITURE = ("ground", "table", "wall")


class Physics:
    """The physics of one trial; `step` is SAPIEN's own, `moving` has the components of the objects
    that can move, by name."""

    def __init__(self, embodiment: Embodiment, table_at: Vec3) -> None:
        """`table_at` is how far [m] the table is moved from its usual place."""
        self.system: physx.PhysxCpuSystem = physx.PhysxCpuSystem()
        self.system.timestep = 1.0 / RATE
        self.scene: sapien.Scene = sapien.Scene([self.system])
        self.step = self.system.step
        self._pack = self.scene.pack_poses
        self.links: list[dict[str, int]] = []
        self.rows: dict[str, int] = {}
        self.moving: dict[str, physx.PhysxRigidBaseComponent] = {}
        self._hinged: dict[str, tuple[physx.PhysxArticulation, Hinge]] = {}
        self._add(bodies.ground_body("ground"))
        table = furniture.table(WORKCELL.table)
        self._add(bodies.static_body(table, "table", Pose(table_at)))
        self._add(bodies.static_body(furniture.wall(), "wall", Pose()))
        self.arms: list[physx.PhysxArticulation] = []
        for name, arm in zip(ARMS, embodiment.arms, strict=True):
            first = len(self.scene.entities)
            self.arms.append(bodies.build_arm(self.scene, arm, name))
            self.links.append({link: first + i for i, link in enumerate(arm.links)})

    def _add(self, entity: sapien.Entity) -> int:
        """Put an entity into the scene; its row in the packed state."""
        self.scene.add_entity(entity)
        return len(self.scene.entities) - 1

    def add_object(
        self, name: str, model: ObjectModel, pose: Pose, fixed: bool, density: float | None = None
    ) -> None:
        """Create an object at `pose`; it exists from the next physics step on.

        Its mass follows from its `density` [kg/m^3] if that is given, else it is the model's.
        """
        # snapshots keep the table of rows that they saw
        if model.hinge is not None:
            body, part, articulation = bodies.hinged_body(model, name, pose, fixed)
            self.rows = {**self.rows, name: self._add(body)}
            self._add(part)
            self._hinged[name] = articulation, model.hinge
            return
        entity, component = bodies.dynamic_body(model, name, pose, fixed, density)
        self.rows = {**self.rows, name: self._add(entity)}
        if not fixed:
            self.moving[name] = component

    def hinges(self) -> Mapping[str, float]:
        """Angle [rad] of every hinged part, by the name of its object."""
        if not self._hinged:
            return NO_HINGES
        return {name: float(one.qpos[0]) for name, (one, _) in self._hinged.items()}

    def packed(self) -> bytes:
        """Poses of all entities, as `robospa.harness.sim.lazy_snapshot` unpacks them."""
        return self._pack()  # type: ignore[no-any-return]

    def bodies(self) -> dict[str, Pose]:
        """World pose of everything that moves, by name: links as "left link1", objects as the scene
        calls them, their doors and lids as "object_0 part"."""
        rows = {
            f"{arm} {link}": row
            for arm, links in zip(ARMS, self.links, strict=True)
            for link, row in links.items()
        }
        packed = self.packed()
        found = {name: unpack(packed, row) for name, row in {**rows, **self.rows}.items()}
        for name, angle in self.hinges().items():
            found[f"{name} part"] = found[name] * self._hinged[name][1].turned(angle)
        return found

    def contacts(self) -> tuple[Contact, ...]:
        """Every point that the simulator reports, except of objects on furniture.

        In a fixed order: the simulator's own order is that of its memory.
        """
        found: list[tuple[str, str, tuple[float, float, float], bool]] = []
        for contact in self.system.get_contacts():
            one, other = (body.name for body in contact.bodies)
            if other < one:
                one, other = other, one
            if (one in FURNITURE and other in self.rows) or (
                other in FURNITURE and one in self.rows
            ):
                continue
            if one == other:  # a part on its own body
                continue
            for point in contact.points:
                x, y, z = point.position.tolist()
                found.append((one, other, (x, y, z), any(point.impulse.tolist())))
        return tuple([Contact(*row) for row in sorted(found)])

    def digest(self) -> str:
        """Hash of poses, velocities and joints: of their very bytes, in a fixed order."""
        state = hashlib.sha256(self.scene.pack_poses())
        for name, component in self.moving.items():
            state.update(name.encode())
            state.update(component.linear_velocity.tobytes())
            state.update(component.angular_velocity.tobytes())
        for arm in (*self.arms, *(one for one, _ in self._hinged.values())):
            state.update(arm.qpos.tobytes())
            state.update(arm.qvel.tobytes())
        return state.hexdigest()

    def close(self) -> None:
        """Let go of the simulator's scene."""
        self.scene.clear()
        self.arms, self.moving, self._hinged = [], {}, {}


WINDOW = 25
WINDOWS = 10
"""At most this many windows of WINDOW physics steps: 1 s of simulated time."""
QUIET_WINDOWS = 2
REST_DISTANCE = 2e-4  # [m] in one window
REST_ANGLE = math.radians(0.2)  # in one window
FALLEN = 0.5  # [m] an object whose origin is below this is not on the table


def settle(physics: Physics, where: str) -> None:
    """Step until nothing moves: no object moved or turned by more than can be seen in a tenth of a
    second, twice in a row (velocities chatter in contacts).

    SceneUnstable, naming `where` and the object, if one still moves after WINDOWS or has left
    the table.
    """
    names = list(physics.moving)
    if not names:
        return
    before = packed_poses(physics, names)
    quiet, restless = 0, ""
    for _ in range(WINDOWS):
        for _ in range(WINDOW):
            physics.step()
        after = packed_poses(physics, names)
        moved = mover(names, before, after)
        restless = moved or restless
        quiet = 0 if moved else quiet + 1
        before = after
        if quiet == QUIET_WINDOWS:
            break
    else:
        raise SceneUnstable(
            f"object {restless!r} of {where} still moves after {WINDOWS * WINDOW / RATE:g} s; "
            f"this seed is not valid"
        )
    fallen = [name for name, row in zip(names, before, strict=True) if row[6] < FALLEN]
    if fallen:
        raise SceneUnstable(
            f"object {fallen[0]!r} of {where} fell off the table while the scene settled; "
            f"this seed is not valid"
        )


def packed_poses(physics: Physics, names: list[str]) -> Array:
    """Poses (N, 7: rotation, position) of the named objects."""
    poses = np.frombuffer(physics.packed(), dtype=np.float32).reshape(-1, FLOATS)
    return poses[[physics.rows[name] for name in names]].astype(np.float64)


def mover(names: list[str], before: Array, after: Array) -> str:
    """The object that moved most between two packed states, or "" if all are at rest."""
    shift = np.linalg.norm(after[:, 4:] - before[:, 4:], axis=1)
    turn = angle_between(before[:, :4], after[:, :4])
    unrest = np.maximum(shift / REST_DISTANCE, turn / REST_ANGLE)
    worst = int(np.argmax(unrest))
    return names[worst] if unrest[worst] > 1.0 else ""


Opening = TypeVar("Opening", float, Array)
Setter = Callable[[float], None]


class _ArmDrives:
    """SAPIEN's setters of one arm's drives, and where its joints are in qpos."""

    def __init__(self, arm: Arm, articulation: physx.PhysxArticulation) -> None:
        self.arm, self.articulation = arm, articulation
        active = articulation.active_joints
        column = {joint.name: i for i, joint in enumerate(active)}
        self.columns = [column[joint.name] for joint in arm.joints]
        self.finger_columns = [column[finger.name] for finger in arm.fingers]
        self.position: list[Setter] = [active[c].set_drive_target for c in self.columns]
        self.velocity: list[Setter] = [active[c].set_drive_velocity_target for c in self.columns]
        self.fingers: list[Setter] = [active[c].set_drive_target for c in self.finger_columns]

    def travel(self, opening: Opening) -> Opening:
        """Finger travel [m] of gripper values 0..1."""
        closed, opened = self.arm.travel
        return closed + opening * (opened - closed)


class Drives:
    """The drives of a loaded robot; `now` is the trajectory that they follow and the row reached.

    `joints` (2, J) [rad] and `gripper` (2,) are as commanded; `opening` (2,) is the grippers' drive
    target, which may lag an opening gripper's command. J is the joint count of the arm that has
    more; the other's row ends in zeros.

    Grippers get position targets only (official), so they follow with a time constant of
    damping / stiffness = 0.2 s; arm joints get position and velocity targets. They close with the
    share `grip` of their force.
    """

    def __init__(
        self,
        embodiment: Embodiment,
        articulations: list[physx.PhysxArticulation],
        grip: float = 1.0,
    ) -> None:
        self._arms = list(map(_ArmDrives, embodiment.arms, articulations))
        home = np.zeros((2, 1, max(len(arm.joints) for arm in embodiment.arms)))
        for a, drives in enumerate(self._arms):
            arm = drives.arm
            home[a, 0, : len(arm.joints)] = arm.home
            for column in drives.finger_columns if grip < 1.0 else ():
                joint = drives.articulation.active_joints[column]
                joint.set_drive_properties(grip * arm.stiffness, grip * arm.damping)
        opened = np.ones((2, 1))
        self.now = (Trajectory(home, np.zeros_like(home), opened, opened), 0)
        self._go_home()

    @property
    def joints(self) -> Array:
        """Commanded joints (2, J) [rad]."""
        path, row = self.now
        return path.joints[:, row]

    @property
    def gripper(self) -> Array:
        """Commanded grippers (2,)."""
        path, row = self.now
        return path.commanded[:, row]

    @property
    def opening(self) -> Array:
        """Drive targets of the grippers (2,)."""
        path, row = self.now
        return path.gripper[:, row]

    def _go_home(self) -> None:
        for arm in self._arms:
            qpos = np.zeros(arm.articulation.dof, dtype=np.float32)
            qpos[arm.columns] = arm.arm.home
            upper = [finger.upper for finger in arm.arm.fingers]
            qpos[arm.finger_columns] = np.minimum(arm.travel(1.0), upper)
            arm.articulation.qpos = qpos
            arm.articulation.qvel = np.zeros_like(qpos)
            for joint, value in zip(arm.articulation.active_joints, qpos.tolist(), strict=True):
                joint.set_drive_target(value)
                joint.set_drive_velocity_target(0.0)

    def schedule(self, path: Trajectory) -> tuple[list[Setter], Array]:
        """Setters to call in every physics step of `path`, and their values (n, setters)."""
        joints, opening = self.joints, self.opening
        calls: list[Setter] = []
        columns: list[Array] = []
        for a, arm in enumerate(self._arms):
            # along a straight line a joint moves all the way or not at all
            moves = (path.joints[a, -1] != joints[a]) | (path.joints[a, 0] != joints[a])
            for j in np.flatnonzero(moves).tolist():
                calls += [arm.position[j], arm.velocity[j]]
                columns += [path.joints[a, :, j], path.velocities[a, :, j]]
            if path.gripper[a, 0] != opening[a] or path.gripper[a, -1] != opening[a]:
                calls += arm.fingers
                columns += [arm.travel(path.gripper[a])] * len(arm.fingers)
        table = np.empty((len(path), len(calls)))
        for i, column in enumerate(columns):
            table[:, i] = column
        return calls, table

    def stop(self) -> None:
        """Set all velocity targets to zero."""
        for arm in self._arms:
            for write in arm.velocity:
                write(0.0)

    def measured(self) -> Pair:
        """Measured joints [rad] of left and right."""
        left, right = (
            tuple([qpos[c] for c in arm.columns])
            for arm, qpos in ((arm, arm.articulation.qpos.tolist()) for arm in self._arms)
        )
        return left, right

    def state(self, measured: bool) -> NDArray[np.float32]:
        """Joints [rad] and gripper 0..1 of left and right (D,): as commanded, or as they are."""
        parts: list[float] = []
        gripper = self.gripper
        joints: Sequence[Sequence[float]]
        joints = self.measured() if measured else self.joints.tolist()
        for a, arm in enumerate(self._arms):
            opening = float(gripper[a])
            if measured:
                closed, opened = arm.arm.travel
                travel = float(arm.articulation.qpos[arm.finger_columns].mean())
                opening = min(1.0, max(0.0, (travel - closed) / (opened - closed)))
            parts += [*joints[a][: len(arm.columns)], opening]
        return np.array(parts, dtype=np.float32)
