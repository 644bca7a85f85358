"""Counting what is done to an object: presses, hits with a tool, stamps, lifts and back.

Officially a gripper is in contact with an object at every point that the simulator reports between
its fingers and the object, from about 2 cm of separation on and whatever the impulse. A press
counts when such a contact begins in the box around the frame. The next one needs 0.1 s without
one; officially a single physics step does. Where the gripper has to be closed, opening it on the
object is no leaving (official). Presses that push on the object are counted beside it.

The official rule counts a stamp within 1 cm and re-arms beyond 1 cm in height, so that a bounce at
that height counts again and again; here re-arming takes 2 cm in every direction.

A cycle counts when the object is back home after it was up. Whether it was let go of in between is
not asked (official); the figures count the cycles after which nothing held it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from robospa.geometry import Pose, Vec3, rotate
from robospa.tasks.goals.lifting import closed_near
from robospa.tasks.snapshot import GRIPPER_CLOSED, Contact, Snapshot

PRESS_BOX: Vec3 = (0.03, 0.03, 0.03)
"""Half sizes [m] of the box around the press frame in which a touch counts."""

REARM = 0.1
"""Seconds without a contact before the next press can count."""


class ActionCounter(Protocol):
    """Counts what is done to object `name`, or with it in hand if it is `carried` (a stamp).

    `pressing` says whether what is counted goes on at this instant, new or not.
    """

    name: str
    pressing: bool

    @property
    def carried(self) -> bool:
        """Whether the object is in the hand."""

    @property
    def count(self) -> int:
        """What was counted so far."""

    def figures(self) -> Mapping[str, int]:
        """What a record keeps of it, by name."""

    def start(self, snapshot: Snapshot) -> None:
        """Take over the settled scene: what holds now is not counted."""

    def update(self, snapshot: Snapshot) -> bool:
        """True if a count is added at this instant."""


FIGURES = ("presses", "touched", "raw_presses")
"""What records call the counts, those that pushed, and those without the rule against chatter."""


def figures(count: int, touched: int, raw: int) -> dict[str, int]:
    """The figures of a counter by name."""
    return dict(zip(FIGURES, (count, touched, raw), strict=True))


class _Touches:
    """Counts beginnings of a touch that follow REARM seconds without one."""

    def __init__(self) -> None:
        self.count = 0
        self._left = True
        self._last = float("-inf")

    def start(self, touching: bool, time: float) -> None:
        self._left = not touching
        if touching:
            self._last = time

    def update(self, touching: bool, closed: bool, time: float) -> bool:
        """True if a count is added at `time` [s]; a touch counts only while `closed`."""
        if not touching:
            return False
        self._left |= time - self._last >= REARM - 1e-9
        self._last = time
        new = closed and self._left
        if new:
            self._left = False
            self.count += 1
        return new


class PressCounter:
    """Counts presses of object `name` at `frame` (given in the object's frame).

    With `arm` (0 left, 1 right) a touch counts only while that arm's gripper is commanded closed.
    """

    carried = False

    def __init__(
        self, name: str, frame: Pose, box: Vec3 = PRESS_BOX, arm: int | None = None
    ) -> None:
        self.name = name
        self.arm = arm
        self.frame = frame
        self.box = box
        self.raw_count = 0
        """Presses as a counter without re-arming would see them."""
        self.pressing = False
        self._reported, self._pushed = _Touches(), _Touches()

    @property
    def count(self) -> int:
        """Presses by the official meaning of contact."""
        return self._reported.count

    def figures(self) -> dict[str, int]:
        return figures(self.count, self._pushed.count, self.raw_count)

    def contacts(self, snapshot: Snapshot) -> list[Contact]:
        """Contacts of a gripper with the object inside the box at this instant."""
        if not snapshot.contacts:
            return []
        found = snapshot.gripper_contacts(self.name)
        if not found:
            return []
        centre = snapshot.poses[self.name].apply(self.frame.position)
        return [c for c in found if inside_box(c.point, centre, self.box)]

    def start(self, snapshot: Snapshot) -> None:
        found = self.contacts(snapshot)
        self.pressing = bool(found) and self._closed(snapshot)
        self._reported.start(bool(found), snapshot.time)
        self._pushed.start(any(c.touching for c in found), snapshot.time)

    def update(self, snapshot: Snapshot) -> bool:
        found = self.contacts(snapshot)
        closed, time = self._closed(snapshot), snapshot.time
        pressing = bool(found) and closed
        self.raw_count += pressing and not self.pressing
        self.pressing = pressing
        self._pushed.update(any(c.touching for c in found), closed, time)
        return self._reported.update(bool(found), closed, time)

    def _closed(self, snapshot: Snapshot) -> bool:
        return self.arm is None or snapshot.gripper[self.arm] < GRIPPER_CLOSED


HIT_REACH = 0.02
"""The head must be this near [m] to the middle of an object's top, in x and in y."""


class HitCounter(PressCounter):
    """Counts how often `tool` hits object `name` with its `head` on the object's `frame`.

    A hit is a contact of the two while head and frame are less than HIT_REACH apart in x and in y;
    neither height nor speed is looked at (official).
    """

    def __init__(self, name: str, frame: Pose, tool: str, head: Pose) -> None:
        super().__init__(name, frame)
        self._tool = tool
        self._head = head

    def contacts(self, snapshot: Snapshot) -> list[Contact]:
        """Contacts of tool and object, none unless the tool's head is over the frame."""
        x, y, _ = snapshot.poses[self._tool].apply(self._head.position)
        fx, fy, _ = snapshot.poses[self.name].apply(self.frame.position)
        if abs(x - fx) >= HIT_REACH or abs(y - fy) >= HIT_REACH:
            return []
        pair = {self.name, self._tool}
        return [c for c in snapshot.contacts if {c.first, c.second} == pair]


ON = 0.01
"""Offset [m] in x, y and z within which the object is on its target."""
OFF = 0.02
"""Offset [m] in x, y or z beyond which the next stamp can count."""


class StampCounter:
    """Counts how often `name` comes down onto `target`: origins within ON of each other."""

    carried = True
    """The object is grasped, not pressed: closing near it is an attempt to take it."""

    def __init__(self, name: str, target: str) -> None:
        self.name = name
        self.target = target
        self.count = 0
        self.raw_count = 0
        """Stamps with the official re-arming height of 1 cm."""
        self.pressing = False
        self._armed = True
        self._raw_armed = True

    def figures(self) -> dict[str, int]:
        return figures(self.count, self.count, self.raw_count)

    def offset(self, snapshot: Snapshot) -> tuple[float, float]:
        """Largest level offset and height difference [m] of the two origins."""
        x, y, z = snapshot.poses[self.name].position
        tx, ty, tz = snapshot.poses[self.target].position
        return max(abs(x - tx), abs(y - ty)), abs(z - tz)

    def start(self, snapshot: Snapshot) -> None:
        level, height = self.offset(snapshot)
        self.pressing = level < ON and height < ON
        self._armed = self._raw_armed = not self.pressing

    def update(self, snapshot: Snapshot) -> bool:
        level, height = self.offset(snapshot)
        if level > OFF or height > OFF:
            self._armed = True
        if level > OFF or height > ON:
            self._raw_armed = True
        self.pressing = level < ON and height < ON
        if not self.pressing:
            return False
        self.raw_count += self._raw_armed
        new, self._armed, self._raw_armed = self._armed, False, False
        self.count += new
        return new


def inside_box(point: Vec3, centre: Vec3, half: Vec3) -> bool:
    """True if `point` lies strictly inside the axis-aligned box around `centre`."""
    return (
        abs(point[0] - centre[0]) < half[0]
        and abs(point[1] - centre[1]) < half[1]
        and abs(point[2] - centre[2]) < half[2]
    )


UPRIGHT = math.cos(math.radians(36.87))
"""Least height of an upright object's own unit z axis (official: 0.8)."""

AT_HANDLE = 0.03
"""A grasp centre this near [m] to a handle is at it."""

PoseTest = Callable[[Snapshot, Pose], bool]
"""True if the condition holds, given the pose that the object had at the start."""


def held_up(name: str, above: float, handles: Sequence[Vec3]) -> PoseTest:
    """Upright, origin above `above` [m, world], left and right grasp centre at the two handles.

    `handles` are given in the object's frame.
    """

    def test(snapshot: Snapshot, home: Pose) -> bool:
        pose = snapshot.poses[name]
        if pose.position[2] <= above or not upright(pose):
            return False
        return all(
            math.dist(point, pose.apply(handle)) < AT_HANDLE
            for point, handle in zip(snapshot.grasp_points, handles, strict=True)
        )

    return test


def put_down(name: str, height: tuple[float, float], aside: float) -> PoseTest:
    """Upright, origin between so many metres over its first height, and nearly where it was.

    `aside` [m] bounds the way on the plan.
    """

    def test(snapshot: Snapshot, home: Pose) -> bool:
        pose = snapshot.poses[name]
        rise = pose.position[2] - home.position[2]
        away = math.dist(pose.position[:2], home.position[:2])
        return height[0] < rise < height[1] and away < aside and upright(pose)

    return test


def raised(name: str, rise: float) -> PoseTest:
    """The origin is more than `rise` [m] over its first height."""

    def test(snapshot: Snapshot, home: Pose) -> bool:
        return snapshot.height(name) > home.position[2] + rise

    return test


def back_home(name: str, way: float, turn: float) -> PoseTest:
    """Each coordinate within `way` [m], each quaternion component within `turn` of the start."""

    def test(snapshot: Snapshot, home: Pose) -> bool:
        pose = snapshot.poses[name]
        if any(abs(a - b) >= way for a, b in zip(pose.position, home.position, strict=True)):
            return False
        pairs = list(zip(pose.rotation, home.rotation, strict=True))
        sign = 1.0 if sum(a * b for a, b in pairs) >= 0 else -1.0
        return all(abs(a * sign - b) < turn for a, b in pairs)

    return test


def upright(pose: Pose) -> bool:
    """True if the object stands within about 37 degrees of upright."""
    return rotate(pose.rotation, (0.0, 0.0, 1.0))[2] > UPRIGHT


class CycleCounter:
    """Counts cycles of `up`, then `down` while not `up`, of object `name`.

    A gripper that is not open holds the object while its grasp centre is within `radius` [m] of the
    origin.
    """

    carried = True

    def __init__(self, name: str, up: PoseTest, down: PoseTest, radius: float = 0.12) -> None:
        self.name = name
        self.count = 0
        self.pressing = False
        """Whether the object is up or on its way down."""
        self.radius = radius
        self._up = up
        self._down = down
        self._home = Pose()
        self._lifts = 0
        self._pending = False
        self._released = 0

    def start(self, snapshot: Snapshot) -> None:
        self._home = snapshot.poses[self.name]

    def update(self, snapshot: Snapshot) -> bool:
        if self._pending and not closed_near(snapshot, snapshot.position(self.name), self.radius):
            self._pending, self._released = False, self._released + 1
        if self._up(snapshot, self._home):
            self._lifts += not self.pressing
            self.pressing, self._pending = True, False
        elif self.pressing and self._down(snapshot, self._home):
            self.pressing, self._pending = False, True
            self.count += 1
            return True
        return False

    def figures(self) -> dict[str, int]:
        """Lifts, and cycles before the last that ended in a release.

        The last cycle ends the trial, so that its release is not seen.
        """
        return {"lifts": self._lifts, "released": self._released}
