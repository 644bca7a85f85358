"""openpi's dialect: pi0, pi0.5 and whatever else runs behind `serve_policy`.

Our own server speaks this dialect too, for clients of openpi: `robospa.protocol.openpi`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace

from robospa.action_space import ActionSpace
from robospa.clients.chunks import HORIZON, RobotOption, as_chunk, check_budget, refuse_unread
from robospa.clients.detect import Probe
from robospa.clients.dialect import ConnectionParams, Dialect, StatelessSession
from robospa.clients.numpy_msgpack import unpack
from robospa.observation import CameraSpec, Observation
from robospa.protocol.codec import Limits, encode
from robospa.protocol.errors import DecodeError, ProtocolViolation, ServerError, json_values
from robospa.protocol.openpi import CAMERA_NAMES, to_openpi
from robospa.protocol.options import option
from robospa.protocol.policy import PolicySpec
from robospa.protocol.transport import Timeouts, Transport

WARNINGS = (
    "adapt_to_pi is invisible on the wire: the served config must have adapt_to_pi=False for "
    "data in RoboTwin's conventions, or joint signs and grippers will be wrong",
    "openpi's sampling noise depends on the order of requests and cannot be seeded from here: two "
    "runs will differ",
)
KNOWN = {"actions", "state", "policy_timing", "server_timing"}
"""What an answer may have: the actions, the state as the model read it, and times."""


@dataclass(frozen=True)
class OpenPiClientOptions(RobotOption):
    """What `serve_policy` does not say."""

    cameras: str = option("head,left_wrist,right_wrist", "our cameras to send, comma separated")
    names: str = option("", "other camera names at the server, such as head:cam_top,front:cam_low")
    state: str = option("commanded", "which joints to send", ("commanded", "measured"))
    horizon: int | None = option(None, HORIZON)
    execute: int | None = option(None, "actions executed before the next query; none for all")
    action_dim: int = option(
        ActionSpace().width, "columns of a chunk: 16 for two arms of seven joints"
    )
    text_budget: int | None = option(
        150,
        "tokens that the model keeps of an instruction: pi0.5 has 200 for it and the state "
        "together, pi0 has 48",
    )
    committed: str = option(
        "",
        "for a server that does real-time chunking: its names of the committed actions and the "
        "delay, such as prev_chunk_left_over,inference_delay; empty: not sent",
    )
    extra: str = option("{}", "JSON map sent along at the top level of every observation")

    def __post_init__(self) -> None:
        """ValueError for options that cannot be."""
        check_budget(self.text_budget)
        self.camera_names, self.extra_fields, self.committed_names  # noqa: B018
        try:
            PolicySpec.from_json(self.spec.to_json())
        except DecodeError as error:
            raise ValueError(f"options that cannot be: {error}") from error

    @property
    def spec(self) -> PolicySpec:
        """What these options make of a server that says nothing of itself."""
        return PolicySpec(
            name="openpi",
            cameras=tuple(CameraSpec(name) for name in self.cameras.split(",") if name),
            state=self.state,
            horizon=self.horizon,
            execute=self.execute,
            embodiments=(self.embodiment,),
            action_dim=self.action_dim,
            committed_actions=bool(self.committed),
            text_budget=self.text_budget,
        )

    @property
    def camera_names(self) -> dict[str, str]:
        """The server's name of each of our cameras."""
        names = dict(CAMERA_NAMES)
        for pair in filter(None, self.names.split(",")):
            ours, colon, theirs = pair.partition(":")
            if ours not in CAMERA_NAMES or not colon or not theirs:
                raise ValueError(f"option names: {pair!r} is not of the form camera:name")
            names[ours] = theirs
        return names

    @property
    def committed_names(self) -> tuple[str, str] | None:
        """The server's names of our `committed` and `delay`; None if it reads neither."""
        if not self.committed:
            return None
        rows, comma, delay = self.committed.partition(",")
        if not (comma and rows and delay) or "," in delay:
            raise ValueError(f"option committed={self.committed[:80]!r} is not two names")
        return rows, delay

    @property
    def extra_fields(self) -> dict[str, object]:
        """Option `extra` as a map."""
        try:
            extra = json.loads(self.extra)
        except (ValueError, RecursionError):
            extra = None
        if not isinstance(extra, dict):
            raise ValueError(f"option extra={self.extra[:80]!r} is not a JSON map")
        return extra


class OpenPiSession(StatelessSession):
    """One connection to an openpi server, over an open `transport`.

    The server sends one metadata map, then answers each observation map with a map that has
    `actions`. A text frame is an error with the server's traceback. There is no reset, no request
    id and no spec on the wire.
    """

    def __init__(
        self,
        transport: Transport,
        options: OpenPiClientOptions,
        timeouts: Timeouts,
        limits: Limits,
    ) -> None:
        self._transport, self._limits = transport, limits
        self._cameras, self._extra = options.camera_names, options.extra_fields
        self._committed = options.committed_names
        metadata = json_values(self._receive(timeouts.hello, "metadata"))
        super().__init__("openpi", options.spec, options, WARNINGS, metadata=metadata)

    def infer(
        self, id: int, observation: Observation, timeout: float
    ) -> tuple[object, Mapping[str, float]]:
        if self._transport.has_more():
            self.close()
            raise ProtocolViolation(f"{self._transport.url} sent data that was not requested")
        request = to_openpi(observation, self._cameras, self._extra, self._committed)
        self._transport.send(encode(request, self._limits))
        answer = self._receive(timeout, "actions")
        refuse_unread(answer, KNOWN)
        return as_chunk(answer.get("actions")), _timing(answer)

    def close(self) -> None:
        self._transport.close()

    def _receive(self, timeout: float, what: str) -> dict[str, object]:
        data = self._transport.receive(timeout, what)
        if isinstance(data, str):
            self.close()
            lines = data.strip().splitlines() or ["no text"]
            error = ServerError("openpi", lines[-1], True, self._transport.url)
            error.add_note(data)
            raise error
        try:
            value = unpack(data, self._limits, lenient=True)
        except DecodeError as error:
            self.close()
            raise ProtocolViolation(f"{self._transport.url}: unreadable {what}: {error}") from error
        if not isinstance(value, dict):
            self.close()
            raise ProtocolViolation(f"{self._transport.url}: {what} is not a map")
        return value


def _timing(answer: Mapping[str, object]) -> dict[str, float]:
    for name in ("policy_timing", "server_timing"):
        times = answer.get(name)
        if isinstance(times, dict) and isinstance(times.get("infer_ms"), (int, float)):
            return {"infer_ms": float(times["infer_ms"])}
    return {}


def open_session(params: ConnectionParams, options: OpenPiClientOptions) -> OpenPiSession:
    """A session with the server at `params.endpoint`."""
    address = replace(params.websocket_address(), token_kind="Api-Key")
    transport = Transport(address, params.timeouts, params.limits, None)
    try:
        return OpenPiSession(transport, options, params.timeouts, params.limits)
    except BaseException:
        transport.close()
        raise


def recognise(probe: Probe) -> bool:
    """It greets unasked, with a map; so may others."""
    open_session(probe.params, OpenPiClientOptions()).close()
    return True


DECIDING_OPTIONS = {"measured state": "state"}

DIALECT = Dialect(
    server="an openpi server",
    scheme="openpi",
    wire="websocket",
    options=OpenPiClientOptions,
    open_session=open_session,
    recognise=recognise,
    weak_sign=True,
    also_reaches=("ws",),  # our own server also answers an openpi client
    deciding_options=DECIDING_OPTIONS,
)
