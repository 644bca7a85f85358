"""RoboTwin's `policy_model_server.py`: raw TCP, a length of four bytes, then JSON, both ways.

    {"cmd": "get_action", "obs": {...}}        ->  {"res": chunk} or {"error": .., "traceback": ..}

The server calls whatever method of the model is named, and a policy's own `encode_obs` is expected
at this side of the wire: options choose among the layouts that exist (`layout`) and among the
orders of calls (`calls`). Only names of plain methods are ever sent. The server's own weaknesses
(no authentication, anything callable) remain: let it listen on a machine of one's own only.
"""

import base64
import json
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta

from robospa.action_space import SIX_JOINT_ARMS, ActionSpace
from robospa.clients.chunks import AnyModelOptions, as_chunk, refuse_unread
from robospa.clients.dialect import (
    Answer,
    ConnectionParams,
    Dialect,
    Probe,
    StatelessSession,
    explain_error,
)
from robospa.clients.http import array_of, call_failure, has_unread_bytes
from robospa.observation import Observation
from robospa.protocol import errors
from robospa.protocol.options import option
from robospa.protocol.policy import TrialInfo
from robospa.protocol.transport import connect_until

MAX_REASON = 240
"""Characters of a server's error text that are repeated."""


def to_json(value: object) -> dict[str, object]:
    """An array as RoboTwin's JSON writes it."""
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{type(value).__name__} cannot be sent")
    data = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode("ascii")
    return {
        "__numpy_array__": True,
        "data": data,
        "dtype": value.dtype.name,
        "shape": list(value.shape),
    }


def from_json(value: dict[str, object]) -> object:
    """The inverse, for `json.loads`; only plain numbers become arrays."""
    return array_of(value, "data") if value.get("__numpy_array__") is True else value


class FramedJson:
    """Calls of a model's methods over one TCP connection; a frame is read whole, its size is
    bounded and every call has one deadline."""

    def __init__(self, params: ConnectionParams) -> None:
        self.url = f"robotwin+tcp://{params.endpoint.host}:{params.endpoint.port}"
        self._limit = params.limits.message
        address, seconds = (params.endpoint.host, params.endpoint.port), params.timeouts.connect
        self._socket: socket.socket | None = connect_until(
            self.url, params.timeouts.wait, lambda: socket.create_connection(address, seconds)
        )
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def call(
        self, method: str, value: object, timeout: float, until: float | None = None
    ) -> object:
        """What the model's `method` returned; after any error the connection is closed.

        `until`: an earlier end of the `timeout` s on the monotonic clock, shared by several calls.
        """
        deadline = time.monotonic() + timeout if until is None else until
        try:
            text = json.dumps({"cmd": method, "obs": value}, default=to_json).encode()
        except (TypeError, ValueError) as error:
            raise errors.EncodeError(f"cannot encode the observation: {error}") from error
        if self._socket is None:
            raise errors.ConnectionLost(f"the connection to {self.url} was closed after an error")
        try:
            answer = self._exchange(self._socket, text, deadline)
        except OSError as error:
            self.close()
            raise call_failure(error, self.url, "", timeout, f"{method} ") from error
        return self._result(method, answer)

    def _exchange(self, sock: socket.socket, text: bytes, deadline: float) -> bytes:
        if has_unread_bytes(sock):
            self.close()
            raise errors.ProtocolViolation(f"{self.url} sent data that was not requested")
        sock.settimeout(max(deadline - time.monotonic(), 1e-3))
        # One piece: the server reads the length with a single call and would tear a split one.
        sock.sendall(len(text).to_bytes(4, "big") + text)
        size = int.from_bytes(_read(sock, 4, deadline), "big")
        if size > self._limit:
            self.close()
            raise errors.ProtocolViolation(
                f"{self.url} announced an answer of {size} bytes, over the limit of {self._limit}: "
                "is it RoboTwin's model server?"
            )
        return _read(sock, size, deadline)

    def _result(self, method: str, answer: bytes) -> object:
        try:
            value = json.loads(answer, object_hook=from_json)
        except (ValueError, RecursionError) as error:
            self.close()
            raise errors.ProtocolViolation(f"{self.url} did not answer JSON: {error}") from error
        if isinstance(value, Mapping) and "error" in value:
            self.close()  # so does the server
            text = errors.printable(str(value["error"]), MAX_REASON)
            failure = errors.ServerError("an error", f"{text} (in {method})", True, self.url)
            failure.add_note(str(value.get("traceback", "")))
            raise failure
        if not isinstance(value, Mapping) or "res" not in value:
            self.close()
            raise errors.ProtocolViolation(
                f"{self.url} answered neither 'res' nor 'error' to {method}"
            )
        refuse_unread(value, ("res",))
        return value["res"]

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def _read(sock: socket.socket, size: int, deadline: float) -> bytes:
    """Exactly `size` bytes by `deadline`; OSError if the other end closes before."""
    data = bytearray()
    while len(data) < size:
        left = deadline - time.monotonic()
        if left <= 0:
            raise TimeoutError
        sock.settimeout(left)
        piece = sock.recv(min(size - len(data), 2**20))
        if not piece:
            raise ConnectionError("the server closed it")
        data += piece
    return bytes(data)


CAMERAS = {"head": "head_camera", "left_wrist": "left_camera", "right_wrist": "right_camera"}
DP_CAMERAS = {"head": "head_cam", "left_wrist": "left_cam", "right_wrist": "right_cam"}

WARNINGS = (
    "RoboTwin's TCP server calls any method that a client names and has no authentication: "
    "keep its port closed to others",
    "what a model behind RoboTwin's TCP server expects is invisible on the wire: `layout`, `calls` "
    "and `reset` must be those of the policy's own client half",
)


@dataclass(frozen=True)
class RoboTwinClientOptions(AnyModelOptions):
    """What RoboTwin's TCP server does not say."""

    layout: str = option(
        "robotwin",
        "`robotwin`: RoboTwin's nested observation, with the instruction; `dp`: head_cam, "
        "left_cam, right_cam (CHW, 0..1) and agent_pos",
        ("robotwin", "dp"),
    )
    calls: str = option(
        "ask",
        "`ask`: get_action(observation); `update`: update_obs(observation), then get_action(); "
        "`both`: update_obs(observation), except at the first query, then get_action(observation)",
        ("ask", "update", "both"),
    )
    reset: str = option("reset_model", "method called at the start of a trial; none for no call")
    history: Annotated[int, Meta(ge=0, le=64)] = option(
        0, "earlier steps, one action apart, given to update_obs before a query"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.reset.isidentifier() or self.reset.startswith("_"):
            raise ValueError(f"option reset={self.reset!r} is no name of a model's method")


def robotwin_observation(observation: Observation, joints: tuple[int, int]) -> dict[str, object]:
    """RoboTwin's nested observation. Joints and gripper 0..1 (1 = open), poses with w x y z."""
    state = np.asarray(observation["state"], np.float64)
    ee = np.asarray(observation["ee"], np.float64) if "ee" in observation else None
    left, right = ActionSpace("joint", joints).arms
    sent: dict[str, object] = {
        "observation": {
            theirs: {"rgb": observation["images"][ours]} for ours, theirs in CAMERAS.items()
        },
        "joint_action": {
            "left_arm": state[left.body].tolist(),
            "left_gripper": float(state[left.gripper]),
            "right_arm": state[right.body].tolist(),
            "right_gripper": float(state[right.gripper]),
            "vector": state,
        },
        "instruction": observation.get("instruction", ""),
    }
    if ee is not None:
        sent["endpose"] = {
            "left_endpose": ee[0, :-1].tolist(),
            "left_gripper": float(ee[0, -1]),
            "right_endpose": ee[1, :-1].tolist(),
            "right_gripper": float(ee[1, -1]),
        }
    return sent


def dp_observation(observation: Observation, joints: tuple[int, int]) -> dict[str, object]:
    """What RoboTwin's DP sends: images CHW in 0..1 and the joints, float64. The images are
    float32 here, half the bytes, and the numbers that its float64 become in the model."""
    sent: dict[str, object] = {
        theirs: np.moveaxis(observation["images"][ours], -1, 0).astype(np.float32) / np.float32(255)
        for ours, theirs in DP_CAMERAS.items()
    }
    sent["agent_pos"] = np.asarray(observation["state"], np.float64)
    return sent


LAYOUTS = {"robotwin": robotwin_observation, "dp": dp_observation}


class RoboTwinSession(StatelessSession):
    """One TCP connection."""

    def __init__(self, params: ConnectionParams, options: RoboTwinClientOptions) -> None:
        self._params, self._options, self._answered = params, options, False
        self._last_step, self._joints = -1, SIX_JOINT_ARMS
        spec = options.spec_of("robotwin", history=tuple(range(-options.history, 0)))
        super().__init__("robotwin", spec, options, WARNINGS)
        self._connection = FramedJson(params)

    def reset(self, id: int, trial: TrialInfo) -> None:
        self._last_step, self._joints = -1, trial.joints
        if self._options.reset != "none":
            self._call(self._options.reset, None, self._params.timeouts.reset)

    def infer(self, id: int, observation: Observation, timeout: float) -> Answer:
        until = time.monotonic() + timeout
        encode = LAYOUTS[self._options.layout]
        now = int(observation["step"])
        for offset in self.spec.history:
            # Steps before the first one, and those sent with an earlier query, are left out.
            if now + offset > self._last_step and now + offset >= 0:
                past: Observation = {**observation, **observation["history"][offset]}
                past.pop("ee", None)
                self._call("update_obs", encode(past, self._joints), timeout, until)
        self._last_step = now
        sent: dict[str, object] | None = encode(observation, self._joints)
        calls = self._options.calls
        if calls == "update" or (calls == "both" and now > 0):
            self._call("update_obs", sent, timeout, until)
        if calls == "update":
            sent = None
        return as_chunk(self._call("get_action", sent, timeout, until)), {}

    def _call(
        self, method: str, value: object, timeout: float, until: float | None = None
    ) -> object:
        try:
            result = self._connection.call(method, value, timeout, until)
        except (errors.CallTimeout, errors.ConnectionLost, errors.ProtocolViolation) as error:
            # There is no handshake, so this may be another server altogether.
            if self._answered:
                raise
            raise explain_error(error, self._params) from error.__cause__
        self._answered = True
        return result

    def close(self) -> None:
        self._connection.close()


def recognise(probe: Probe) -> bool:
    """A command without a name is refused in a framed JSON map."""
    connection = FramedJson(probe.params)
    try:
        connection.call("", None, probe.params.timeouts.infer)
    except errors.ServerError:
        return True
    finally:
        connection.close()
    return False


DIALECT = Dialect(
    server="RoboTwin's model server",
    scheme="robotwin+tcp",
    wire="tcp",
    port=9999,
    options=RoboTwinClientOptions,
    open_session=RoboTwinSession,
    recognise=recognise,
    sign="it answers a framed command without a name with an error",
    shared_state=True,
)
