"""Events for the failure analysis, never for success: grasp attempts, and clutter that was moved.

A grasp that fails leaves no trace in a goal's own events: `GraspMonitor` says where the grippers
close, on what, and what they come near. The grippers are sampled ten times a second and approaches
five times, not at every poll, because grippers stay for a while where they try something. Contacts
are read only while a gripper closes.

A collision with clutter counts once it has moved a thing: a gripper that slides along one without
shifting it has done no harm. Things are looked at ten times a second.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from robospa.action_space import ARMS
from robospa.geometry import Vec3
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import GRIPPER_CLOSED, Contact, Snapshot

SAMPLE_INTERVAL = 0.1
"""Seconds between two samples of the grippers and of clutter; approaches are tested at every second
one."""
REOPENED = 0.3
"""A gripper commanded wider than this can close anew."""
CLOSING = 0.5
"""Seconds after the command to close in which a contact belongs to it: fingers lag by 0.2 s."""
AROUND = 0.15
"""A gripper that closes farther [m] than this from everything tries nothing: no event."""
NEAR, FAR = 0.055, 0.07
"""Distance [m] from grasp centre to an object's box that is an approach, and that ends it."""

AT_REST = 0.002
"""An arm that moved less than this [m] between two samples has approached nothing."""

TOUCHING, BESIDE = "touching", "beside"
"""Notes of `closed` events."""


@dataclass
class _Arm:
    """One gripper: whether it may close anew, and the closing under way."""

    armed: bool = True
    since: float = -1.0
    nearest: str = ""
    touched: dict[str, int] = field(default_factory=dict)
    near: set[str] = field(default_factory=set)
    seen: Vec3 = (0.0, 0.0, 0.0)


class GraspMonitor:
    """Follows both grippers around the objects of `roles`.

    `touching()` gives the contacts of this instant.
    """

    def __init__(
        self,
        roles: Mapping[str, ObjectRole],
        scene: Scene,
        touching: Callable[[], tuple[Contact, ...]],
    ) -> None:
        self._roles = dict(roles)
        self._touching = touching
        self._boxes = {name: _box(scene, name) for name in self._roles}
        self._arms = (_Arm(), _Arm())
        self._due = 0.0
        self._samples = 0

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Closings that ended and approaches that began; nothing between two samples."""
        if snapshot.time < self._due - 1e-9:
            return ()
        self._due = snapshot.time + SAMPLE_INTERVAL
        self._samples += 1
        events: tuple[Event, ...] = ()
        commanded = snapshot.gripper
        for arm, state in enumerate(self._arms):
            if state.since >= 0.0:
                self._note_contacts(arm, state)
                if commanded[arm] > REOPENED or snapshot.time - state.since > CLOSING:
                    events += self._closed(state, snapshot.time)
            elif commanded[arm] < GRIPPER_CLOSED and state.armed:
                state.armed, state.since, state.touched = False, snapshot.time, {}
                state.nearest = self._nearest(snapshot, arm)
            if commanded[arm] > REOPENED:
                state.armed = True
        if self._samples % 2:
            for arm, state in enumerate(self._arms):
                events += self._approaches(snapshot, arm, state)
        return events

    def finish(self, time: float) -> tuple[Event, ...]:
        """The closings that the end of the trial at `time` [s] cut short, if they touched."""
        events: tuple[Event, ...] = ()
        for arm, state in enumerate(self._arms):
            if state.since >= 0.0:
                self._note_contacts(arm, state)
                if state.touched:
                    events += self._closed(state, time)
        return events

    def diagnostics(self) -> dict[str, object]:
        roles = self._roles.items()
        return {
            "roles": {name: list(role.subtasks) for name, role in roles},
            "pressed": [name for name, role in roles if role.pressed],
        }

    def _note_contacts(self, arm: int, state: _Arm) -> None:
        mine = f"{ARMS[arm]}_gripper"
        for contact in self._touching():
            if contact.touching and mine in (contact.first, contact.second):
                name = contact.second if contact.first == mine else contact.first
                if name in self._roles:
                    state.touched[name] = state.touched.get(name, 0) + 1

    def _closed(self, state: _Arm, time: float) -> tuple[Event, ...]:
        state.since = -1.0
        name, note = state.nearest, BESIDE
        if state.touched:
            most = max(state.touched.values())
            if state.touched.get(name, 0) < most:
                name = next(n for n, count in state.touched.items() if count == most)
            note = TOUCHING
        if not name or self._roles[name].pressed:
            return ()
        return (Event(time, "closed", name, self._index(name), note),)

    def _nearest(self, snapshot: Snapshot, arm: int) -> str:
        """The object whose box is nearest to the grasp centre; "" if none is near."""
        centre = snapshot.grasp_points[arm]
        best, found = AROUND, ""
        for name in self._roles:
            if name in snapshot.poses:
                distance = self._distance(snapshot, name, centre, AROUND)
                if distance < best:
                    best, found = distance, name
        return found

    def _approaches(self, snapshot: Snapshot, arm: int, state: _Arm) -> tuple[Event, ...]:
        at = snapshot.end_effector[arm].position
        if math.dist(at, state.seen) < AT_REST:
            return ()
        state.seen = at
        centre = snapshot.grasp_points[arm]
        events: tuple[Event, ...] = ()
        for name in self._roles:
            if name not in snapshot.poses:
                continue
            distance = self._distance(snapshot, name, centre, FAR)
            if distance < NEAR and name not in state.near:
                state.near.add(name)
                events += (Event(snapshot.time, "approached", name, self._index(name)),)
            elif distance > FAR:
                state.near.discard(name)
        return events

    def _distance(self, snapshot: Snapshot, name: str, point: Vec3, most: float) -> float:
        """Distance [m] from `point` to the object's box; infinite where it is more than `most`."""
        pose = snapshot.poses[name]
        middle, half, reach = self._boxes[name]
        x, y, z = pose.position
        dx, dy, dz = point[0] - x, point[1] - y, point[2] - z
        if dx * dx + dy * dy + dz * dz > (reach + most) ** 2:
            return math.inf
        a, b, c = pose.inverse().apply(point)
        dx, dy = max(abs(a) - half[0], 0.0), max(abs(b) - half[1], 0.0)
        return math.hypot(dx, dy, max(abs(c - middle) - half[2], 0.0))

    def _index(self, name: str) -> int:
        subtasks = self._roles[name].subtasks
        return subtasks[0] if subtasks else -1


def _box(scene: Scene, name: str) -> tuple[float, Vec3, float]:
    """An object's box in its own frame: height of its middle, half sizes, farthest corner [m]."""
    item = scene.object(name)
    model = object_model(item.asset, item.params)
    x, y, z = model.size
    middle = model.bottom + z / 2
    return middle, (x / 2, y / 2, z / 2), math.hypot(x / 2, y / 2, abs(middle) + z / 2)


MOVED = 0.005
"""How far [m] a thing is from where it stood at the start to have been moved."""


class ClutterMonitor:
    """Follows the things of a scene's clutter from the settled `start` of the trial on."""

    def __init__(self, clutter: Sequence[SceneObject], start: Snapshot) -> None:
        self._there: dict[str, Vec3] = {i.name: start.position(i.name) for i in clutter}
        self._moved: list[str] = []
        self._due = 0.0

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        if snapshot.time < self._due - 1e-9:
            return ()
        self._due = snapshot.time + SAMPLE_INTERVAL
        moved = [
            name
            for name, at in self._there.items()
            if math.dist(snapshot.position(name), at) > MOVED
        ]
        for name in moved:
            del self._there[name]
        self._moved += moved
        return tuple(Event(snapshot.time, "clutter_moved", name) for name in moved)

    def diagnostics(self) -> dict[str, object]:
        return {"clutter": len(self._there) + len(self._moved), "clutter_moved": list(self._moved)}
