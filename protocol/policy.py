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

from robospa.protocol.errors import DecodeError
from robospa.protocol.validate import Fields, is_name

CAMERAS = ("head", "left_wrist", "right_wrist", "front", "third")
STATES = ("commanded", "measured", "none")
SPACES = ("joint", "ee", "delta_ee")
CODECS = ("raw", "jpeg")

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
    `privileged`: whether it needs the exact state (no honest learned policy does). `action_dim`:
    columns of a chunk, None for 14 or 16, whichever the embodiment and the space have.
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
    action_dim: int | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain JSON values; `from_json` is the inverse."""
        data = asdict(self)
        return {k: list(v) if isinstance(v, tuple) else v for k, v in data.items()}

    @classmethod
    def from_json(cls, value: Any) -> PolicySpec:
        """The spec in a decoded map; unknown fields are ignored. Raises DecodeError."""
        fields = Fields("spec", value)
        cameras = tuple(_camera(item) for item in fields.items("cameras", DEFAULT_CAMERAS))
        if len({camera.name for camera in cameras}) != len(cameras):
            raise DecodeError("spec: 'cameras' names a camera twice")
        horizon = fields.whole("horizon", 50, 1, 10_000)
        execute = fields.raw("execute", None)
        action_dim = fields.raw("action_dim", None)
        history = fields.items("history", ())
        if len(history) > 64 or not all(type(n) is int and -10_000 <= n < 0 for n in history):
            raise DecodeError(
                "spec: 'history' must be a list of at most 64 negative whole numbers from -10000 up"
            )
        embodiments = fields.items("embodiments", ())
        if not all(is_name(name) for name in embodiments):
            raise DecodeError("spec: 'embodiments' must be a list of text that can be printed")
        return cls(
            name=fields.name("name"),
            cameras=cameras,
            state=fields.text("state", "commanded", STATES),
            action=fields.text("action", "joint", SPACES),
            horizon=horizon,
            execute=None if execute is None else fields.whole("execute", None, 1, horizon),
            history=tuple(history),
            image_codec=fields.text("image_codec", "raw", CODECS),
            batch=fields.whole("batch", 1, 1, 4096),
            seeded=fields.flag("seeded", False),
            privileged=fields.flag("privileged", False),
            embodiments=tuple(embodiments),
            action_dim=None if action_dim is None else fields.whole("action_dim", None, 1, 256),
        )

    @property
    def action_dims(self) -> tuple[int, ...]:
        """The allowed column counts of an action chunk (14: two 6-joint arms; 16: two 7-joint
        arms, or two poses with a gripper each)."""
        if self.action_dim is not None:
            return (self.action_dim,)
        return (16,) if self.action == "ee" else (14, 16)


def _camera(value: Any) -> CameraSpec:
    if isinstance(value, CameraSpec):
        return value
    fields = Fields("spec camera", value)
    return CameraSpec(
        fields.text("name", choices=CAMERAS),
        fields.whole("width", 320, 1, 8192),
        fields.whole("height", 240, 1, 8192),
    )


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

    def to_json(self) -> dict[str, Any]:
        """Plain JSON values; `from_json` is the inverse."""
        return {**{k: v for k, v in self.__dict__.items() if k != "extra"}, "extra": self.extra}

    @classmethod
    def from_json(cls, value: Any) -> TrialInfo:
        """The trial in a decoded map; unknown fields are ignored. Raises DecodeError."""
        fields = Fields("trial", value)
        return cls(
            task=fields.identifier("task"),
            level=fields.whole("level", low=0),
            seed=fields.whole("seed", low=0, high=2**64 - 1),
            embodiment=fields.identifier("embodiment"),
            mode=fields.identifier("mode"),
            split=fields.identifier("split"),
            instruction=fields.text("instruction"),
            policy_seed=fields.whole("policy_seed", 0, 0, 2**64 - 1),
            extra=fields.map("extra", {}),
        )


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
