"""The messages of `robospa.v1` as frozen dataclasses, and their checks.

    client                     server
                               hello    once, right after the handshake (id 0)
    reset   trial          ->  ready    or error
    infer   observation    ->  actions  or error
    end     outcome        ->  ended    or error

Every request carries an id that its one answer repeats. Unknown fields are ignored (later minor
versions may add some), missing fields and wrong types are refused with DecodeError.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from robospa.protocol.codec import DEFAULT_LIMITS, Buffer, Limits, decode, encode
from robospa.protocol.errors import DecodeError, VersionMismatch
from robospa.protocol.policy import Observation, PolicySpec, TrialInfo
from robospa.protocol.validate import Fields, kind

VERSION = "1.0"
SUBPROTOCOL = "robospa.v1"
MAX_ID = 2**53
"""Request ids stay exact in languages whose only number is a double."""

# Codes of `error`. The list is open; a client must cope with others.
BAD_MESSAGE = "bad_message"  # the request could not be understood
BAD_OBSERVATION = "bad_observation"  # understood, but not what the spec asks for
NO_TRIAL = "no_trial"  # infer or end without a successful reset
POLICY_FAILED = "policy_failed"  # the policy raised an exception
BAD_ANSWER = "bad_answer"  # the policy answered something that is no chunk
BUSY = "busy"  # too many requests are waiting


@dataclass(frozen=True)
class Hello:
    """Server's first message. `server` is a name for people and records."""

    type: ClassVar[str] = "hello"
    id: int
    version: str
    server: str
    spec: PolicySpec

    def fields(self) -> dict[str, Any]:
        return {"version": self.version, "server": self.server, "spec": self.spec.to_json()}

    @classmethod
    def read(cls, id: int, fields: Fields) -> Hello:
        version = fields.text("version")
        if major(version) != major(VERSION):
            raise VersionMismatch(
                f"the server speaks robospa protocol {version} and this is {VERSION}: "
                "install the same major version at both ends"
            )
        return cls(id, version, fields.name("server", ""), PolicySpec.from_json(fields.raw("spec")))


@dataclass(frozen=True)
class Reset:
    """A trial begins; nothing of the one before may survive."""

    type: ClassVar[str] = "reset"
    id: int
    trial: TrialInfo

    def fields(self) -> dict[str, Any]:
        return {"trial": self.trial.to_json()}

    @classmethod
    def read(cls, id: int, fields: Fields) -> Reset:
        return cls(id, TrialInfo.from_json(fields.raw("trial")))


@dataclass(frozen=True)
class Ready:
    """Answer to reset: the policy is ready for the first observation."""

    type: ClassVar[str] = "ready"
    id: int

    def fields(self) -> dict[str, Any]:
        return {}

    @classmethod
    def read(cls, id: int, fields: Fields) -> Ready:
        return cls(id)


@dataclass(frozen=True, eq=False)
class Infer:
    """An observation; see `robospa.protocol.policy` for its keys."""

    type: ClassVar[str] = "infer"
    id: int
    observation: Observation

    def fields(self) -> dict[str, Any]:
        return {"observation": self.observation}

    @classmethod
    def read(cls, id: int, fields: Fields) -> Infer:
        observation = fields.map("observation")
        Fields("observation", observation).whole("step", low=0)
        return cls(id, observation)


@dataclass(frozen=True, eq=False)
class Actions:
    """Answer to infer: `chunk` float32 (T, D). `timing`: queue_ms, infer_ms, batch."""

    type: ClassVar[str] = "actions"
    id: int
    chunk: NDArray[np.float32]
    timing: Mapping[str, float] = field(default_factory=dict)

    def fields(self) -> dict[str, Any]:
        return {"chunk": self.chunk, "timing": self.timing}

    @classmethod
    def read(cls, id: int, fields: Fields) -> Actions:
        chunk = fields.raw("chunk")
        if not isinstance(chunk, np.ndarray):
            raise fields.refuse("chunk", "an array", chunk)
        timing = fields.map("timing", {})
        for name, number in timing.items():
            if type(number) not in (int, float):
                raise DecodeError(f"actions: timing {name!r} must be a number, not {kind(number)}")
        return cls(id, chunk, timing)


@dataclass(frozen=True)
class Error:
    """Answer to any request that failed. `message` is one sentence; `retriable`: the same trial
    may succeed when it is repeated from its reset."""

    type: ClassVar[str] = "error"
    id: int
    code: str
    message: str
    retriable: bool = False

    def fields(self) -> dict[str, Any]:
        return {"code": self.code, "message": self.message, "retriable": self.retriable}

    @classmethod
    def read(cls, id: int, fields: Fields) -> Error:
        return cls(id, fields.text("code"), fields.text("message"), fields.flag("retriable", False))


@dataclass(frozen=True)
class End:
    """The trial is over. `outcome` holds JSON values such as success, end and steps."""

    type: ClassVar[str] = "end"
    id: int
    outcome: Mapping[str, Any] = field(default_factory=dict)

    def fields(self) -> dict[str, Any]:
        return {"outcome": self.outcome}

    @classmethod
    def read(cls, id: int, fields: Fields) -> End:
        return cls(id, fields.map("outcome", {}))


@dataclass(frozen=True)
class Ended:
    """Answer to end."""

    type: ClassVar[str] = "ended"
    id: int

    def fields(self) -> dict[str, Any]:
        return {}

    @classmethod
    def read(cls, id: int, fields: Fields) -> Ended:
        return cls(id)


Message = Hello | Reset | Ready | Infer | Actions | Error | End | Ended
TYPES: dict[str, type[Message]] = {
    kind.type: kind for kind in (Hello, Reset, Ready, Infer, Actions, Error, End, Ended)
}


def pack(message: Message, limits: Limits = DEFAULT_LIMITS) -> bytes:
    """The message as one buffer. Raises EncodeError."""
    return encode({"type": message.type, "id": message.id, **message.fields()}, limits)


def unpack(buffer: Buffer, limits: Limits = DEFAULT_LIMITS) -> Message:
    """The checked message. Raises DecodeError, or VersionMismatch for a foreign hello."""
    return read_message(decode(buffer, limits))


def read_message(value: Any) -> Message:
    """The checked message in a decoded map (see `unpack`)."""
    fields = Fields("message", value)
    name = fields.text("type")
    found = TYPES.get(name)
    if found is None:
        raise DecodeError(f"message type {name[:40]!r} is not one of {', '.join(TYPES)}")
    fields.what = f"{name} message"
    return found.read(fields.whole("id", low=0, high=MAX_ID), fields)


def major(version: str) -> str:
    """The part of a version that must agree."""
    return version.split(".", 1)[0]
