"""Snapshots that cost little to take: what a goal does not look at is never computed.

A poll happens every five physics steps and most goals look at one object or two. So a live snapshot
keeps the simulator's packed state, which SAPIEN copies in one call, and unpacks from it on demand.
It does not change when the world moves on.
"""

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from robospa.geometry import Pose, Quat, Vec3, multiply, rotate
from robospa.harness.sim.motion import RATE, Trajectory
from robospa.tasks.snapshot import Contact, Snapshot
from robospa.workcell import Gripper, grasp_points

FLOATS = 7
"""Numbers of a pose in SAPIEN's packed form: qw qx qy qz, x y z, float32."""
_POSE = struct.Struct(f"<{FLOATS}f")
_Z = FLOATS - 1  # a pose ends in its z

NO_HINGES: Mapping[str, float] = MappingProxyType({})
Pair = tuple[tuple[float, ...], tuple[float, ...]]
_new = object.__new__
_position, _rotation = (getattr(Pose, name).__set__ for name in ("position", "rotation"))


def _pose(position: Vec3, rotation: Quat) -> Pose:
    """A `Pose`, made in half the time: polls make thousands."""
    pose = _new(Pose)
    _position(pose, position)
    _rotation(pose, rotation)
    return pose


def unpack(packed: bytes, row: int) -> Pose:
    """The pose of one entity of a packed state."""
    qw, qx, qy, qz, x, y, z = _POSE.unpack_from(packed, _POSE.size * row)
    return _pose((x, y, z), (qw, qx, qy, qz))


class PoseTable(Mapping[str, Pose]):
    """Poses by object name over a packed state; a `Pose` is made only when it is asked for."""

    __slots__ = ("_made", "_packed", "_rows")

    def __init__(self, packed: bytes, rows: Mapping[str, int]) -> None:
        self._packed = packed
        self._rows = rows
        self._made: dict[str, Pose] = {}

    def __getitem__(self, name: str) -> Pose:
        pose = self._made.get(name)
        if pose is None:
            pose = self._made[name] = unpack(self._packed, self._rows[name])
        return pose

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    def __repr__(self) -> str:
        return repr(dict(self))


@dataclass(frozen=True, slots=True)
class StateLayout:
    """Meaning of the rows and columns of a state, of one embodiment in one scene.

    `tools` are, per arm, the row of the last link and the end-effector frame in it; `joints` how
    many joints each arm has.
    """

    tools: tuple[tuple[int, Pose], ...]
    joints: tuple[int, int]
    grippers: tuple[Gripper, Gripper]


class LazySnapshot(Snapshot):
    """A `Snapshot` of a running world: the same values, computed when first asked for.

    Their slots are empty until then. RuntimeError if contacts or measured joints of a poll's
    snapshot are first asked for after the world moved on.
    """

    GIVEN = (
        "_steps",
        "_touching",
        "_packed",
        "_floats",
        "_rows",
        "_layout",
        "_commanded",
        "_measure",
    )
    __slots__ = GIVEN

    _packed: bytes
    _floats: memoryview
    _rows: Mapping[str, int]
    _layout: StateLayout
    _commanded: tuple[Trajectory, int]
    _steps: int
    _measure: Callable[[int], Pair]
    _touching: Callable[[int], tuple[Contact, ...]]

    def __init__(
        self,
        steps: int,
        packed: bytes,
        rows: Mapping[str, int],
        layout: StateLayout,
        commanded: tuple[Trajectory, int],
        measure: Callable[[int], Pair],
        touching: Callable[[int], tuple[Contact, ...]],
        hinges: Mapping[str, float] = NO_HINGES,
    ) -> None:
        """`steps` of physics have been taken; `commanded`: the trajectory and the row reached;
        `measure` and `touching` give the measured joints and the contacts after so many steps."""
        _time(self, steps / RATE)
        _steps(self, steps)
        _touching(self, touching)
        _hinges(self, hinges)
        _packed(self, packed)
        _floats(self, memoryview(packed).cast("f"))
        _rows(self, rows)
        _layout(self, layout)
        _commanded(self, commanded)
        _measure(self, measure)

    def __getattr__(self, name: str) -> Any:
        """Fill the slot `name`, which is empty."""
        if name not in COMPUTED:
            raise AttributeError(f"a snapshot has no {name!r}")
        value = COMPUTED[name](self)
        object.__setattr__(self, name, value)
        return value

    def height(self, name: str) -> float:
        """Height [m] of the object's origin: goals ask for it of every object at every poll."""
        z: float = self._floats[FLOATS * self._rows[name] + _Z]
        return z

    def heights(self, names: Iterable[str]) -> list[float | None]:
        """Heights [m] of several; None for one that does not exist yet."""
        floats, rows = self._floats, self._rows
        return [floats[FLOATS * rows[name] + _Z] if name in rows else None for name in names]

    def position(self, name: str) -> Vec3:
        """Position [m] of the object's origin, without the rest of its pose."""
        at = FLOATS * self._rows[name] + 4
        floats = self._floats
        return (floats[at], floats[at + 1], floats[at + 2])

    def _gripper(self) -> tuple[float, float]:
        path, row = self._commanded
        left, right = path.commanded[:, row].tolist()
        return left, right

    def _end_effector(self) -> tuple[Pose, Pose]:
        left, right = self._layout.tools
        return self._tool(*left), self._tool(*right)

    def _tool(self, row: int, tool: Pose) -> Pose:
        """`unpack(packed, row) * tool`, with the quaternion whose w is not negative."""
        qw, qx, qy, qz, px, py, pz = _POSE.unpack_from(self._packed, _POSE.size * row)
        x, y, z = rotate((qw, qx, qy, qz), tool.position)
        w, a, b, c = multiply((qw, qx, qy, qz), tool.rotation)
        turn = (w, a, b, c) if w >= 0.0 else (-w, -a, -b, -c)
        return _pose((px + x, py + y, pz + z), turn)

    def _joints(self) -> Pair:
        path, row = self._commanded
        left, right = path.joints[:, row].tolist()
        a, b = self._layout.joints
        return tuple(left[:a]), tuple(right[:b])


COMPUTED: Mapping[str, Callable[[LazySnapshot], object]] = {
    "poses": lambda seen: PoseTable(seen._packed, seen._rows),
    "gripper": LazySnapshot._gripper,
    "end_effector": LazySnapshot._end_effector,
    "grasp_points": lambda seen: grasp_points(seen._layout.grippers, seen.end_effector),
    "joints": LazySnapshot._joints,
    "contacts": lambda seen: seen._touching(seen._steps),
    "measured": lambda seen: seen._measure(seen._steps),
}
"""What fills each slot of a `Snapshot` that is not given."""

# Slots of a frozen class can only be filled from outside; their descriptors do so fastest.
_time, _hinges = (getattr(Snapshot, name).__set__ for name in ("time", "hinges"))
_steps, _touching, _packed, _floats, _rows, _layout, _commanded, _measure = (
    getattr(LazySnapshot, name).__set__ for name in LazySnapshot.GIVEN
)
