"""The state of the world at one instant, as goals and experts see it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from robospa.geometry import Pose, Vec3
from robospa.workcell import Gripper, grasp_points

GRIPPER_OPEN = 0.8
"""A commanded gripper above this is open (official predicate)."""
GRIPPER_CLOSED = 0.2
"""A commanded gripper below this is closed (official predicate)."""


@dataclass(frozen=True, slots=True)
class Contact:
    """Two bodies and a point [m, world frame] at which they touch or nearly do.

    Bodies are object names, "table", "left_gripper" and "right_gripper" (the fingers), "left_arm"
    and "right_arm" (the rest). The simulator reports points from about 2 cm of separation on, and
    officially each of them counts, whatever its impulse; `touching` is true where the bodies push
    on each other.
    """

    first: str
    second: str
    point: Vec3
    touching: bool = True


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One instant. `time` [s] counts simulated time since the trial's start.

    `poses` has every object that exists at this instant. `gripper` is the *commanded* opening
    (0 closed .. 1 open) of left and right; `end_effector` the pose of each arm's end-effector
    frame (x axis = approach); `grasp_points` the point [m, world] between the fingers of each,
    which depends on the robot; `joints` the commanded arm joints [rad] of left and right,
    `measured` the measured ones. `contacts` is filled only for goals that ask for it
    (`Tracker.needs_contacts`). `hinges` has the angle [rad] of every object with a hinged part, 0
    when closed.
    """

    time: float
    poses: Mapping[str, Pose]
    gripper: tuple[float, float]
    end_effector: tuple[Pose, Pose]
    grasp_points: tuple[Vec3, Vec3] = field(kw_only=True)
    joints: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    measured: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    contacts: tuple[Contact, ...] = field(default=())
    hinges: Mapping[str, float] = field(default_factory=dict)

    def height(self, name: str) -> float:
        return self.poses[name].position[2]

    def heights(self, names: Iterable[str]) -> list[float | None]:
        """Heights [m] of several objects; None for one that does not exist at this instant."""
        poses = self.poses
        return [poses[name].position[2] if name in poses else None for name in names]

    def position(self, name: str) -> Vec3:
        return self.poses[name].position

    def gripper_contacts(self, name: str) -> list[Contact]:
        """Contacts between the fingers of any gripper and the object called `name`."""
        grippers = ("left_gripper", "right_gripper")
        return [
            c
            for c in self.contacts
            if (c.first in grippers and c.second == name)
            or (c.second in grippers and c.first == name)
        ]


def snapshot_to_json(snapshot: Snapshot) -> dict[str, Any]:
    """Plain JSON values: poses as [x, y, z, qw, qx, qy, qz]; `snapshot_from_json` is the inverse.

    Contacts are not included: they belong to goals, not to experts. Neither are grasp points: they
    follow from the end-effector poses and the robot. "hinges" is there only where an object has
    one.
    """
    data = {
        "time": snapshot.time,
        "poses": {name: _flat(pose) for name, pose in snapshot.poses.items()},
        "gripper": list(snapshot.gripper),
        "end_effector": [_flat(pose) for pose in snapshot.end_effector],
        "joints": [list(arm) for arm in snapshot.joints],
        "measured": [list(arm) for arm in snapshot.measured],
    }
    if snapshot.hinges:
        data["hinges"] = dict(snapshot.hinges)
    return data


def snapshot_from_json(data: Mapping[str, Any], grippers: tuple[Gripper, Gripper]) -> Snapshot:
    """The snapshot that `snapshot_to_json` wrote of a robot with these grippers, left and right.

    KeyError or ValueError if it is none.
    """
    left, right = data["end_effector"]
    ends = (pose_of_row(left), pose_of_row(right))
    grip_left, grip_right = data["gripper"]
    joints_left, joints_right = data["joints"]
    measured_left, measured_right = data["measured"]
    return Snapshot(
        time=float(data["time"]),
        poses={name: pose_of_row(row) for name, row in data["poses"].items()},
        gripper=(float(grip_left), float(grip_right)),
        end_effector=ends,
        grasp_points=grasp_points(grippers, ends),
        joints=(_floats(joints_left), _floats(joints_right)),
        measured=(_floats(measured_left), _floats(measured_right)),
        hinges={name: float(angle) for name, angle in data.get("hinges", {}).items()},
    )


def _flat(pose: Pose) -> list[float]:
    return [*pose.position, *pose.rotation]


def _floats(row: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(v) for v in row)


def pose_of_row(row: Iterable[float]) -> Pose:
    """The pose that is x, y, z [m], qw, qx, qy, qz."""
    x, y, z, qw, qx, qy, qz = _floats(row)
    return Pose((x, y, z), (qw, qx, qy, qz))
