"""The goal of every pick task: the named object is lifted, by a gripper.

One state machine serves all of them; a task chooses its height test and what else must hold at
that instant. Whatever the height test, the object has to be carried: close to a gripper, not
thrown up or raised on top of something else. Lifting another object is an event, not a failure.
"""

from __future__ import annotations

from dataclasses import dataclass

from robospa.tasks.events import Event
from robospa.tasks.geometry import Pose
from robospa.tasks.snapshot import GRIPPER_CLOSED, GRIPPER_OPEN, Snapshot

GRASP_CENTRE = 0.12
"""The grasp centre lies this far [m] ahead of the end-effector frame, along its x axis."""
CARRY_DISTANCE = 0.15
"""An object whose origin is this near [m] to a grasp centre counts as carried by that arm."""
LIFTED, WRONG, RESTING = 0.02, 0.03, 0.01
"""Rise [m] above the start that makes an object lifted, wrongly lifted, and back at rest."""


@dataclass(frozen=True)
class Lift:
    """What counts as picked; tests that are None or False are not made.

    `above`: the origin is higher than this [m, world]. `rise`: it is higher than at the start by
    more than this [m]. `steady`: every other object is within this [m] of its start height.
    `closed`: an arm that carries the object has its commanded gripper below 0.2.
    `touching`: a gripper is in contact with the object.
    """

    above: float | None = None
    rise: float | None = None
    steady: float | None = None
    closed: bool = False
    touching: bool = False


class PickTracker:
    """Tracks the lifting of `target` among `names`; emits subtask 0 and success at once."""

    total = 1

    def __init__(self, target: str, names: tuple[str, ...], lift: Lift) -> None:
        if target not in names:
            raise ValueError(f"target {target!r} is not among the objects {list(names)}")
        self.target = target
        self.names = names
        self.lift = lift
        self.needs_contacts = lift.touching
        self._heights: list[float] = []
        self._goal_height = float("inf")
        self._raised: dict[str, bool] = {}  # lifted now; True once a gripper was seen to hold it
        self._reported: set[str] = set()
        self._done = False

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Remember the heights of the settled scene."""
        poses = snapshot.poses
        self._heights = [poses[name].position[2] for name in self.names]
        tests = [self.lift.above] if self.lift.above is not None else []
        if self.lift.rise is not None:
            tests.append(poses[self.target].position[2] + self.lift.rise)
        if not tests:
            raise ValueError("a lift needs a height test: give `above` or `rise`")
        self._goal_height = max(tests)
        self._raised, self._reported, self._done = {}, set(), False
        return ()

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Events of this instant; nothing after success."""
        if self._done:
            return ()
        poses = snapshot.poses
        events: list[Event] = []
        for name, start in zip(self.names, self._heights, strict=True):
            rise = poses[name].position[2] - start
            if rise > LIFTED or name in self._raised:
                self._lifted(snapshot, name, rise, events)
        if poses[self.target].position[2] > self._goal_height and self._holds(snapshot):
            self._done = True
            events.append(Event(snapshot.time, "subtask_done", self.target, 0))
            events.append(Event(snapshot.time, "success", self.target))
        return tuple(events)

    def _lifted(self, snapshot: Snapshot, name: str, rise: float, events: list[Event]) -> None:
        """Events of one object that is off the table, or was."""
        if rise < RESTING:
            if self._raised.pop(name):
                events.append(Event(snapshot.time, "dropped", name))
            self._reported.discard(name)
            return
        if rise > LIFTED and not self._raised.get(name) and carriers(snapshot, name, GRIPPER_OPEN):
            self._raised[name] = True
            events.append(Event(snapshot.time, "grasped", name))
        self._raised.setdefault(name, False)
        if name != self.target and rise > WRONG and name not in self._reported:
            self._reported.add(name)
            events.append(Event(snapshot.time, "wrong_object", name))

    def _holds(self, snapshot: Snapshot) -> bool:
        """The conditions beside the target's own height."""
        opening = GRIPPER_CLOSED if self.lift.closed else float("inf")
        if not carriers(snapshot, self.target, opening):
            return False
        if self.lift.touching and not snapshot.gripper_contacts(self.target):
            return False
        steady = self.lift.steady
        return steady is None or all(
            name == self.target or abs(snapshot.poses[name].position[2] - start) <= steady
            for name, start in zip(self.names, self._heights, strict=True)
        )


def carriers(snapshot: Snapshot, name: str, opening: float) -> list[int]:
    """Arms (0 left, 1 right) near the object whose commanded gripper is below `opening`."""
    x, y, z = snapshot.poses[name].position
    found = []
    for arm in (0, 1):
        if snapshot.gripper[arm] < opening:
            gx, gy, gz = grasp_centre(snapshot.end_effector[arm])
            if (gx - x) ** 2 + (gy - y) ** 2 + (gz - z) ** 2 < CARRY_DISTANCE**2:
                found.append(arm)
    return found


def grasp_centre(end_effector: Pose) -> tuple[float, float, float]:
    """The point between the fingertips [m, world] of an arm with this end-effector pose."""
    px, py, pz = end_effector.position
    w, x, y, z = end_effector.rotation
    return (
        px + GRASP_CENTRE * (1 - 2 * (y * y + z * z)),
        py + GRASP_CENTRE * 2 * (x * y + w * z),
        pz + GRASP_CENTRE * 2 * (x * z - w * y),
    )
