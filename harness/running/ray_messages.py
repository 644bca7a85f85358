"""What the driver of a run and its actors on a Ray cluster tell each other, as bytes.

Each message is a map in the codec of the wire that names its kind; a record is in it as the line of
JSON that it becomes on disk. Every field is checked on arrival, as if a stranger had sent it, and
DecodeError says which one is wrong. Nothing is pickled.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from robospa.harness.running.executor import Message
from robospa.harness.running.servers import BROKEN, UNFIT, UNREACHED
from robospa.harness.running.store import ACTIONS, VIDEOS
from robospa.harness.running.watchdog import ASKING, INSIDE, WORKING
from robospa.harness.running.worker import VIDEO, Targets, WorkerConfig
from robospa.protocol.codec import Limits, decode, encode
from robospa.protocol.errors import DecodeError, EncodeError
from robospa.protocol.policy import PolicySpec
from robospa.protocol.validate import Fields
from robospa.results.records.run_io import from_line, to_line
from robospa.results.records.schema import check_key
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

LIMITS = Limits(message=2**30, text=2**26)
FILE = re.compile(rf"({ACTIONS}|{VIDEOS})/[A-Za-z0-9_][A-Za-z0-9_.-]*")
"""Where a trial's files may be put."""


@dataclass(frozen=True)
class Heard:
    """What one worker has said: each message with the files that belong to it (folder/name: bytes),
    its output since, and how it ended (None while it lives)."""

    said: tuple[tuple[Message, Mapping[str, bytes]], ...]
    output: bytes
    gone: str | None


# --- to the actor: what its worker needs to know, then orders -------------------------------------


def pack_config(config: WorkerConfig) -> bytes:
    """Raises EncodeError if a policy or a world is given what is no plain value."""
    plain = {
        **vars(config),
        "folder": str(config.folder),
        "options": dict(config.options),
        "samples": [asdict(key) for key in sorted(config.samples)],
        "expects": {target: spec.to_json() for target, spec in config.expects.items()},
    }
    if "timeouts" in config.options:
        plain["options"]["timeouts"] = asdict(config.options["timeouts"])
    return encode(plain, LIMITS)


def unpack_config(packed: bytes) -> WorkerConfig:
    """What `pack_config` was given."""
    data = _unpack("a worker's settings", packed)
    options = data.map("options")
    if "timeouts" in options:
        from robospa.protocol.transport import Timeouts

        given = Fields("timeouts", options["timeouts"])
        options["timeouts"] = Timeouts(**{n: _number(given, n) for n in asdict(Timeouts())})
    return WorkerConfig(
        folder=Path(data.text("folder")),
        policy=_targets(data.raw("policy")),
        options=options,
        world=data.text("world"),
        world_arguments=data.map("world_arguments"),
        parts=data.text("parts"),
        run_seed=data.whole("run_seed"),
        video=data.text("video", choices=VIDEO),
        samples=frozenset(_key(item) for item in data.items("samples")),
        policies={task: _targets(item) for task, item in data.map("policies").items()},
        expects={url: PolicySpec.from_json(item) for url, item in data.map("expects").items()},
        step_scale=_number(data, "step_scale"),
    )


def pack_order(order: Message) -> bytes:
    """What the driver may say to a worker, see `harness.running.worker`."""
    match order:
        case ("run", key, attempt, target):
            told = {"kind": "run", "key": asdict(key), "attempt": attempt, "target": target}
        case ("stop",):
            told = {"kind": "stop"}
        case _:
            raise EncodeError(f"there is no order {order[0]!r}")
    return encode(told, LIMITS)


def unpack_order(packed: bytes) -> Message:
    """What `pack_order` was given."""
    order = _unpack("an order", packed)
    if order.text("kind", choices=("run", "stop")) == "stop":
        return ("stop",)
    return ("run", _key(order.raw("key")), order.whole("attempt", low=1), order.text("target"))


# --- from the actor -------------------------------------------------------------------------------


def pack_heard(heard: Heard) -> bytes:
    """Where a worker's own record file lies is left out: nobody else sees its disk."""
    said = [_pack_said(message, files) for message, files in heard.said]
    return encode({"said": said, "output": heard.output, "gone": heard.gone}, LIMITS)


def _pack_said(message: Message, files: Mapping[str, bytes]) -> dict[str, Any]:
    match message:
        case ("ready", _):
            return {"kind": "ready"}
        case ("beat", number, state):
            return {"kind": "beat", "number": number, "state": state}
        case ("done", record):
            return {"kind": "done", "record": to_line(record), "files": files}
        case ("lost", key, text, retry, fault):
            lost = {"key": asdict(key), "text": text, "retry": retry, "fault": fault}
            return {"kind": "lost", **lost}
        case ("fatal", text):
            return {"kind": "fatal", "text": text}
    raise EncodeError(f"a worker does not say {message[0]!r}")


def unpack_heard(packed: bytes) -> Heard:
    """What `pack_heard` was given."""
    heard = _unpack("what a worker said", packed)
    return Heard(
        tuple(_said(Fields("a worker's message", item)) for item in heard.items("said")),
        _binary(heard, "output"),
        None if heard.raw("gone") is None else heard.text("gone"),
    )


def _said(said: Fields) -> tuple[Message, Mapping[str, bytes]]:
    match said.text("kind", choices=("ready", "beat", "done", "lost", "fatal")):
        case "ready":
            return ("ready", None), {}
        case "beat":
            state = said.text("state", choices=(WORKING, ASKING, INSIDE))
            return ("beat", said.whole("number", low=0), state), {}
        case "done":
            return ("done", _record(said.text("record"))), _files(said)
        case "lost":
            fault = said.text("fault", choices=("", UNREACHED, BROKEN, UNFIT))
            key = _key(said.raw("key"))
            return ("lost", key, said.text("text"), said.flag("retry"), fault), {}
    return ("fatal", said.text("text")), {}


# --- parts of messages ----------------------------------------------------------------------------


def _unpack(what: str, packed: object) -> Fields:
    if type(packed) is not bytes:
        raise DecodeError(f"{what} came as a {type(packed).__name__}, not as bytes")
    return Fields(what, decode(packed, LIMITS))


def _number(data: Fields, name: str) -> float:
    found = data.raw(name)
    if type(found) not in (int, float) or not math.isfinite(found):
        raise data.refuse(name, "a number", found)
    return float(found)


def _binary(data: Fields, name: str) -> bytes:
    found = data.raw(name)
    if type(found) is not bytes:
        raise data.refuse(name, "binary", found)
    return found


def _targets(value: Any) -> Targets:
    if type(value) is str:
        return value
    if not isinstance(value, list) or not all(type(item) is str for item in value):
        raise DecodeError("a policy is neither a text nor a list of them")
    return tuple(value)


def _key(value: Any) -> TrialKey:
    try:
        key = TrialKey(**Fields("a trial", value).value)
        check_key(key)
    except (TypeError, ValueError) as error:
        raise DecodeError(f"a trial: {error}") from error
    return key


def _record(line: str) -> TrialRecord:
    try:
        return from_line(line)
    except ValueError as error:
        raise DecodeError(f"a record: {error}") from error


def _files(said: Fields) -> dict[str, bytes]:
    files = Fields("files", said.raw("files"))
    for name in files.value:
        if not FILE.fullmatch(name):
            raise DecodeError(f"{name[:80]!r} is no file of a trial")
    return {name: _binary(files, name) for name in files.value}
