"""What a policy is: a spec, and three calls. In process or behind a server, it is the same.

An observation is a plain dict of numpy arrays and scalars:

    images      {camera: uint8 (height, width, 3) RGB} of exactly the cameras in the spec
    state       float32 (D,): left arm joints [rad], left gripper 0..1, right arm, right gripper
    ee          float32 (2, 8): per arm x y z [m], qw qx qy qz, gripper (world frame)
    instruction str
    step        int, number of actions executed so far in this trial
    history     {offset: {"images": ..., "state": ...}} for the offsets in the spec
    privileged  only if the spec asks: the exact state as JSON values

An action chunk is float32 (T, D): T actions to execute one after the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

CAMERAS = ("head", "left_wrist", "right_wrist", "front", "third")
STATES = ("commanded", "measured", "none")
SPACES = ("joint", "ee", "delta_ee")

Observation = Mapping[str, Any]


@dataclass(frozen=True)
class CameraSpec:
    """One wanted image; `width` and `height` [px]."""

    name: str
    width: int = 320
    height: int = 240


DEFAULT_CAMERAS = (CameraSpec("head"), CameraSpec("left_wrist"), CameraSpec("right_wrist"))


@dataclass(frozen=True)
class PolicySpec:
    """What a policy wants to see and what it answers.

    `state`: joints as commanded (official convention) or as measured, or none. `action`: the
    space of its actions. `horizon`: actions per chunk (the most it may send); `execute`: how many
    of them are executed before it is asked again, None for all. `history`: offsets in executed
    actions, all negative, whose observations it wants beside the present one. `batch`: how many
    observations one call of `infer_batch` may hold. `seeded`: whether it honours the policy seed.
    `privileged`: whether it needs the exact state (no honest learned policy does).
    """

    name: str
    cameras: tuple[CameraSpec, ...] = DEFAULT_CAMERAS
    state: str = "commanded"
    action: str = "joint"
    horizon: int = 50
    execute: int | None = None
    history: tuple[int, ...] = ()
    image_codec: str = "raw"
    batch: int = 1
    seeded: bool = False
    privileged: bool = False
    embodiments: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Plain JSON values; `from_json` (in `robospa.protocol.messages`) is the inverse."""
        data = asdict(self)
        return {k: list(v) if isinstance(v, tuple) else v for k, v in data.items()}


@dataclass(frozen=True)
class TrialInfo:
    """What a policy learns at reset. `policy_seed` makes a stochastic policy repeatable."""

    task: str
    level: int
    seed: int
    embodiment: str
    mode: str
    split: str
    instruction: str
    policy_seed: int = 0
    extra: Mapping[str, Any] = field(default_factory=dict)


class Policy(Protocol):
    """A robot policy. `infer` returns float32 (T, D) with 1 <= T <= spec.horizon."""

    @property
    def spec(self) -> PolicySpec: ...

    def reset(self, trial: TrialInfo) -> None: ...

    def infer(self, observation: Observation) -> NDArray[np.float32]: ...


class BatchPolicy(Policy, Protocol):
    """A policy whose model runs several observations at once.

    `sessions` names the connection that each observation belongs to, so that per-trial state can
    be kept apart; an exception spoils the whole batch only if the policy lets it.
    """

    def infer_batch(
        self, observations: Sequence[Observation], sessions: Sequence[int]
    ) -> list[NDArray[np.float32]]: ...
