"""RoboTwin's `policy_model_server.py`: raw TCP, a length of four bytes, then JSON, both ways.

    {"cmd": "get_action", "obs": {...}}        ->  {"res": chunk} or {"error": .., "traceback": ..}

The server calls whatever method of the model is named, and a policy's own `encode_obs` is expected
at this side of the wire: options choose among the layouts that exist (`layout`) and among the
orders of calls (`calls`). Only names of plain methods are ever sent. The server's own weaknesses
(no authentication, anything callable) remain: let it listen on a machine of one's own only.

Here every frame is read whole, its size is bounded, and every call has one deadline.
"""

from __future__ import annotations

import base64
import json
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from robospa.action_space import ActionSpace
from robospa.clients.chunks import as_chunk, check_horizon
from robospa.clients.detect import explained
from robospa.clients.dialect import ConnectionParams, Dialect
from robospa.clients.http import left_over
from robospa.clients.numpy_json import array_of
from robospa.clients.probe import Probe
from robospa.protocol.errors import (
    CallTimeout,
    ConnectFailed,
    ConnectionLost,
    EncodeError,
    ProtocolViolation,
    ServerError,
)
from robospa.protocol.options import option, plain_options
from robospa.protocol.policy import Observation, PolicySpec, TrialInfo
from robospa.protocol.sanitize import printable

CAMERAS = {"head": "head_camera", "left_wrist": "left_camera", "right_wrist": "right_camera"}
DP_CAMERAS = {"head": "head_cam", "left_wrist": "left_cam", "right_wrist": "right_cam"}
SHOWN = 300

WARNINGS = (
    "RoboTwin's TCP server calls any method that a client names and has no authentication: "
    "keep its port closed to others",
    "what a model behind RoboTwin's TCP server expects is invisible on the wire: `layout`, `calls` "
    "and `reset` must be those of the policy's own client half",
)


@dataclass(frozen=True)
class RoboTwinClientOptions:
    """What RoboTwin's TCP server does not say."""

    layout: str = option(
        "robotwin",
        "`robotwin`: RoboTwin's nested observation, with the instruction; `dp`: head_cam, "
        "left_cam, right_cam (CHW, 0..1) and agent_pos",
        ("robotwin", "dp"),
    )
    calls: str = option(
        "ask",
        "`ask`: get_action(observation); `update`: update_obs(observation), then get_action()",
        ("ask", "update"),
    )
    reset: str = option("reset_model", "method called at the start of a trial; none for no call")
    space: str = option("joint", "what the model answers", ("joint", "ee"))
    history: int = option(0, "earlier steps, one action apart, given to update_obs before asking")
    state: str = option("commanded", "which joints to send", ("commanded", "measured"))
    horizon: int = option(50, "actions in a chunk, at most")
    execute: int | None = option(None, "actions executed before the next query; none for all")

    def __post_init__(self) -> None:
        """ValueError for options that cannot be."""
        check_horizon(self.horizon, self.execute)
        if not 0 <= self.history <= 64:
            raise ValueError(f"option history={self.history} is not one of 0 to 64")
        if not self.reset.isidentifier() or self.reset.startswith("_"):
            raise ValueError(f"option reset={self.reset!r} is no name of a model's method")


def to_json(value: Any) -> dict[str, Any]:
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


def from_json(value: dict[str, Any]) -> Any:
    """The inverse, for `json.loads`; only plain numbers become arrays."""
    return array_of(value, "data") if value.get("__numpy_array__") is True else value


def robotwin_observation(observation: Observation) -> dict[str, Any]:
    """RoboTwin's nested observation. Joints and gripper 0..1 (1 = open), poses with w x y z."""
    state = np.asarray(observation["state"], np.float64)
    ee = np.asarray(observation["ee"], np.float64) if "ee" in observation else None
    left, right = ActionSpace("joint").arms
    sent: dict[str, Any] = {
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


def dp_observation(observation: Observation) -> dict[str, Any]:
    """What RoboTwin's DP sends: images CHW in 0..1, float32 here, and the 14 joints."""
    sent: dict[str, Any] = {
        theirs: np.moveaxis(observation["images"][ours], -1, 0).astype(np.float32) / np.float32(255)
        for ours, theirs in DP_CAMERAS.items()
    }
    sent["agent_pos"] = np.asarray(observation["state"], np.float64)
    return sent


LAYOUTS = {"robotwin": robotwin_observation, "dp": dp_observation}


class Wire:
    """Framed JSON over one TCP connection, with limits and deadlines."""

    def __init__(self, params: ConnectionParams) -> None:
        self.url = f"robotwin+tcp://{params.endpoint.host}:{params.endpoint.port}"
        self._limit = params.limits.message
        self._socket = self._connect(params)

    def _connect(self, params: ConnectionParams) -> socket.socket | None:
        address = (params.endpoint.host, params.endpoint.port)
        give_up = time.monotonic() + params.timeouts.wait
        while True:
            try:
                found = socket.create_connection(address, params.timeouts.connect)
                found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                return found
            except ConnectionRefusedError as error:
                if time.monotonic() >= give_up:
                    raise ConnectFailed(
                        f"nobody listens at {self.url}: start the policy server first"
                    ) from error
                time.sleep(0.05)
            except OSError as error:
                raise ConnectFailed(f"cannot connect to {self.url}: {error}") from error

    def call(self, method: str, value: Any, timeout: float, until: float | None = None) -> Any:
        """What the model's `method` returned; after any error the connection is closed.

        `until`: an earlier end of the `timeout` s on the monotonic clock, shared by several calls.
        """
        deadline = time.monotonic() + timeout if until is None else until
        try:
            text = json.dumps({"cmd": method, "obs": value}, default=to_json).encode()
        except (TypeError, ValueError) as error:
            raise EncodeError(f"cannot encode the observation: {error}") from error
        if self._socket is None:
            raise ConnectionLost(f"the connection to {self.url} was closed after an error")
        try:
            answer = self._exchange(self._socket, text, deadline)
        except TimeoutError as error:
            self.close()
            raise CallTimeout(
                f"{self.url} did not answer {method} within {timeout:g} s; "
                "look at the server's log, or allow more time"
            ) from error
        except OSError as error:
            self.close()
            reason = str(error) or type(error).__name__
            raise ConnectionLost(
                f"the connection to {self.url} ended while waiting: {reason}"
            ) from error
        return self._result(method, answer)

    def _exchange(self, sock: socket.socket, text: bytes, deadline: float) -> bytes:
        if left_over(sock):
            self.close()
            raise ProtocolViolation(f"{self.url} sent what nobody asked for")
        sock.settimeout(max(deadline - time.monotonic(), 1e-3))
        # One piece: the server reads the length with a single call and would tear a split one.
        sock.sendall(len(text).to_bytes(4, "big") + text)
        size = int.from_bytes(_read(sock, 4, deadline), "big")
        if size > self._limit:
            self.close()
            raise ProtocolViolation(
                f"{self.url} announced an answer of {size} bytes, over the limit of {self._limit}: "
                "is it RoboTwin's model server?"
            )
        return _read(sock, size, deadline)

    def _result(self, method: str, answer: bytes) -> Any:
        try:
            value = json.loads(answer, object_hook=from_json)
        except (ValueError, RecursionError) as error:
            self.close()
            raise ProtocolViolation(f"{self.url} did not answer JSON: {error}") from error
        if isinstance(value, Mapping) and "error" in value:
            self.close()  # so does the server
            text = printable(str(value["error"]), SHOWN - 60)
            failure = ServerError("an error", f"{text} (in {method})", True, self.url)
            failure.add_note(str(value.get("traceback", "")))
            raise failure
        if not isinstance(value, Mapping) or "res" not in value:
            self.close()
            raise ProtocolViolation(f"{self.url} answered neither 'res' nor 'error' to {method}")
        return value["res"]

    def close(self) -> None:
        """Close; harmless when closed already."""
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


class RoboTwinSession:
    """One TCP connection."""

    def __init__(self, params: ConnectionParams, options: RoboTwinClientOptions) -> None:
        self._params, self._options, self._answered = params, options, False
        self._given = -1
        self.spec = PolicySpec(
            name="robotwin",
            state=options.state,
            action=options.space,
            horizon=options.horizon,
            execute=options.execute,
            history=tuple(range(-options.history, 0)),
            action_dim=ActionSpace(options.space).width,
        )
        self.hello: dict[str, Any] = {
            "dialect": "robotwin",
            "spec": self.spec.to_json(),
            "options": plain_options(options),
            "warnings": list(WARNINGS),
        }
        self._wire = Wire(params)

    def reset(self, id: int, trial: TrialInfo) -> None:
        self._given = -1
        if self._options.reset != "none":
            self._call(self._options.reset, None, self._params.timeouts.reset)

    def infer(
        self, id: int, observation: Observation, timeout: float
    ) -> tuple[Any, Mapping[str, float]]:
        until = time.monotonic() + timeout
        encode = LAYOUTS[self._options.layout]
        now = int(observation["step"])
        for offset in self.spec.history:
            # Steps before the first one, and those told at an earlier query, are left out.
            if now + offset > self._given and now + offset >= 0:
                past = {**observation, **observation["history"][offset]}
                past.pop("ee", None)
                self._call("update_obs", encode(past), timeout, until)
        self._given = now
        sent: dict[str, Any] | None = encode(observation)
        if self._options.calls == "update":
            self._call("update_obs", sent, timeout, until)
            sent = None
        return as_chunk(self._call("get_action", sent, timeout, until)), {}

    def _call(self, method: str, value: Any, timeout: float, until: float | None = None) -> Any:
        try:
            result = self._wire.call(method, value, timeout, until)
        except (CallTimeout, ConnectionLost, ProtocolViolation) as error:
            # Nothing is said at a handshake, so this may be another server altogether.
            if self._answered:
                raise
            raise explained(error, self._params) from error.__cause__
        self._answered = True
        return result

    def end(self, id: int, outcome: Mapping[str, Any]) -> None:
        """Nothing to send."""

    def close(self) -> None:
        self._wire.close()


def recognise(probe: Probe) -> bool:
    """A command without a name is refused in a framed JSON map."""
    wire = Wire(probe.params)
    try:
        wire.call("", None, probe.params.timeouts.infer)
    except ServerError:
        return True
    finally:
        wire.close()
    return False


DIALECT = Dialect(
    server="RoboTwin's model server",
    scheme="robotwin+tcp",
    wire="tcp",
    port=9999,
    options=RoboTwinClientOptions,
    open_session=RoboTwinSession,
    recognise=recognise,
)
