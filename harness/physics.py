"""One trial's physics: a fresh SAPIEN scene with table, robot and objects, and its exact state.

Nothing is carried from one instance to the next, so a trial does not depend on what ran before it
in the same process. There is no render system in here (drawing happens in another scene), and
bodies are created in an order that follows from the trial alone.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien import physx

from robospa.harness import bodies, furniture
from robospa.harness.motion import RATE
from robospa.harness.robots.embodiment import Embodiment
from robospa.tasks.geometry import Pose
from robospa.tasks.shapes import ObjectModel
from robospa.tasks.snapshot import ARMS, Contact

Array = NDArray[np.float64]

FURNITURE = ("ground", "table", "wall")

FLOATS = 7  # of a pose in SAPIEN's packed form: qw qx qy qz, x y z


class PoseTable(Mapping[str, Pose]):
    """Poses by object name over a packed state; a `Pose` is made only when it is asked for."""

    __slots__ = ("_made", "_rows", "_values")

    def __init__(self, values: tuple[float, ...], rows: Mapping[str, int]) -> None:
        self._values = values
        self._rows = rows
        self._made: dict[str, Pose] = {}

    def __getitem__(self, name: str) -> Pose:
        pose = self._made.get(name)
        if pose is None:
            pose = self._made[name] = unpack(self._values, self._rows[name])
        return pose

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __repr__(self) -> str:
        return repr(dict(self))


def unpack(values: tuple[float, ...], row: int) -> Pose:
    """The pose of one entity of a packed state."""
    qw, qx, qy, qz, x, y, z = values[FLOATS * row : FLOATS * row + FLOATS]
    return Pose((x, y, z), (qw, qx, qy, qz))


class Physics:
    """The physics of one trial; `step` is SAPIEN's own."""

    def __init__(self, embodiment: Embodiment, table_at: tuple[float, float]) -> None:
        self.system: Any = physx.PhysxCpuSystem()
        self.system.timestep = 1.0 / RATE
        self.scene: Any = sapien.Scene([self.system])
        self.step = self.system.step
        self._entities: list[Any] = []
        self.links: list[dict[str, int]] = []
        self.rows: dict[str, int] = {}
        self.components: dict[str, Any] = {}
        self._moving: dict[str, Any] = {}
        self._unpacker = struct.Struct("")
        self._add(bodies.ground_body("ground"))
        x, y = table_at
        self._add(bodies.static_body(furniture.table(), "table", Pose((x, y, 0.0))))
        self._add(bodies.static_body(furniture.wall(), "wall", Pose()))
        self.arms: list[Any] = []
        for name, arm in zip(ARMS, embodiment.arms, strict=True):
            first = len(self.scene.entities)
            self.arms.append(bodies.build_arm(self.scene, embodiment, arm, name))
            self.links.append({link: first + i for i, link in enumerate(arm.links)})
        self._count()

    def _add(self, entity: Any) -> int:
        """Put an entity into the scene; its row in the packed state."""
        self.scene.add_entity(entity)
        return len(self.scene.entities) - 1

    def _count(self) -> None:
        self._unpacker = struct.Struct(f"<{FLOATS * len(self.scene.entities)}f")

    def add_object(self, name: str, model: ObjectModel, pose: Pose, fixed: bool) -> None:
        """Create an object at `pose`; it exists from the next physics step on."""
        entity, component = bodies.dynamic_body(model, name, pose, fixed)
        self.rows = {**self.rows, name: self._add(entity)}  # snapshots keep the table they saw
        self.components[name] = component
        if not fixed:
            self._moving[name] = component
        self._count()

    def packed(self) -> tuple[float, ...]:
        """Poses of all entities, FLOATS numbers each."""
        return self._unpacker.unpack(self.scene.pack_poses())

    def poses(self, values: tuple[float, ...]) -> PoseTable:
        """Object poses of a packed state."""
        return PoseTable(values, self.rows)

    def contacts(self) -> tuple[Contact, ...]:
        """Every point at which two bodies push on each other, except of objects on furniture.

        In a fixed order: the simulator's own order is that of its memory.
        """
        found: list[tuple[str, str, tuple[float, float, float]]] = []
        for contact in self.system.get_contacts():
            one, other = (body.name for body in contact.bodies)
            if other < one:
                one, other = other, one
            if (one in FURNITURE and other in self.rows) or (
                other in FURNITURE and one in self.rows
            ):
                continue
            for point in contact.points:
                if any(point.impulse.tolist()):
                    x, y, z = point.position.tolist()
                    found.append((one, other, (x, y, z)))
        return tuple([Contact(*pair) for pair in sorted(found)])

    def moving(self) -> dict[str, Any]:
        """Components of the objects that can move, by name."""
        return self._moving

    def digest(self) -> str:
        """Hash of poses, velocities and joints: of their very bytes, in a fixed order."""
        state = hashlib.sha256(self.scene.pack_poses())
        for name, component in self._moving.items():
            state.update(name.encode())
            state.update(component.linear_velocity.tobytes())
            state.update(component.angular_velocity.tobytes())
        for arm in self.arms:
            state.update(arm.qpos.tobytes())
            state.update(arm.qvel.tobytes())
        return state.hexdigest()

    def close(self) -> None:
        """Let go of the simulator's scene."""
        self.scene.clear()
        self.arms, self.components, self._moving = [], {}, {}
