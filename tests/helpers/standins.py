"""Stand-ins of servers over WebSockets, TCP and ZeroMQ, and clients of ours to all stand-ins."""

import contextlib
import io
import json
import socketserver
import struct
import threading
import traceback
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import msgpack
import numpy as np
from standins_http import FRAMED, NAMED, ND, OPENPI, TRIAL, Go1, Oft, StandIn, XVla, observation
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve
from wire_helpers import QUICK

from robospa.clients import connect
from robospa.protocol.transport import Timeouts

# ---------------------------------------------------------------- WebSocket


class Socket(StandIn):
    """A WebSocket server without subprotocol; `health` is the path of its health page."""

    health = ("/healthz", "OK\n")
    authorization: str | None = None

    def listen(self) -> None:
        def look(connection: Any, request: Any) -> Any:
            self.authorization = request.headers.get("Authorization")
            if request.path == self.health[0]:
                return connection.respond(200, self.health[1])
            return None

        def handle(socket: Any) -> None:
            with contextlib.suppress(ConnectionClosed):
                self.talk(socket)

        server = serve(handle, "127.0.0.1", 0, process_request=look, max_size=None)
        self.port = server.socket.getsockname()[1]
        self._run(server)

    def talk(self, socket: Any) -> None:
        raise NotImplementedError


class OpenPi(Socket):
    """openpi's serve_policy with an Aloha configuration; `raw` are its requests as they came."""

    scheme = "openpi"
    raw: list[bytes]
    metadata: Mapping[Any, Any] = {"reset_pose": [0, -1.5, 1.5, 0, 0, 0]}

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.raw = []

    names = ("cam_high", "cam_low", "cam_left_wrist", "cam_right_wrist")

    def talk(self, socket: Any) -> None:
        socket.send(msgpack.packb(self.metadata, default=OPENPI.write))
        while True:
            data = socket.recv()
            self.raw.append(data)
            try:
                seen = msgpack.unpackb(data, object_hook=OPENPI.read, strict_map_key=False)
                wrong = set(seen["images"]) - set(self.names)
                if wrong:
                    raise ValueError(f"Expected images to contain {self.names}, got {wrong}")
                seen["images"]["cam_high"].shape, seen["state"].shape
                self.requests.append(seen)
                actions = np.asarray(self.model(seen))
            except Exception:
                socket.send(traceback.format_exc())
                return socket.close(1011, "Internal server error")
            if self.instead is not None:
                socket.send(self.instead)
                continue
            reply = {"actions": actions, "policy_timing": {"infer_ms": 12.5}, **self.extra}
            socket.send(msgpack.packb(reply, default=OPENPI.write))


class Family(OpenPi):
    """A server of openpi's family, whose model answers whole messages."""

    def talk(self, socket: Any) -> None:
        socket.send(msgpack.packb(self.metadata, default=OPENPI.write))
        while True:
            seen = msgpack.unpackb(socket.recv(), object_hook=OPENPI.read, strict_map_key=False)
            self.requests.append(seen)
            socket.send(msgpack.packb(self.model(seen), default=OPENPI.write))


class XPolicyLab(Socket):
    """XPolicyLab's policy server; what it cannot read it never answers."""

    scheme = "xpolicylab"
    health = ("/none", "")
    answers: ClassVar = {
        "hello": "hello_ack",
        "prepare_case": "prepare_case_ack",
        "reset": "reset_result",
        "infer": "infer_result",
        "trial_end": "trial_end_ack",
    }

    def talk(self, socket: Any) -> None:
        while True:
            data = socket.recv()
            try:
                seen = msgpack.unpackb(data, object_hook=ND.read, strict_map_key=False)
                kind = seen["message_type"]
                seen["message_id"], seen["evaluation_id"]
                wanted = self.answers[kind]
            except Exception:
                continue
            self.requests.append(seen)
            if self.instead is not None and kind == "infer":
                socket.send(self.instead)
                continue
            try:
                payload = self.payload(kind, seen["payload"])
                wanted = "error" if "error" in payload else wanted
                payload = payload.get("error", payload)
            except Exception as error:
                wanted = "error"
                payload = {"code": "INFER_FAILED", "message": str(error), "details": {}}
            reply = {**seen, "message_type": wanted, "payload": payload}
            socket.send(msgpack.packb(reply, default=ND.write, use_bin_type=True))

    broken: tuple[str, ...] = ()

    def payload(self, kind: str, given: Any) -> Any:
        if kind in self.broken:
            raise RuntimeError(f"{kind} failed")
        if kind == "hello":
            return {"ok": True, "server": "demo_policy_server"}
        if kind == "infer":
            return {"actions": self.model(given["observation"]), "latency_ms": 4.5, **self.extra}
        return {"ok": True}


class VlaEval(Socket):
    """A vla-eval model server. `broken_start`: `episode_start` fails once."""

    scheme = "vla-eval"
    health = ("/health", '{"status": "ok"}\n')
    broken_start = False
    version = 1
    reads: tuple[str, ...] = ("images",)

    def talk(self, socket: Any) -> None:
        while True:
            seen = msgpack.unpackb(socket.recv(), object_hook=NAMED.read)
            kind, _, _ = seen["type"], seen["payload"], seen["timestamp"]
            self.requests.append(seen)
            if kind == "hello":
                said = {"harness_version": "0.8.0", "protocol_version": self.version}
                spec = {"joints": {"name": "joints", "dims": 14, "format": "joint_positions"}}
                said |= {"model_server": "Dummy", "capabilities": {}, "action_spec": spec}
                said["observation_spec"] = {name: {"format": "any"} for name in self.reads}
                self.reply(socket, seen, "hello", said)
            elif kind == "episode_start" and self.broken_start:
                self.broken_start = False
                self.reply(socket, seen, "error", {"error": "episode_start_failed: not ready"})
            elif kind == "observation" and self.instead is not None:
                socket.send(self.instead)
            elif kind == "observation":
                try:
                    found = {"actions": np.asarray(self.model(seen["payload"])), **self.extra}
                    self.reply(socket, seen, "action", found)
                except Exception as error:
                    text = f"observation_failed: {type(error).__name__}: {error}"
                    self.reply(socket, seen, "error", {"error": text})

    def reply(self, socket: Any, seen: Any, kind: str, payload: Any) -> None:
        message = {"type": kind, "payload": payload, "seq": seen["seq"], "timestamp": 0.0}
        socket.send(msgpack.packb(message, default=NAMED.write))


# ---------------------------------------------------------------- TCP


class RoboTwin(StandIn):
    """RoboTwin's policy_model_server."""

    scheme = "robotwin+tcp"
    methods = ("reset_model", "get_action", "update_obs")

    def listen(self) -> None:
        outer = self

        class Handler(socketserver.BaseRequestHandler):
            def handle(self) -> None:
                with contextlib.suppress(OSError):
                    while outer.one(self.request):
                        pass

        server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler)
        server.daemon_threads = True
        self.port = server.server_address[1]
        self._run(server)

    def one(self, sock: Any) -> bool:
        """Serve one request; whether the connection stays open."""
        header = sock.recv(4)  # in a single call, as the original does
        if len(header) < 4:
            return False
        size = struct.unpack(">I", header)[0]
        data = bytearray()
        while len(data) < size:
            piece = sock.recv(min(size - len(data), 65536))
            if not piece:
                return False
            data += piece
        try:
            seen = json.loads(data, object_hook=FRAMED.read)
            if seen["cmd"] not in self.methods:
                raise AttributeError(f"No model method named '{seen['cmd']}'")
            self.requests.append(seen)
            found = self.model(seen["obs"]) if seen["cmd"] == "get_action" else None
            reply, good = {"res": found, **self.extra}, True
        except Exception as error:
            text = f"Error handling request: {error}"
            reply, good = {"error": text, "traceback": traceback.format_exc()}, False
        answer = json.dumps(reply, default=FRAMED.write).encode()
        frame = struct.pack(">I", len(answer)) + answer
        if self.instead is not None and seen["cmd"] == "get_action":
            frame = self.instead
        sock.sendall(frame)
        return good


# ---------------------------------------------------------------- ZeroMQ


def npy(value: Any) -> Any:
    """GR00T's older writing of an array, and its configuration, which travels as it is."""
    file = io.BytesIO()
    np.save(file, value, allow_pickle=False)
    return {"__ndarray_class__": True, "as_npy": file.getvalue()}


PARTS = {
    "left_joints": slice(0, 6),
    "left_gripper": slice(6, 7),
    "right_joints": slice(7, 13),
    "right_gripper": slice(13, None),
}


class Gr00t(StandIn):
    """GR00T's PolicyServer in front of N1.6: `layout` nested, flat (its simulation wrapper) or n15;
    `codec` writes an array; `config` is what it says that it reads."""

    scheme = "gr00t"
    layout = "nested"
    codec: Callable[[Any], Any] = staticmethod(npy)
    host = "127.0.0.1"
    token: str | None = None

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.calls: list[str] = []
        self.config: dict[str, dict[str, Any]] = {
            "video": {"delta_indices": [0], "modality_keys": ["cam_high", "cam_left_wrist"]},
            "state": {"delta_indices": [0], "modality_keys": list(PARTS)},
            "action": {"delta_indices": list(range(16)), "modality_keys": list(PARTS)},
            "language": {"delta_indices": [0], "modality_keys": ["task"]},
        }

    def listen(self) -> None:
        import zmq

        context = zmq.Context()
        socket = context.socket(zmq.REP)
        socket.setsockopt(zmq.IPV6, ":" in self.host)
        self.port = socket.bind_to_random_port(f"tcp://{self.host}")
        over = threading.Event()

        def work() -> None:
            while not over.is_set():
                if socket.poll(20):
                    data = socket.recv()
                    try:
                        reply = self.answer(msgpack.unpackb(data, object_hook=self.read))
                    except Exception as error:
                        reply = {"error": str(error)}
                    default = self.codec
                    raw = isinstance(reply, bytes)
                    socket.send(reply if raw else msgpack.packb(reply, default=default))

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        for stop in (lambda: context.destroy(linger=0), lambda: thread.join(5), over.set):
            self._over.callback(stop)  # the last one first

    @staticmethod
    def read(value: Any) -> Any:
        npy = value.get("as_npy") if "__ndarray_class__" in value else None
        return value if npy is None else np.load(io.BytesIO(npy), allow_pickle=False)

    def answer(self, seen: Any) -> Any:
        assert seen.get("api_token") == self.token, "Unauthorized: Invalid API token"
        self.calls.append(seen["endpoint"])
        if seen["endpoint"] == "ping":
            return {"status": "ok", "message": "Server is running"}
        if seen["endpoint"] == "get_modality_config":
            text = self.layout == "n15"
            return {
                name: {
                    "__ModalityConfig_class__": True,
                    "as_json": json.dumps(config) if text else config,
                }
                for name, config in self.config.items()
            }
        if seen["endpoint"] == "reset" and self.layout != "n15":
            assert seen["data"] == {"options": None}
            return {}
        if seen["endpoint"] != "get_action":
            raise ValueError(f"Unknown endpoint: {seen['endpoint']}")
        told = seen["data"] if self.layout == "n15" else seen["data"]["observation"]
        self.check(told)
        self.requests.append(told)
        if self.instead is not None:
            return self.instead
        rows = np.asarray(self.model(told))
        batch = rows if self.layout == "n15" else rows[None]
        dot = "" if self.layout == "nested" else "action."
        parts = {f"{dot}{key}": batch[..., columns] for key, columns in PARTS.items()}
        if self.layout == "n15":
            return {key: np.squeeze(part) for key, part in parts.items()} | self.extra
        return [parts | self.extra, {}]

    def check(self, told: Any) -> None:
        if self.layout == "nested":
            for modality in ("video", "state", "language"):
                assert modality in told, f"Observation must contain a '{modality}' key"
            told = {f"{m}.{key}": value for m in told for key, value in told[m].items()}
        axes = 0 if self.layout == "n15" else 1
        for modality, ndim, kind in (("video", 4, np.uint8), ("state", 2, np.float32)):
            config = self.config[modality]
            for key in config["modality_keys"]:
                name = f"{modality}.{key}"
                assert name in told, f"{modality} key '{name}' must be in observation"
                value = told[name]
                assert value.ndim == ndim + axes and value.dtype == kind, name
                assert value.shape[axes] == len(config["delta_indices"]), name


DIALECTS: dict[str, tuple[Callable[..., Any], str, str]] = {
    "go1": (Go1, "http", ""),
    "gr00t": (Gr00t, "zmq", ""),
    "oft": (Oft, "http", ""),
    "openpi": (OpenPi, "socket", ""),
    "xpolicylab": (XPolicyLab, "socket", ""),
    "vla-eval": (VlaEval, "socket", ""),
    "robotwin": (RoboTwin, "tcp", ""),
    "xvla": (lambda *args: XVla(*args, proprio=14), "http", "?space=joint"),
}
"""Stand-ins whose model answers (T, 14), how they frame messages, and the query they need."""


@contextlib.contextmanager
def talking(server: Any, query: str = "", timeouts: Timeouts = QUICK, **options: Any) -> Any:
    """A client of ours to `server`, as long as that listens."""
    with server as url, connect(url + query, timeouts=timeouts, options=options) as policy:
        yield policy


def answered(server: Any, query: str = "", **options: Any) -> Any:
    """The chunk that our client gets of `server` to its first question of a trial."""
    with talking(server, query, **options) as policy:
        policy.reset(TRIAL)
        return policy.infer(observation())


def first_request(server: Any, query: str = "") -> Any:
    """What our client sends `server` first in a trial; `query` has its options."""
    answered(server, query)
    return server.requests[0]
