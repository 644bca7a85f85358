"""What a policy is shown: the keys, shapes and units of an observation, and the names of cameras.

An observation is a plain dict of numpy arrays and scalars. A policy gets exactly the images that
its spec names, `state` unless it wants none, `history` and `privileged` only if it asks for them.
"""

from __future__ import annotations

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
    """One wanted image; `width` and `height` [px]."""

    name: Annotated[str, one_of(CAMERAS)]
    width: Pixels = 320
    height: Pixels = 240


DEFAULT_CAMERAS = (CameraSpec("head"), CameraSpec("left_wrist"), CameraSpec("right_wrist"))


class View(TypedDict, total=False):
    """What is seen at one instant."""

    images: dict[str, NDArray[np.uint8]]
    """By camera, (height, width, 3) RGB."""
    state: NDArray[np.float32]
    """(D,): left arm joints [rad], left gripper 0 closed to 1 open, right arm, right gripper."""
    ee: NDArray[np.float32]
    """(2, 8): per arm x y z [m], qw qx qy qz, gripper (world frame)."""


class Observation(View, total=False):
    """What a policy is asked with: the present view, and what goes with it."""

    instruction: str
    step: int
    """Number of actions executed so far in this trial."""
    history: dict[int, View]
    """Earlier views by their offset in executed actions, for the offsets in the spec."""
    privileged: Mapping[str, Any]
    """The exact state as JSON values."""
