"""What a policy is: a spec, and three calls. In process or behind a server, it is the same.

What a policy is shown is `robospa.observation`; an action chunk is float32 (T, D): T actions to
execute one after the other.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields
from typing import Annotated, Protocol, TypeGuard, cast

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from robospa.action_space import KINDS, SEVEN_JOINT_ARMS, SIX_JOINT_ARMS, ActionSpace
from robospa.observation import DEFAULT_CAMERAS, STATES, CameraSpec, Observation
from robospa.protocol.codec import Limits
from robospa.protocol.errors import DecodeError, HandshakeError, PolicyAnswerError, printable
from robospa.registry import ROBOTS, UnknownName, find
from robospa.schema import Identifier, SettingName, describe, one_of, read
from robospa.trial import REFERENCE, TrialKey

CODECS = ("raw", "jpeg")
SKILL, POINT = "skill", "point"
CALLED = (SKILL, POINT)
"""The spaces of policies that answer calls (`robospa.protocol.calls`) and no chunks: of skills, or,
where nothing is moved, the point of the object that is asked for."""
PolicyAnswer = NDArray[np.float32] | list[dict[str, object]]
"""A chunk of actions, float32 (T, D), or calls of skills."""
JOINT_DIMS = tuple(
    ActionSpace("joint", joints).width for joints in (SIX_JOINT_ARMS, (6, 7), SEVEN_JOINT_ARMS)
)
POSE_DIMS = (ActionSpace("ee").width,)

MAX_HORIZON = 10_000
"""Actions of a chunk, whatever a policy declares."""

Whole = Annotated[int, Meta(ge=0, le=2**63 - 1)]
Seed = Annotated[int, Meta(ge=0)]  # up to 2^64 - 1: more does not fit into a message
Joints = Annotated[int, Meta(ge=1, le=32)]
Offset = Annotated[int, Meta(ge=-10_000, lt=0)]


@dataclass(frozen=True)
class PolicySpec:
    """What a policy reads and what it answers.

    PolicySpec("my-policy", cameras=(CameraSpec("head", 224, 224),), action="joint", horizon=8)
    """

    name: str
    """Appears in results: printable, at most 200 characters."""
    cameras: tuple[CameraSpec, ...] = DEFAULT_CAMERAS
    """The images that are rendered and sent; head and both wrists at 320x240 by default."""
    state: Annotated[str, one_of(STATES)] = "commanded"
    """Joints as `commanded` (the official convention), as `measured`, or `none`."""
    action: Annotated[str, one_of((*KINDS, *CALLED))] = "joint"
    """Space of the actions: `joint` (absolute targets, laid out as the observation's `state`), `ee`
    (per arm x y z [m], qw qx qy qz, gripper), `delta_ee`, or calls: of skills (`skill`), or of a
    point in a picture (`point`)."""
    horizon: Annotated[int, Meta(ge=1, le=MAX_HORIZON)] | None = None
    """The most actions that a chunk may hold; None if it is not declared: up to 10,000."""
    execute: Annotated[int, Meta(ge=1)] | None = None
    """Actions of a chunk that are executed before the next query; None for all."""
    history: Annotated[tuple[Offset, ...], Meta(max_length=64)] = ()
    """Earlier observations that it reads as well: negative offsets in executed actions, in
    real time in periods."""
    image_codec: Annotated[str, one_of(CODECS)] = "raw"
    """How images travel: `raw`, or `jpeg` (quality 90)."""
    batch: Annotated[int, Meta(ge=1, le=4096)] = 1
    """Observations that one call of `infer_batch` may hold."""
    seeded: bool = False
    """Whether equal policy seeds and observations give equal actions."""
    privileged: bool = False
    """Whether it reads the exact state of the simulation, as no learned policy does."""
    environment_state: bool = False
    """Whether it reads the objects' poses, sizes and colours as numbers
    (`robospa.observation`): such a policy counts as privileged in all results."""
    needs_trial_key: bool = False
    """Whether it asks for the trial's level, seed, scene mode and split, from which its scene can
    be rebuilt with the answer: such a policy is marked in all results and never ranked."""
    committed_actions: bool = False
    """Whether it reads, in real time, the actions that the robot goes on with while it computes:
    what real-time chunking needs (the observation's `committed` and `delay`)."""
    embodiments: tuple[str, ...] = ()
    """Names of the robots that it can drive; empty for any."""
    action_dim: Annotated[int, Meta(ge=1, le=256)] | None = None
    """Columns of a chunk; None for those of the robot and the space (14 to 16, `ee`: 16)."""
    text_budget: Annotated[int, Meta(ge=1)] | None = None
    """Tokens of an instruction that its model reads, the rest is cut off; None for no limit."""
    checkpoint: str = ""
    """The weights behind it, in a text that changes with them, such as a file's hash or a revision;
    empty if it tells none. Another one never continues a run. Printable, at most 200 characters."""

    contract: Annotated[tuple[str, ...], Meta(max_length=64)] = ()
    """What decides its answers beside the weights, each as `NAME=TEXT`, such as `normalisation` (a
    hash of its statistics), `actions`, `pictures` (how they are cut and scaled) and `dtype`."""

    def to_json(self) -> dict[str, object]:
        """Plain JSON values, `contract` only if there is one; `from_json` is the inverse."""
        data = asdict(self)
        if not self.contract:
            del data["contract"]
        return {k: list(v) if isinstance(v, tuple) else v for k, v in data.items()}

    @classmethod
    def from_json(cls, value: object) -> PolicySpec:
        """The spec in a decoded map; unknown fields are ignored. Raises DecodeError."""
        spec = read(cls, value, "spec", DecodeError)
        check_spec(spec)
        return spec

    @property
    def sees_state(self) -> bool:
        """Whether it is told of the objects what others have to see in images."""
        return self.privileged or self.environment_state

    @property
    def executed(self) -> str:
        """Space of the actions that are executed and recorded: skills move joints."""
        return "joint" if self.action in CALLED else self.action

    @property
    def action_dims(self) -> tuple[int, ...]:
        """The allowed column counts of an action chunk: `action_dim`, or those of two arms of six
        or seven joints (14 to 16), or of two poses (16)."""
        if self.action_dim is not None:
            return (self.action_dim,)
        return POSE_DIMS if self.action == "ee" else JOINT_DIMS


def robot_of(spec: PolicySpec) -> str:
    """The default robot where `spec` drives it, else the first that it names."""
    return (
        REFERENCE if not spec.embodiments or REFERENCE in spec.embodiments else spec.embodiments[0]
    )


def joints_of(spec: PolicySpec) -> tuple[int, int]:
    """Joints of the arms that `spec` drives: those of its robot, or, where that is not installed
    here, of arms as wide as its actions, equal ones where that can be."""
    with suppress(UnknownName):
        left, right = find(ROBOTS, robot_of(spec), "robot").arms
        return len(left.joints), len(right.joints)
    width = spec.action_dim if spec.action == "joint" else None
    if width is None or width < 4:
        return SIX_JOINT_ARMS
    return (width - 2) // 2, (width - 1) // 2


def check_spec(spec: PolicySpec) -> None:
    """Raises DecodeError if the parts of a spec that was read do not fit together."""
    if len({camera.name for camera in spec.cameras}) != len(spec.cameras):
        raise DecodeError("spec: 'cameras' names a camera twice")
    if spec.execute is not None and spec.horizon is not None and spec.execute > spec.horizon:
        raise DecodeError(
            f"spec: 'execute' must be at most the horizon {spec.horizon}, not {spec.execute}"
        )
    texts = {
        "name": (spec.name,),
        "embodiments": spec.embodiments,
        "checkpoint": (spec.checkpoint,),
        "contract": spec.contract,
    }
    if strange := [part for part in spec.contract if not part.partition("=")[2]]:
        raise DecodeError(f"spec: 'contract' has NAME=TEXT, not {describe(strange[0])}")
    for what, names in texts.items():
        for name in names:
            check_printable(f"spec: {what!r}", name)


def check_printable(what: str, text: str) -> None:
    """Raises DecodeError if `text` cannot stand in a table or on a terminal as it is."""
    if len(text) > 200 or not text.isprintable():
        expected = "printable text of at most 200 characters"
        raise DecodeError(f"{what} must be {expected}, not {describe(text)}")


@dataclass(frozen=True)
class TrialInfo:
    """The argument of `Policy.reset`: the trial that begins, without what would name its scene."""

    task: Identifier
    """Name of the task, by which a server may choose a checkpoint."""
    embodiment: SettingName
    """Name of the robot."""
    instruction: str
    """The sentence of the trial."""
    policy_seed: Seed = 0
    """Seed of all randomness of the policy in this trial, 0 to 2^64 - 1."""
    id: Identifier = ""
    """A name of the trial for logs and files, which means nothing."""
    key: TrialKey | None = None
    """Which trial it is; only for a policy whose spec `needs_trial_key`."""
    extra: Mapping[str, object] = field(default_factory=dict)
    """More JSON values; may be empty."""
    joints: tuple[Joints, Joints] = SIX_JOINT_ARMS
    """Joints of the left and the right arm: `state` and joint actions have their columns
    (`robospa.action_space.ActionSpace("joint", joints)`)."""

    def to_json(self) -> dict[str, object]:
        """Plain JSON values, `key` only if there is one; `from_json` is the inverse."""
        names = [one.name for one in fields(self) if one.name != "key"]
        data = {name: getattr(self, name) for name in names} | {"joints": list(self.joints)}
        return data if self.key is None else {**data, "key": asdict(self.key)}

    @classmethod
    def from_json(cls, value: object) -> TrialInfo:
        """The trial in a decoded map; unknown fields are ignored. Raises DecodeError."""
        return read(cls, value, "trial", DecodeError)


class Policy(Protocol):
    """A robot policy, in process or behind a server."""

    @property
    def spec(self) -> PolicySpec:
        """What the policy reads and answers."""

    def reset(self, trial: TrialInfo) -> None:
        """A trial begins: forget the one before."""

    def infer(self, observation: Observation) -> PolicyAnswer:
        """The next actions: float32 (T, D), all numbers finite, at least one row and at most
        `spec.horizon` where that is declared; of the space `skill` a list of calls."""


class OptionalMembers(Policy, Protocol):
    """What a policy may have beside its three calls, each on its own; `has` says which are there.

    `sessions` names the connection that each observation belongs to, so that the state of trials
    can be kept apart; an exception spoils the whole batch only if the policy lets it.
    """

    def infer_batch(
        self, observations: Sequence[Observation], sessions: Sequence[int]
    ) -> Sequence[PolicyAnswer]:
        """Several observations in one call of the model."""

    def reset_session(self, session: int, trial: TrialInfo) -> None:
        """A batch policy that keeps state by session: called instead of `reset`."""

    def end_session(self, session: int) -> None:
        """A connection to a batch policy has ended."""

    def end(self, outcome: Mapping[str, object]) -> None:
        """How the trial ended: JSON values such as success and steps."""

    def close(self) -> None:
        """Release what the policy holds."""

    def reconnect(self) -> None:
        """Open a new connection to the server behind this policy."""

    @property
    def hello(self) -> Mapping[str, object]:
        """The greeting of the server behind this policy, as JSON values."""

    @property
    def last_timing(self) -> Mapping[str, float]:
        """Times of the last answer that the server reported [ms]; and what the trial has used
        so far, by the names of USAGE."""


def has(policy: object, member: str) -> TypeGuard[OptionalMembers]:
    """Whether `policy` has this one of the optional members."""
    return hasattr(policy, member)


USAGE = (
    "requests", "repairs", "unanswered", "input_tokens", "output_tokens", "cost", "seconds",
    "exhausted",
)  # fmt: skip
"""What a policy that asks a paid model may report of its trial: answers of the model, those of them
that could not be used, requests without an answer; tokens; money; seconds that the answers took;
and 1 if the trial ended because it had used up what it may use."""

SPACES = ("joint", "ee")
"""Action spaces that the dialects of other projects have."""


def check_chunk(
    answer: object, spec: PolicySpec, options: Collection[str] = (), *, exact: bool = False
) -> NDArray[np.float32]:
    """`answer` as the float32 (T, D) chunk that `spec` promises, or PolicyAnswerError.

    `options`: those that the dialect of its server has; the error names the one that mends it.
    `exact`: refuse other floats than float32, which do not exist on the wire.
    """
    if not isinstance(answer, np.ndarray) or answer.dtype.kind != "f":
        found = getattr(answer, "dtype", type(answer).__name__)
        if isinstance(answer, Mapping):
            found = f"a map of {printable(', '.join(map(str, answer)), 80) or 'nothing'}"
        raise PolicyAnswerError(f"the policy answered {found}, not an array of float32")
    if exact and answer.dtype != np.float32:
        raise PolicyAnswerError(f"the policy answered {answer.dtype}, not float32")
    most = MAX_HORIZON if spec.horizon is None else spec.horizon
    if answer.ndim != 2 or not 1 <= len(answer) <= most:
        horizon = most if spec.horizon is None else f"its horizon {most}"
        raise PolicyAnswerError(
            f"the policy answered an array of shape {answer.shape}, not (T, D) with T from 1 to "
            f"{horizon}{_remedy(answer, spec, options)}"
        )
    if answer.shape[1] not in spec.action_dims:
        raise PolicyAnswerError(
            f"the policy answered {answer.shape[1]} numbers per action, but a {spec.action} "
            f"action has {' or '.join(map(str, spec.action_dims))}"
            f"{_remedy(answer, spec, options)}"
        )
    with np.errstate(over="ignore"):
        chunk = np.ascontiguousarray(answer, dtype=np.float32)
    finite = np.isfinite(chunk)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        raise PolicyAnswerError(
            f"the policy answered {chunk[row, column]} in action {row}, dimension {column}"
        )
    return chunk


def _remedy(answer: NDArray[np.generic], spec: PolicySpec, options: Collection[str]) -> str:
    """What to add to the URL so that a chunk of this shape is taken; "" if nothing helps."""
    if answer.ndim != 2 or len(answer) == 0:
        return ""
    length, width = answer.shape
    if width in spec.action_dims:
        if "horizon" not in options or length > MAX_HORIZON:
            return ""
        return (
            f"; write ?horizon={length} to execute all of them, with execute={spec.horizon} to "
            f"execute the first {spec.horizon}"
        )
    others = [kind for kind in SPACES if kind != spec.action and ActionSpace(kind).width == width]
    if "space" in options and others:
        return f"; write ?space={others[0]} if these are {others[0]} actions"
    return f"; write ?action_dim={width} if it is right" if "action_dim" in options else ""


def check_observation(observation: Mapping[str, object], spec: PolicySpec) -> Observation:
    """`observation` (images decoded) itself, typed.

    Raises DecodeError if it lacks what `spec` asks for.
    """
    _check_view("observation", observation, spec)
    if not isinstance(observation.get("instruction"), str):
        raise DecodeError("observation: 'instruction' must be text")
    history = observation.get("history", {}) if spec.history else {}
    for offset in spec.history:
        if not isinstance(history, dict) or offset not in history:
            raise DecodeError(f"observation lacks history {offset}, which the spec asks for")
        _check_view(f"history {offset}", history[offset], spec)
    if spec.privileged and not isinstance(observation.get("privileged"), dict):
        raise DecodeError("observation lacks the privileged state that the spec asks for")
    if spec.environment_state:
        objects = observation.get("environment_state")
        if not isinstance(objects, np.ndarray) or objects.ndim != 1 or objects.dtype != np.float32:
            raise DecodeError("observation: 'environment_state' must be float32 of one axis")
    calls = observation.get("calls")
    if spec.action in CALLED and not (
        isinstance(calls, list) and all(isinstance(call, dict) for call in calls)
    ):
        raise DecodeError("observation: 'calls' must be a list of maps")
    if spec.committed_actions and "committed" in observation:
        rows, delay = observation["committed"], observation.get("delay")
        if not isinstance(rows, np.ndarray) or rows.ndim != 2 or rows.dtype != np.float32:
            raise DecodeError("observation: 'committed' must be float32 of two axes")
        if type(delay) is not int or delay < 0:
            raise DecodeError("observation: 'delay' must be a whole number from 0 up")
    return cast("Observation", observation)


def _check_view(what: str, view: object, spec: PolicySpec) -> None:
    images = view.get("images", {}) if isinstance(view, dict) else None
    if not isinstance(view, dict) or not isinstance(images, dict):
        raise DecodeError(f"{what}: 'images' must be a map from camera to array")
    for camera in spec.cameras:
        image, shape = images.get(camera.name), (camera.height, camera.width, 3)
        if not isinstance(image, np.ndarray):
            raise DecodeError(f"{what} lacks the image of camera {camera.name!r}")
        if image.shape != shape or image.dtype != np.uint8:
            raise DecodeError(
                f"{what}: image {camera.name!r} is {image.dtype} {image.shape}, not uint8 {shape}"
            )
    if spec.state != "none":
        state = view.get("state")
        if not isinstance(state, np.ndarray) or state.ndim != 1 or state.dtype != np.float32:
            raise DecodeError(f"{what}: 'state' must be a float32 array of one axis")


def check_size(spec: PolicySpec, limits: Limits, url: str) -> None:
    """Raises HandshakeError if the images that `spec` asks for fit into no message."""
    sizes = [3 * camera.width * camera.height for camera in spec.cameras]
    total = sum(sizes) * (1 + len(spec.history)) if spec.image_codec == "raw" else 0
    if total > limits.message or max(sizes, default=0) > limits.array:
        raise HandshakeError(
            f"the server at {url} asks for {max(total, *sizes) / 1e6:.0f} MB of images in an "
            f"observation, and a message may have {limits.message / 1e6:.0f} MB: ask for smaller "
            "images"
        )
