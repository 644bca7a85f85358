"""Counting what is done to an object: presses, hits with a tool, stamps.

Officially a gripper is in contact with an object at every point that the simulator reports between
its fingers and the object, from about 2 cm of separation on and whatever the impulse. A press
counts when such a contact begins in the box around the frame. The next one needs 0.1 s without
one; officially a single physics step does. Where the gripper has to be closed, opening it on the
object is no leaving (official). Presses that push on the object are counted beside it.

The official rule counts a stamp within 1 cm and re-arms beyond 1 cm in height, so that a bounce at
that height counts again and again; here re-arming takes 2 cm in every direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from robospa.geometry import Pose, Vec3
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
        """Begin with what is touched now not counting."""
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
        """Presses, those that pushed on the object, and those without re-arming."""
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
        """Begin with what is touched now not counting as a press."""
        found = self.contacts(snapshot)
        self.pressing = bool(found) and self._closed(snapshot)
        self._reported.start(bool(found), snapshot.time)
        self._pushed.start(any(c.touching for c in found), snapshot.time)

    def update(self, snapshot: Snapshot) -> bool:
        """True if a press begins at this instant."""
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
        """Stamps, all of which come onto their target, and those without re-arming."""
        return figures(self.count, self.count, self.raw_count)

    def offset(self, snapshot: Snapshot) -> tuple[float, float]:
        """Largest level offset and height difference [m] of the two origins."""
        x, y, z = snapshot.poses[self.name].position
        tx, ty, tz = snapshot.poses[self.target].position
        return max(abs(x - tx), abs(y - ty)), abs(z - tz)

    def start(self, snapshot: Snapshot) -> None:
        """Standing on the target from the start is no stamp."""
        level, height = self.offset(snapshot)
        self.pressing = level < ON and height < ON
        self._armed = self._raw_armed = not self.pressing

    def update(self, snapshot: Snapshot) -> bool:
        """True if a stamp begins at this instant."""
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
