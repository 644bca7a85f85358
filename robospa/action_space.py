"""What the numbers of an action mean: which columns are whose joints, gripper or pose.

    joint       per arm its joints [rad], then its gripper
    ee          per arm x y z [m], qw qx qy qz (world frame), then its gripper
    delta_ee    the same, as a motion in the frame of the end effector

The left arm comes first; a gripper is 0 closed to 1 open. A state has the columns of a `joint`
action, poses of an observation, (2, 8), those of an `ee` action.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

KINDS = ("joint", "ee", "delta_ee")
ARMS = ("left", "right")

POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")

SIX_JOINT_ARMS = (6, 6)
"""Joints of the arms that policies of RoboTwin's data drive: whose server does not say is taken to
drive these."""
SEVEN_JOINT_ARMS = (7, 7)


@dataclass(frozen=True)
class ArmColumns:
    """The columns of one arm. `body` are all but the gripper: its joints, or its pose, which is
    `position` and `quaternion`; both are empty in a `joint` action."""

    name: str
    all: slice
    body: slice
    gripper: int
    position: slice
    quaternion: slice


@dataclass(frozen=True)
class ActionSpace:
    """A `kind` of action for two arms with so many `joints` each, which need not be equal.

    Raises ValueError for a kind that does not exist.
    """

    kind: str = "joint"
    joints: tuple[int, int] = SIX_JOINT_ARMS

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"no action space {self.kind!r}; there are joint, ee and delta_ee")

    @cached_property
    def arms(self) -> tuple[ArmColumns, ArmColumns]:
        """The columns of the left and the right arm."""
        left = self._arm(0, 0)
        return left, self._arm(1, left.all.stop)

    def _arm(self, arm: int, start: int) -> ArmColumns:
        if self.kind == "joint":
            end = start + self.joints[arm]
            position = quaternion = slice(start, start)
        else:
            end = start + len(POSE)
            position, quaternion = slice(start, start + 3), slice(start + 3, end)
        whole = slice(start, end + 1)
        return ArmColumns(ARMS[arm], whole, slice(start, end), end, position, quaternion)

    @cached_property
    def width(self) -> int:
        """Columns of an action: 14 for two arms of six joints, 16 for two poses."""
        return self.arms[1].gripper + 1

    @cached_property
    def grippers(self) -> list[int]:
        """The columns of both grippers."""
        return [arm.gripper for arm in self.arms]

    @cached_property
    def bodies(self) -> list[int]:
        """All other columns."""
        return [column for column in range(self.width) if column not in self.grippers]

    @cached_property
    def labels(self) -> list[str]:
        """What every column means: "left joint 3", "right qw", "left gripper"."""
        names: list[str] = []
        for arm, count in zip(ARMS, self.joints, strict=True):
            joints = [f"joint {i + 1}" for i in range(count)]
            parts = joints if self.kind == "joint" else list(POSE)
            names += [f"{arm} {part}" for part in (*parts, "gripper")]
        return names


# -- quantised actions ---------------------------------------------------------------------------
#
# A policy's numbers are quantised once, before they are executed and recorded, so what is executed,
# recorded, submitted and replayed is one and the same. 2^-16 is 0.0009 degrees or 15 micrometres,
# far below the resolution of any encoder of such arms; the bits below it are noise that would make
# up half of a submission. Rounding is exact in float32 (multiplying by a power of two, nearest
# whole number, ties to even): the same on every machine, and quantising again changes nothing.

STEPS_PER_UNIT = 2**16
"""Steps in a radian, a metre, a whole gripper or quaternion unit."""
LARGEST = 32767
"""Larger numbers are clipped to this; no joint, position or quaternion is near it."""


def quantize(actions: NDArray[np.float32]) -> NDArray[np.float32]:
    """`actions`, finite float32 of any shape, each number rounded to the nearest step."""
    steps = np.rint(np.clip(actions, -LARGEST, LARGEST) * np.float32(STEPS_PER_UNIT))
    return np.asarray(steps / np.float32(STEPS_PER_UNIT) + np.float32(0.0), dtype=np.float32)


def nearest(value: float) -> float:
    """The step nearest to `value`, of two the even one."""
    return round(value * STEPS_PER_UNIT) / STEPS_PER_UNIT


def is_quantized(actions: NDArray[np.float32]) -> bool:
    """True if `quantize` leaves every bit of `actions` as it is."""
    if not np.isfinite(actions).all():
        return False
    return quantize(actions).tobytes() == np.ascontiguousarray(actions, dtype=np.float32).tobytes()
