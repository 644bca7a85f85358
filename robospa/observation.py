"""The observation: its keys, shapes and units, and the names of cameras.

An observation is a plain dict of numpy arrays and scalars. A policy gets exactly the images that
its spec names, `state` unless that is `none`, `history`, `privileged` and `environment_state` only
if the spec has them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, TypedDict

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from robospa.schema import one_of

CAMERAS = ("head", "left_wrist", "right_wrist", "front", "third")
STATES = ("commanded", "measured", "none")

Pixels = Annotated[int, Meta(ge=1, le=8192)]


@dataclass(frozen=True)
class CameraSpec:
    """An image that a policy reads."""

    name: Annotated[str, one_of(CAMERAS)]
    """`head`, `left_wrist`, `right_wrist`, `front` or `third`."""
    width: Pixels = 320
    """In pixels, 1 to 8192."""
    height: Pixels = 240
    """In pixels, 1 to 8192."""


DEFAULT_CAMERAS = (CameraSpec("head"), CameraSpec("left_wrist"), CameraSpec("right_wrist"))


class View(TypedDict, total=False):
    """Images and robot state at one instant."""

    images: dict[str, NDArray[np.uint8]]
    """By camera, (height, width, 3) RGB."""
    state: NDArray[np.float32]
    """(D,): left arm joints [rad], left gripper 0 closed to 1 open, right arm, right gripper."""
    ee: NDArray[np.float32]
    """(2, 8): per arm x y z [m], qw qx qy qz, gripper (world frame)."""


class Observation(View, total=False):
    """The argument of `Policy.infer`: a dict of the present view and what goes with it.

    Besides the keys below it has those of a view, at the top level: `images`, a dict from camera to
    uint8 (height, width, 3) RGB; `state`, float32 (D,): left arm joints [rad], left gripper 0
    closed to 1 open, right arm, right gripper; `ee`, float32 (2, 8): per arm x y z [m],
    qw qx qy qz, gripper, in the world frame.
    """

    instruction: str
    """The sentence of the trial."""
    step: int
    """Number of actions executed so far in this trial; in real time, of periods of one."""
    executed: int
    """In real time: the same without the periods in which the robot held. For clients that keep the
    last command; `robospa.v1` does not send it."""
    history: dict[int, View]
    """Earlier views by their offset in executed actions (negative), for `PolicySpec.history`."""
    privileged: Mapping[str, Any]
    """The exact state of the simulation as JSON values, for `PolicySpec.privileged`."""
    committed: NDArray[np.float32]
    """(n, D): in real time with real-time chunking, for `PolicySpec.committed_actions`: what is
    left of the chunk in use, the next action first; n is 0 before the first chunk."""
    delay: int
    """Goes with `committed`: how many of these will be executed before the answer takes over, as
    far as can be foretold."""
    calls: list[dict[str, object]]
    """In the action space `skill`: all calls so far with their `feedback`, "done" or a sentence
    that says why not."""
    environment_state: NDArray[np.float32]
    """(E,): the objects as numbers, for `PolicySpec.environment_state`; what each of them is says
    `robospa.observation.NAMES`."""


SLOTS = 20
"""The most objects that a row can hold; the fullest scene has 17 (Observe_Blocks_Move_Memory)."""
TURNS = (1, 2, 4)
"""A turn about the vertical is given as cosine and sine of its multiples: those of 2 are the same
after half a turn, those of 4 after a quarter, as the objects' own shapes are."""
KIND_BITS = 12
FEATURES = (
    "present", "x", "y", "z",
    "cos_yaw", "sin_yaw", "cos_2yaw", "sin_2yaw", "cos_4yaw", "sin_4yaw",
    "up_x", "up_y", "up_z", "half_x", "half_y", "half_z", "red", "green", "blue", "hinge",
    *(f"kind_{bit}" for bit in range(KIND_BITS)),
)  # fmt: skip
"""Of a slot: 1 if the object exists at this instant; its origin [m, world]; turn of its x axis
about the vertical; its z axis (unit vector, world); half of its bounding box [m, along its own
axes]; colour of its largest part (linear RGB, 0..1); angle of its hinge [rad]; a code of -1 and 1
that stands for its asset."""
NAMES = tuple(f"slot_{slot}_{name}" for slot in range(SLOTS) for name in FEATURES)
"""What each number of a row is."""
WIDTH = len(NAMES)
