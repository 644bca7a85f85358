"""The messages of `robospa.v1` as frozen dataclasses, and their checks.

    client                     server
                               hello    once, right after the handshake (id 0)
    reset   trial          ->  ready    or error
    infer   observation    ->  actions  or error; `calls` of a policy of the space "skill"
    end     outcome        ->  ended    or error

Every request carries an id that its one answer repeats. Unknown fields are ignored (later minor
versions may add some), missing fields and wrong types are refused with DecodeError.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, ClassVar, get_args

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from robospa.protocol.codec import DEFAULT_LIMITS, Buffer, Limits, decode, encode
from robospa.protocol.errors import DecodeError, VersionMismatch
from robospa.protocol.policy import PolicySpec, TrialInfo, Whole, check_printable, check_spec
from robospa.schema import describe, read

VERSION = "1.1"
SUBPROTOCOL = "robospa.v1"
MAX_ID = 2**53
"""Request ids stay exact in languages whose only number is a double."""
RequestId = Annotated[int, Meta(ge=0, le=MAX_ID)]

# Codes of `error`, beside `POLICY_FAILED`. The list is open; a client must cope with others.
BAD_MESSAGE = "bad_message"  # the request could not be understood
BAD_OBSERVATION = "bad_observation"  # understood, but not what the spec asks for
NO_TRIAL = "no_trial"  # infer or end without a successful reset
BAD_ANSWER = "bad_answer"  # the policy answered something that is no chunk
BUSY = "busy"  # too many requests are waiting


@dataclass(frozen=True)
class Hello:
    """Server's first message. `server` is a name for people and records."""

    type: ClassVar[str] = "hello"
    id: RequestId
    version: str
    server: str
    spec: PolicySpec


@dataclass(frozen=True)
class Reset:
    """A trial begins; nothing of the one before may survive."""

    type: ClassVar[str] = "reset"
    id: RequestId
    trial: TrialInfo


@dataclass(frozen=True)
class Ready:
    """Answer to reset: the policy is ready for the first observation."""

    type: ClassVar[str] = "ready"
    id: RequestId


@dataclass(frozen=True, eq=False)
class Infer:
    """An observation that nobody has checked yet; see `robospa.observation` for its keys."""

    type: ClassVar[str] = "infer"
    id: RequestId
    observation: Mapping[str, object]


@dataclass(frozen=True, eq=False)
class Actions:
    """Answer to infer: `chunk` float32 (T, D). `timing`: queue_ms, infer_ms, batch."""

    type: ClassVar[str] = "actions"
    id: RequestId
    chunk: NDArray[np.float32]
    timing: Mapping[str, int | float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Calls:
    """Answer to infer of a policy of the action space "skill": maps (`robospa.protocol.calls`)."""

    type: ClassVar[str] = "calls"
    id: RequestId
    calls: list[object]
    timing: Mapping[str, int | float] = field(default_factory=dict)


@dataclass(frozen=True)
class Error:
    """Answer to any request that failed. `message` is one sentence; `retriable`: the same trial
    may succeed when it is repeated from its reset; `timing` as of `actions`, of `infer`."""

    type: ClassVar[str] = "error"
    id: RequestId
    code: str
    message: str
    retriable: bool = False
    timing: Mapping[str, int | float] = field(default_factory=dict)


@dataclass(frozen=True)
class End:
    """The trial is over. `outcome` holds JSON values such as success, end and steps."""

    type: ClassVar[str] = "end"
    id: RequestId
    outcome: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Ended:
    """Answer to end."""

    type: ClassVar[str] = "ended"
    id: RequestId


@dataclass(frozen=True)
class _Head:
    """What every message has."""

    type: str
    id: RequestId


@dataclass(frozen=True)
class _Step:
    """What every observation has."""

    step: Whole


Message = Hello | Reset | Ready | Infer | Actions | Calls | Error | End | Ended
TYPES: dict[str, type[Message]] = {kind.type: kind for kind in get_args(Message)}


def pack(message: Message, limits: Limits = DEFAULT_LIMITS) -> bytes:
    """The message as one buffer. Raises EncodeError."""
    sent: dict[str, object] = {"type": message.type}
    for one in fields(message):
        value = getattr(message, one.name)
        sent[one.name] = value.to_json() if isinstance(value, PolicySpec | TrialInfo) else value
    return encode(sent, limits)


def unpack(buffer: Buffer, limits: Limits = DEFAULT_LIMITS) -> Message:
    """The checked message. Raises DecodeError, or VersionMismatch for a foreign hello."""
    return read_message(decode(buffer, limits))


def read_message(value: object) -> Message:
    """The checked message in a decoded map (see `unpack`)."""
    kind = read(_Head, value, "message", DecodeError).type
    if kind not in TYPES:
        raise DecodeError(f"message type {kind[:40]!r} is not one of {', '.join(TYPES)}")
    if kind == Hello.type and isinstance(value, Mapping):
        _check_version(value)
        value = {"server": "", **value}  # may be left out
    message = read(TYPES[kind], value, f"{kind} message", DecodeError)
    if isinstance(message, Hello):
        check_spec(message.spec)
        check_printable("hello message: 'server'", message.server)
    elif isinstance(message, Infer):
        read(_Step, message.observation, "observation", DecodeError)
    return message


def _check_version(hello: Mapping[str, object]) -> None:
    """Raises VersionMismatch before anything is read that another version may write otherwise."""
    version = hello.get("version")
    if not isinstance(version, str):
        raise DecodeError(f"hello message: 'version' must be text, not {describe(version)}")
    if version.partition(".")[0] != VERSION.partition(".")[0]:
        raise VersionMismatch(
            f"the server speaks robospa protocol {version} and this is {VERSION}: "
            "install the same major version at both ends"
        )
