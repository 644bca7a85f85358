"""One client for every server that speaks openpi's codec over a WebSocket.

The server greets with a map about itself and answers each observation with a message that holds
the actions. What differs from one server to the next is an option: where pictures, joints and text
go, where an answer has the actions and in which order their columns come, what begins a trial. The
defaults are openpi's own; `presets.json` has those of other projects, and a TOML file given with
`--client` those of a user's own server.

`openpi://` reaches whatever runs behind `serve_policy`; `ws://` is our own protocol, `robospa.v1`,
and a server that does not know it is taken for openpi's.
"""

import contextlib
import math
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, make_dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.clients.chunks import ChunkOptions, Count, Targets, as_chunk, refuse_unread
from robospa.clients.dialect import Answer, ConnectionParams, Dialect, Probe, StatelessSession
from robospa.clients.numpy_msgpack import unpack
from robospa.observation import CameraSpec, Observation
from robospa.protocol import errors
from robospa.protocol.client import WireClient, identity_of, log, open_wire
from robospa.protocol.codec import encode
from robospa.protocol.openpi import CAMERA_NAMES
from robospa.protocol.options import option, read_options
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.protocol.transport import Transport
from robospa.schema import convert, parse_json

REMARKS = ("state", "policy_timing", "server_timing")
"""What an answer may have beside the actions: the state as the model read it, and times."""


@dataclass(frozen=True)
class FamilyOptions(ChunkOptions):
    """What a server of this family does not say."""

    cameras: str = option("head,left_wrist,right_wrist", "our cameras to send")
    names: str = option("", "other camera names there, such as head:cam_top,front:cam_low")
    state: str = option("commanded", "which joints to send", ("commanded", "measured"))
    action_dim: int = option(
        ActionSpace().width, "columns of a chunk: 16 for two arms of seven joints"
    )
    text_budget: Count | None = option(
        150,
        "tokens of an instruction that the model keeps: pi0.5 has 200 for text and state together, "
        "pi0 has 48",
    )
    committed: str = option(
        "",
        "for real-time chunking: the server's names for committed actions and delay, such as "
        "prev_chunk_left_over,inference_delay; empty: not sent",
    )
    extra: str = option("{}", "JSON map sent with every observation")
    inside: str = option("", "path of the observation in a message, such as examples/0")
    images: str = option("images", "name of the pictures: a map; with [] a list; empty: one by one")
    layout: str = option("chw", "axes of a picture, uint8 RGB", ("chw", "hwc"))
    size: Count | None = option(None, "side of the square to which pictures are shrunk by area")
    joints: str = option("state", "name of the joints; with [] as (1, D); empty: not sent")
    text: str = option("prompt", "name of the instruction")
    actions: str = option("actions", "path of the actions in an answer; empty: the answer itself")
    order: tuple[int, ...] = option(
        (),
        "in a file, as [0, 1, 2]: the server's column for each of ours, in joints too",
    )
    deltas: str = option(
        "none",
        "what actions are added to: `last`, the previous target, at first the joints at the "
        "trial's start (StarVLA's action_mode delta); `start`, always those joints (rel)",
        ("none", "last", "start"),
    )
    reset: str = option("{}", "JSON map sent when a trial begins, and answered; {}: none")
    connection: str = option(
        "run",
        "`trial`: a new connection for every trial, for a policy that starts afresh with it",
        ("run", "trial"),
    )
    idle: Annotated[float, Meta(ge=0)] = option(
        0.0, "seconds after which an idle connection is replaced; 0: never"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.camera_names, self.maps  # noqa: B018
        if self.committed and not re.fullmatch("[^,]+,[^,]+", self.committed):
            raise ValueError(f"option committed={self.committed[:80]!r} is not two names")
        if self.order and sorted(self.order) != list(range(self.action_dim)):
            raise ValueError(
                f"option order={self.order} is not an order of {self.action_dim} columns"
            )
        try:
            PolicySpec.from_json(self.spec("server").to_json())
        except errors.DecodeError as error:
            raise ValueError(f"options that cannot be: {error}") from error

    def spec(self, name: str) -> PolicySpec:
        """What these options make of a server that says nothing of itself."""
        return self.spec_of(
            name,
            cameras=tuple(CameraSpec(name) for name in self.cameras.split(",") if name),
            state=self.state if self.joints or self.deltas != "none" else "none",
            action_dim=self.action_dim,
            committed_actions=bool(self.committed),
            text_budget=self.text_budget,
        )

    @cached_property
    def camera_names(self) -> dict[str, str]:
        """The server's name of each of our cameras."""
        names = dict(CAMERA_NAMES)
        for pair in filter(None, self.names.split(",")):
            ours, colon, theirs = pair.partition(":")
            if ours not in CAMERA_NAMES or not colon or not theirs:
                raise ValueError(f"option names: {pair!r} is not of the form camera:name")
            names[ours] = theirs
        return names

    @cached_property
    def maps(self) -> dict[str, dict[str, object]]:
        """The options `extra` and `reset` as maps."""
        found: dict[str, dict[str, object]] = {}
        for name, text in (("extra", self.extra), ("reset", self.reset)):
            try:
                found[name] = dict(parse_json(text).items())
            except (ValueError, AttributeError):
                raise ValueError(f"option {name}={text[:80]!r} is not a JSON map") from None
        return found

    def request(self, observation: Observation) -> dict[str, object]:
        """The message for one observation; raises EncodeError for a camera without a name there."""
        shown = {}
        for name, image in observation.get("images", {}).items():
            if name not in self.camera_names:
                known = ", ".join(self.camera_names)
                raise errors.EncodeError(
                    f"camera {name!r} has no openpi name; cameras with one: {known}"
                )
            small = image if self.size is None else shrunk(image, self.size)
            shown[name] = np.moveaxis(small, -1, 0) if self.layout == "chw" else small
        sent: dict[str, object] = {self.camera_names[name]: image for name, image in shown.items()}
        if self.images.endswith("[]"):
            sent = {self.images[:-2]: [shown[name] for name in self.cameras.split(",")]}
        elif self.images:
            sent = {self.images: sent}
        sent[self.text] = observation.get("instruction", "")
        if "state" in observation and self.joints:
            joints = np.asarray(observation["state"], np.float64)
            if len(self.order) == len(joints):
                joints = joints[np.argsort(self.order)]
            name = self.joints.removesuffix("[]")
            sent[name] = joints if name == self.joints else joints[None]
        if self.committed and "committed" in observation:
            rows, delay = self.committed.split(",")
            sent[rows] = np.asarray(observation["committed"], np.float64)
            sent[delay] = observation["delay"]
        for name in reversed([n for n in self.inside.split("/") if n and n != "0"]):
            sent = {name: [sent] if f"{name}/0" in self.inside else sent}
        return {**self.maps["extra"], **sent}

    def chunk(self, answer: object) -> object:
        """The chunk (T, D) in an answer, its columns in our order; what is none is returned, to be
        refused as one. Raises PolicyAnswerError for numbers that nobody reads."""
        found: Any = answer
        for name in self.actions.split("/") if self.actions else ():
            if isinstance(found, Mapping):
                refuse_unread(found, {name, *REMARKS})
                found = found.get(name)
            elif isinstance(found, list | np.ndarray) and name.isdecimal():
                found = found[int(name)] if int(name) < len(found) else None
        chunk = as_chunk(found)
        if not self.order or not isinstance(chunk, np.ndarray) or chunk.ndim != 2:
            return chunk
        ours, width = list(self.order), chunk.shape[1]
        more = width > len(ours) and ours == sorted(ours)
        return chunk[:, ours] if more or width == len(ours) else chunk


def _averaged(image: NDArray[np.uint8 | np.float32], new: int) -> NDArray[np.float32]:
    """The rows of `image` (N, W, C) as `new` columns (W, new, C), each the mean of N / new; summed
    one after another, as OpenCV does it, so that no value is rounded another way."""
    rows = image.astype(np.float32).reshape(len(image), -1)
    scale = len(rows) / new
    start, mean = np.arange(new) * scale, np.zeros((new, rows.shape[1]), np.float32)
    for tap in range(math.ceil(scale) + 1):
        row = np.floor(start).astype(int) + tap
        share = (np.minimum(start + scale, row + 1) - np.maximum(start, row)).clip(0) / scale
        part = rows[np.minimum(row, len(rows) - 1)]
        part *= share.astype(np.float32)[:, None]
        mean += part
    return np.ascontiguousarray(mean.reshape(new, *image.shape[1:]).swapaxes(0, 1))


def shrunk(image: NDArray[np.uint8], size: int) -> NDArray[np.uint8]:
    """`image` (H, W, 3) as (size, size, 3): each new pixel is the mean of the area that it covers,
    by OpenCV where it is installed, else to the same bits. Raises EncodeError for one that would
    have to grow."""
    height, width = image.shape[:2]
    if size > min(height, width):
        raise errors.EncodeError(
            f"a picture of shape {image.shape} cannot be shrunk to size={size}"
        )
    with contextlib.suppress(ImportError):
        import cv2

        return np.asarray(cv2.resize(image, (size, size), interpolation=cv2.INTER_AREA))
    if height % size == width % size == 0:  # OpenCV sums whole blocks as integers
        blocks = image.reshape(size, height // size, size, width // size, 3)
        total = blocks.sum((1, 3), dtype=np.uint32)
        if height == width == 2 * size:  # and rounds halves up, of other blocks to even
            return np.asarray((total + 2) >> 2, np.uint8)
        mean = total.astype(np.float32) * np.float32(size**2 / (height * width))
        return np.asarray(np.rint(mean), np.uint8)
    across = _averaged(np.ascontiguousarray(image.swapaxes(0, 1)), size)
    small: NDArray[np.uint8] = np.rint(_averaged(across, size)).astype(np.uint8)
    return np.ascontiguousarray(small.swapaxes(0, 1))


def reason_of(answer: Mapping[str, object]) -> str:
    """What went wrong, of an answer that reports it in a map; "" for any other."""
    said = answer.get("error")
    if isinstance(said, Mapping):
        said = said.get("message") or said
    marked = "error" in (answer.get("status"), answer.get("type")) or answer.get("ok") is False
    if not marked and not (isinstance(said, str | Mapping) and said):
        return ""
    return str(said or answer.get("message") or answer.get("detail") or "no reason given")


@dataclass(frozen=True)
class Preset:
    """What distinguishes the servers of one project, beside the defaults of their options.

    `server` completes "it looks like ...". `greeting`: what its first map has, a name and its
    value, or any. `fixed` goes into every message. `refused`: what its first map has where the
    server cannot be spoken to, and why.
    """

    server: str
    source: str = ""
    port: int = 8000
    path: str = ""
    greeting: tuple[str, str] = ("", "")
    fixed: dict[str, object] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    shared_state: bool = False
    warnings: tuple[str, ...] = ()
    options: dict[str, object] = field(default_factory=dict)

    def greets(self, metadata: Mapping[str, object]) -> bool:
        """Whether the first map of a server is that of this preset; StarVLA's is no other's."""
        name, value = self.greeting
        if not name:
            return metadata.get("env") != "starvla_policy_server"
        return name in metadata and value in ("", metadata[name])


PRESETS = convert(
    parse_json(Path(__file__).with_name("presets.json").read_text()), dict[str, Preset]
)


class FamilySession(StatelessSession):
    """One connection to a server of the family: `transport`, or what `connect` makes, then and
    whenever one was idle for too long.

    The server sends one metadata map, then answers each message. A text frame is an error with the
    server's traceback, after which it closes; a map may report an error too. There is no request id
    and no spec on the wire.
    """

    def __init__(
        self,
        connect: Callable[[], Transport],
        options: FamilyOptions,
        params: ConnectionParams,
        name: str = "openpi",
        transport: Transport | None = None,
    ) -> None:
        preset = PRESETS[name]
        self._connect, self._options, self._preset = connect, options, preset
        self._timeouts, self._limits = params.timeouts, params.limits
        self._used, self._asked = time.monotonic(), False
        self._targets, self.per_trial = Targets(options.deltas), options.connection == "trial"
        self._transport = transport or connect()
        try:
            metadata = self._greeting(params.timeouts.hello)
        except BaseException:
            self.close()
            raise
        spec, self._ours = options.spec(name), "robospa" in metadata
        said = errors.json_values(metadata)
        super().__init__(name, spec, options, preset.warnings, metadata=said)

    def _greeting(self, timeout: float) -> Mapping[str, object]:
        metadata = self._receive(timeout, "metadata")
        if not isinstance(metadata, dict):
            raise self._violation(": metadata is not a map")
        if not self._preset.greets(metadata):
            raise errors.HandshakeError(
                f"{self._transport.url} does not greet as {self._preset.server} does"
            )
        for name, why in self._preset.refused.items():
            if name in metadata:
                raise errors.HandshakeError(f"{self._transport.url} {why}")
        return metadata

    def reset(self, id: int, trial: TrialInfo) -> None:
        self._targets.begin()
        if begin := self._options.maps["reset"]:
            self._check(self._ask(begin, self._timeouts.reset, "an answer to a reset"))

    def infer(self, id: int, observation: Observation, timeout: float) -> Answer:
        request = {**self._preset.fixed, **self._options.request(observation)}
        answer = self._ask(request, timeout, "actions")
        if self._options.actions and not isinstance(answer, Mapping):
            raise self._violation(": actions is not a map")
        chunk = self._options.chunk(answer)
        if not isinstance(chunk, np.ndarray):
            self._check(answer)
        return self._targets.of(chunk, observation), _timing(answer)

    def close(self) -> None:
        self._transport.close()

    def _ask(self, request: dict[str, object], timeout: float, what: str) -> object:
        if 0 < self._options.idle < time.monotonic() - self._used:
            self._renew()
        try:
            unread = self._transport.has_more()
        except errors.ConnectionLost as error:
            if not self._was_cut():
                raise
            log.warning("%s; connected again", error)
            self._renew()
            unread = False
        if unread:
            raise self._violation(" sent data that was not requested")
        self._transport.send(encode(request, self._limits))
        answer = self._receive(timeout, what)
        self._asked, self._used = True, time.monotonic()
        return answer

    def _was_cut(self) -> bool:
        """Whether the connection was lost because nothing was said for long, at a server that has
        nothing to forget: a trial does not begin with a message or a connection there."""
        told = self._options.maps["reset"] or self.per_trial or self._ours
        return self._asked and not told and self._transport.was_idle

    def _renew(self) -> None:
        """A new connection to the same server as before."""
        self.close()
        self._transport, self._asked = self._connect(), False
        now = {**self.hello, "metadata": errors.json_values(self._greeting(self._timeouts.infer))}
        if identity_of(self.hello).changes(identity_of(now)):
            self.close()
            raise errors.ConnectionLost(f"{self._transport.url} is another server than before")

    def _check(self, answer: object) -> None:
        if isinstance(answer, Mapping) and (reason := reason_of(answer)):
            raise errors.ServerError("an error", reason, True, self._transport.url)

    def _violation(self, what: str) -> errors.ProtocolViolation:
        self.close()
        return errors.ProtocolViolation(f"{self._transport.url}{what}")

    def _receive(self, timeout: float, what: str) -> object:
        data = self._transport.receive(timeout, what)
        if isinstance(data, str):
            self.close()
            lines = data.strip().splitlines() or ["no text"]
            error = errors.ServerError("openpi", lines[-1], True, self._transport.url)
            error.add_note(data)
            raise error
        try:
            return unpack(data, self._limits, lenient=True)
        except errors.DecodeError as error:
            raise self._violation(f": unreadable {what}: {error}") from error


def _timing(answer: object) -> dict[str, float]:
    for name in ("policy_timing", "server_timing"):
        times = answer.get(name) if isinstance(answer, Mapping) else None
        if isinstance(times, dict) and isinstance(times.get("infer_ms"), (int, float)):
            return {"infer_ms": float(times["infer_ms"])}
    return {}


DECIDING_OPTIONS = {"measured state": "state", "arms swapped": "order"}


def dialect(name: str, **more: Any) -> Dialect:
    """The dialect `name://` of a preset, whose options have the defaults given there; `more` are
    other fields of it."""
    preset = PRESETS[name]
    chosen = read_options(FamilyOptions, preset.options)
    changed = [
        (f.name, f.type, option(getattr(chosen, f.name), **f.metadata))
        for f in fields(FamilyOptions)
        if f.name in preset.options
    ]
    said = " = ".join(filter(None, preset.greeting))

    def open_session(params: ConnectionParams, options: FamilyOptions) -> FamilySession:
        address = replace(params.websocket_address(), token_kind="Api-Key")
        if not params.endpoint.path.strip("/"):
            address = replace(address, url=address.url.rstrip("/") + preset.path)
        connect = partial(Transport, address, params.timeouts, params.limits, None)
        return FamilySession(connect, options, params, name)

    def recognise(probe: Probe) -> bool:
        """By its greeting, of which other servers may have one too."""
        open_session(probe.params, chosen).close()
        return True

    return Dialect(
        server=preset.server,
        scheme=name,
        wire="websocket",
        port=preset.port,
        options=make_dataclass(name, changed, bases=(FamilyOptions,), frozen=True),
        open_session=open_session,
        recognise=recognise,
        sign=f"its greeting has {said}" if said else "it greets unasked, with a map",
        deciding_options=DECIDING_OPTIONS,
        shared_state=preset.shared_state,
        weak_sign=True,  # its greeting is waited for: who answers questions is asked before
        **more,
    )


DIALECT = dialect("openpi", also_reaches=("ws",))
"""Our own server also answers an openpi client."""
STARVLA, VLLM = dialect("starvla"), dialect("vllm")
LINGBOT = replace(dialect("lingbot"), recognise=None)
"""It greets as openpi's server does."""


def open_ours(params: ConnectionParams, options: FamilyOptions) -> WireClient:
    """A connection in the dialect that the server selects; the options are used only if it turns
    out to speak openpi's: ours tells everything."""
    address, timeouts, limits = params.websocket_address(), params.timeouts, params.limits
    connect = partial(Transport, address, timeouts, limits, None)
    other = partial(FamilySession, connect, options, params, "openpi")
    return open_wire(address, timeouts, limits, other)


def recognise_ours(probe: Probe) -> bool:
    """It selects our subprotocol."""
    params = probe.params
    transport = Transport(params.websocket_address(), params.timeouts, params.limits)
    transport.close()
    return transport.subprotocol is not None


OURS = Dialect(
    server="a robospa.v1 server",
    scheme="ws",
    secure_scheme="wss",
    wire="websocket",
    options=FamilyOptions,
    open_session=open_ours,
    recognise=recognise_ours,
    sign="it selects the subprotocol robospa.v1",
    also_reaches=("openpi",),
    deciding_options=DECIDING_OPTIONS,
)
