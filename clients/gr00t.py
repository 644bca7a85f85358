"""GR00T N1.5 to N1.7 behind its own server: ZeroMQ (REQ to REP), one msgpack map a message.

    {"endpoint": "get_action", "data": {..}, "api_token": ".."}  ->  an answer, or {"error": ".."}

What a model reads and answers is asked at connect (`get_modality_config`): names and time offsets
of its videos, states and actions. Each name must be known to be one of ours (`NAMES`, and the
option `names`), or the run is refused before any trial. What is sent, by `layout`:

    nested   {"observation": {"video": {NAME: (1, T, H, W, 3)}, "state": {NAME: (1, T, D)},
             "language": {NAME: [[text]]}}}                           N1.6, N1.7
    flat     {"observation": {"video.NAME": (1, T, H, W, 3), .., NAME: [text]}}
                                                                      their simulation wrapper
    n15      {"video.NAME": (T, H, W, 3), "state.NAME": (T, D), NAME: [text]}

Arrays are sent as a .npy file in a map, which every version reads, and read in that form and in
msgpack-numpy's, which newer versions answer. The server stops at `kill`, which is never sent.
"""

import contextlib
import json
import socket
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.clients.chunks import ChunkOptions, as_chunk, invert_grippers, refuse_unread
from robospa.clients.dialect import Answer, ConnectionParams, Dialect, Probe, StatelessSession
from robospa.clients.numpy_msgpack import npy_form, unpack
from robospa.observation import CameraSpec, Observation
from robospa.protocol import errors
from robospa.protocol.client import violation
from robospa.protocol.codec import encode
from robospa.protocol.options import option
from robospa.protocol.policy import TrialInfo
from robospa.protocol.transport import connect_until, keep_freed_memory

GREETING = b"\xff........\x7f"
"""How a ZeroMQ server begins, whatever stands for the dots."""
MISSING = "gr00t:// needs pyzmq, the extra 'gr00t' of robospa: pip install pyzmq"


class ZeroMq:
    """Calls over one REQ socket, of which every deadline is kept and the end is noticed.

    ZeroMQ itself connects again and again in silence, and waits for ever for an answer that a
    server took with it. So a server that is not there is found out by plain TCP, one that hangs or
    is busy by `ping`, and one that goes away by the socket's monitor. After any failure the socket
    is closed: a new one is made by the next connection.
    """

    def __init__(self, params: ConnectionParams) -> None:
        try:
            import zmq
        except ImportError as error:
            raise errors.HandshakeError(MISSING) from error
        self.url, self._limits, self._token = params.endpoint.url, params.limits, params.token
        host = connect_until(self.url, params.timeouts.wait, lambda: _greeted(params))
        keep_freed_memory()
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._socket = self._context.socket(zmq.REQ)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.MAXMSGSIZE, params.limits.message)
        self._monitor = self._socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        self._poller = zmq.Poller()
        for end in (self._socket, self._monitor):
            self._poller.register(end, zmq.POLLIN)
        self._socket.setsockopt(zmq.IPV6, ":" in host)
        self._socket.connect(f"tcp://{replace(params.endpoint, host=host).authority}")

    def call(self, endpoint: str, data: Mapping[str, object] | None, timeout: float) -> object:
        """The answer of an endpoint; `data` is None for one without input."""
        said = {"endpoint": endpoint, "data": data, "api_token": self._token}
        request = {name: value for name, value in said.items() if value is not None}
        if self._context.closed:
            raise errors.ConnectionLost(f"the connection to {self.url} was closed after an error")
        self._socket.send(encode(request, self._limits, npy_form), copy=False)
        answer = self._receive(endpoint, timeout)
        if answer == b"ERROR":  # all that very old versions say
            raise errors.ServerError("an error", "no reason given", True, self.url)
        try:
            value = unpack(answer, self._limits)
        except errors.DecodeError as error:
            self.close()
            raise violation(self.url, f"the answer cannot be read: {error}") from error
        if isinstance(value, Mapping) and "error" in value:
            text = errors.printable(str(value["error"]))
            if text.startswith("Unauthorized"):
                raise errors.Unauthorized(f"{self.url} refused the token: {text}")
            raise errors.ServerError("an error", text, True, self.url)
        return value

    def _receive(self, endpoint: str, timeout: float) -> bytes:
        ready = dict(self._poller.poll(int(timeout * 1e3)))
        if self._socket in ready:
            return self._socket.recv()
        self.close()
        if ready:
            raise errors.ConnectionLost(
                f"the connection to {self.url} ended while waiting: the server went away, or "
                f"answered more than {self._limits.message} bytes"
            )
        raise errors.CallTimeout(
            f"{self.url} did not answer {endpoint} within {timeout:g} s; look at the server's "
            "log, or allow more time (it answers one request at a time, whoever asks)"
        )

    def close(self) -> None:
        self._context.destroy(linger=0)


def _greeted(params: ConnectionParams) -> str:
    """The number of the host that greets: of several, ZeroMQ tries one alone. Raises OSError where
    nobody listens, ConnectFailed for something that is not ZeroMQ."""
    endpoint, said = params.endpoint, b""
    address = endpoint.host, endpoint.port
    with (
        socket.create_connection(address, params.timeouts.connect) as probe,
        contextlib.suppress(TimeoutError),
    ):
        host: str = probe.getpeername()[0]
        said = probe.recv(len(GREETING))
    if said[:1] + said[9:] != GREETING[:1] + GREETING[9:]:
        raise errors.ConnectFailed(f"{endpoint.url} is no ZeroMQ server: it did not greet as one")
    return host


# ---------------------------------------------------------------- what the model reads and answers

CAMERAS = ("head", "left_wrist", "right_wrist")
PARTS = ("left_arm", "left_gripper", "right_arm", "right_gripper")
WHOLE = "joints"
KNOWN = {"video": CAMERAS, "state": (*PARTS, WHOLE), "action": (*PARTS, WHOLE)}
"""What the names of each modality may stand for."""
NAMES = {
    "head": ("head", "cam_high", "cam_head", "head_camera", "ego_view", "top"),
    "left_wrist": ("left_wrist", "cam_left_wrist", "left_camera"),
    "right_wrist": ("right_wrist", "cam_right_wrist", "right_camera"),
    "left_arm": ("left_arm", "left_joints"),
    "left_gripper": ("left_gripper",),
    "right_arm": ("right_arm", "right_joints"),
    "right_gripper": ("right_gripper",),
    WHOLE: (WHOLE, "joint_state", "joint_action", "qpos"),
}
"""What trainers call our cameras and the parts of state and actions; WHOLE is all four of them."""
WAYS = (sorted(PARTS), [WHOLE])

WARNINGS = (
    "sampling noise of GR00T cannot be seeded from here: two runs will differ",
    "which end of a gripper is 1 and what a name stands for is invisible on the wire: `grippers` "
    "and `names` must be those of the training data",
)


@dataclass(frozen=True)
class Gr00tClientOptions(ChunkOptions):
    """What GR00T's server does not say."""

    names: str = option(
        "",
        f"more names at the server, such as head:front_view,left_arm:arm_l, of {', '.join(NAMES)}",
    )
    grippers: str = option(
        "open", "what 1 means in a gripper, sent and answered", ("open", "closed")
    )
    deltas: str = option(
        "refuse",
        "`add`: actions declared as DELTA are added up, starting from the joints sent",
        ("refuse", "add"),
    )
    state: str = option("commanded", "which joints to send", ("commanded", "measured"))

    def __post_init__(self) -> None:
        super().__post_init__()
        self.ours  # noqa: B018

    @cached_property
    def ours(self) -> dict[str, str]:
        """Our camera or part by the server's name."""
        found = {theirs: ours for ours, names in NAMES.items() for theirs in names}
        for pair in filter(None, self.names.split(",")):
            ours, _, theirs = pair.partition(":")
            if ours not in NAMES or not theirs:
                raise ValueError(f"option names: {pair!r} is not of the form part:name")
            found[theirs] = ours
        return found


@dataclass(frozen=True)
class Modality:
    """An entry of the server's configuration: names, their time offsets in actions, which names are
    declared as changes (`deltas`) or as end-effector poses, and whether it came as a text."""

    keys: tuple[str, ...] = ()
    offsets: tuple[int, ...] = (0,)
    deltas: tuple[str, ...] = ()
    poses: tuple[str, ...] = ()
    text: bool = False


def read_config(answer: object) -> dict[str, Modality]:
    """The server's configuration by modality; raises HandshakeError."""
    try:
        found = {str(name): _modality(one) for name, one in dict(answer).items()}  # type: ignore[call-overload]
        return {"video": found["video"], "action": found["action"], **found}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        said = errors.printable(str(answer), 160)
        raise errors.HandshakeError(
            "the server's get_modality_config names no video and action, so that what its policy "
            f"reads is unknown: {said}"
        ) from error


def _modality(value: Any) -> Modality:
    """N1.5 writes JSON as text, later versions as a map."""
    text = isinstance(value["as_json"], str)
    read = json.loads(value["as_json"]) if text else value["as_json"]
    keys = tuple(map(str, read["modality_keys"]))
    configs = dict(zip(keys, read.get("action_configs") or (), strict=False))
    return Modality(
        keys,
        tuple(map(int, read["delta_indices"])),
        tuple(key for key, one in configs.items() if one["rep"].upper() == "DELTA"),
        tuple(key for key, one in configs.items() if one["type"].upper() == "EEF"),
        text,
    )


def check_config(config: Mapping[str, Modality], options: Gr00tClientOptions) -> None:
    """Raises HandshakeError, with the names that the server has, if they cannot be served."""
    ours, problems = options.ours, []
    for modality, known in KNOWN.items():
        one = config.get(modality, Modality())
        if unknown := [key for key in one.keys if ours.get(key) not in known]:
            problems.append(f"what {modality} {', '.join(unknown)} is, is not known here")
        elif modality == "action" and sorted(ours[key] for key in one.keys) not in WAYS:
            problems.append(f"its actions are neither {', '.join(PARTS)} nor {WHOLE} alone")
        elif modality != "action" and max(one.offsets, default=0) > 0:
            problems.append(f"its {modality} is later than the query")
    if poses := config["action"].poses:
        problems.append(f"{', '.join(poses)} are end-effector poses, and joints are needed")
    if config["action"].deltas and options.deltas == "refuse":
        problems.append(
            f"{', '.join(config['action'].deltas)} are declared as DELTA (deltas=add adds them up)"
        )
    if problems:
        has = "; ".join(f"{name}: {', '.join(one.keys)}" for name, one in config.items())
        raise errors.HandshakeError(
            f"the server's names do not fit: {'; '.join(problems)}; it has {has}; say what they "
            "are with option names, as in names=left_arm:NAME"
        )


class Gr00tSession(StatelessSession):
    """One REQ socket, and the joints of the trial's robot. `layout`: as above."""

    def __init__(self, params: ConnectionParams, options: Gr00tClientOptions) -> None:
        self._params, self._options, self._space = params, options, ActionSpace("joint")
        self._server = ZeroMq(params)
        try:
            self._server.call("ping", None, params.timeouts.hello)
            self._config = read_config(
                self._server.call("get_modality_config", None, params.timeouts.hello)
            )
            check_config(self._config, options)
            self._layout = self._ask_layout()
        except BaseException:
            self._server.close()
            raise
        self._video, state = self._config["video"], self._config.get("state", Modality())
        self._state = state if state.keys else Modality()
        past = {*self._video.offsets, *self._state.offsets} - {0}
        spec = options.spec_of(
            "gr00t",
            cameras=tuple(CameraSpec(options.ours[key]) for key in self._video.keys),
            state=options.state,
            history=tuple(sorted(past)),
            action_dim=options.columns("joint"),
        )
        names = {
            m: {"names": list(c.keys), "offsets": list(c.offsets)} for m, c in self._config.items()
        }
        super().__init__("gr00t", spec, options, WARNINGS, modalities=names, layout=self._layout)

    def _ask_layout(self) -> str:
        """N1.5 writes texts. N1.6 and later refuse an empty observation before the model, with the
        name they miss: a modality's, or in the simulation wrapper that of a video."""
        if self._config["video"].text:
            return "n15"
        empty: dict[str, object] = {"observation": {}, "options": None}
        try:
            self._server.call("get_action", empty, self._params.timeouts.hello)
        except errors.ServerError as error:
            return "flat" if "video." in error.message else "nested"
        return "nested"

    def reset(self, id: int, trial: TrialInfo) -> None:
        self._space = ActionSpace("joint", trial.joints)
        if self._layout != "n15":  # which has no such endpoint
            self._server.call("reset", {"options": None}, self._params.timeouts.reset)

    def infer(self, id: int, observation: Observation, timeout: float) -> Answer:
        sent = self.encode(observation)
        data = sent if self._layout == "n15" else {"observation": sent, "options": None}
        answer = self._server.call("get_action", data, timeout)
        if isinstance(answer, list) and answer:
            answer = answer[0]  # the second is a map of remarks
        if not isinstance(answer, Mapping):
            found = type(answer).__name__
            raise errors.PolicyAnswerError(f"the policy answered {found}, not a map of actions")
        named = {str(name).removeprefix("action."): value for name, value in answer.items()}
        refuse_unread(named, self._config["action"].keys)
        return self._chunk(named, self._robot(observation["state"])), {}

    def encode(self, observation: Observation) -> dict[str, object]:
        """The observation in the server's layout."""
        ours, batch = self._options.ours, ... if self._layout == "n15" else None
        frames, views = (
            [observation["history"][n] if n < 0 else observation for n in one.offsets]
            for one in (self._video, self._state)
        )
        states = np.stack([self._robot(view["state"]) for view in views])
        found: dict[str, dict[str, NDArray[np.generic]]] = {
            "video": {
                key: np.stack([view["images"][ours[key]] for view in frames])[batch]
                for key in self._video.keys
            },
            "state": {key: states[:, self._columns(key)][batch] for key in self._state.keys},
        }
        language = self._config.get("language", self._config.get("annotation", Modality()))
        texts = {key: [observation.get("instruction", "")] for key in language.keys}
        if self._layout == "nested":
            return {**found, "language": {key: [text] for key, text in texts.items()}}
        flat = {f"{m}.{key}": rows for m, named in found.items() for key, rows in named.items()}
        return {**flat, **texts}

    def _columns(self, key: str) -> slice:
        """The columns of a state or an action that the server calls `key`."""
        part, space = self._options.ours[key], self._space
        arm = space.arms[part.startswith("right")]
        if part == WHOLE:
            return slice(0, space.width)
        return slice(arm.gripper, arm.gripper + 1) if part.endswith("gripper") else arm.body

    def _robot(self, rows: NDArray[np.float32]) -> NDArray[np.float32]:
        """Ours (.., D) as the model has them, or its own as ours: 1 - g where 1 is closed."""
        same = np.asarray(rows, np.float32)
        return invert_grippers(same, self._space) if self._options.grippers == "closed" else same

    def _chunk(self, named: Mapping[str, object], state: NDArray[np.float32]) -> object:
        """The chunk (T, D) in actions by name, each (1, T, D), (T, D) or, in N1.5, without axes of
        one number."""
        parts: list[tuple[slice, NDArray[np.float32]]] = []
        for key in self._config["action"].keys:
            columns, rows = self._columns(key), as_chunk(named.get(key))
            width = columns.stop - columns.start
            if isinstance(rows, np.ndarray) and rows.ndim == 3 and len(rows) == 1:
                rows = rows[0]
            if isinstance(rows, np.ndarray) and rows.ndim == 1 and rows.size % width == 0:
                rows = rows.reshape(-1, width)
            if not isinstance(rows, np.ndarray) or rows.ndim != 2 or rows.shape[1] != width:
                found = rows.shape if isinstance(rows, np.ndarray) else type(rows).__name__
                raise errors.PolicyAnswerError(
                    f"the policy answered {found} as {key}, not numbers of (1, T, {width})"
                )
            if key in self._config["action"].deltas:
                rows = state[columns] + np.cumsum(rows, axis=0, dtype=np.float32)
            parts.append((columns, rows))
        lengths = [len(rows) for _, rows in parts]
        if len(set(lengths)) > 1:
            raise errors.PolicyAnswerError(f"the policy answered actions of lengths {lengths}")
        chunk = np.empty((lengths[0], len(state)), np.float32)
        for columns, rows in parts:
            chunk[:, columns] = rows
        return self._robot(chunk)

    def close(self) -> None:
        self._server.close()


def recognise(probe: Probe) -> bool:
    """It greets as ZeroMQ, and answers `ping` with a map, or is busy and answers nothing."""
    _greeted(probe.params)
    try:
        server = ZeroMq(probe.params)
    except errors.HandshakeError:  # pyzmq is missing: its own scheme says so
        return True
    try:
        return isinstance(server.call("ping", None, probe.params.timeouts.infer), Mapping)
    except errors.CallTimeout:
        return True
    finally:
        server.close()


DIALECT = Dialect(
    server="a GR00T server",
    scheme="gr00t",
    wire="tcp",
    port=5555,
    options=Gr00tClientOptions,
    open_session=Gr00tSession,
    recognise=recognise,
    sign="it greets as ZeroMQ",
    deciding_options={"measured state": "state", "gripper inverted": "grippers"},
)
