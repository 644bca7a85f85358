"""What every stand-in server shares, and the observation that each of them is shown."""

import base64
import contextlib
import io
import json
import socketserver
import struct
import threading
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, ClassVar

import msgpack
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve
from wire_helpers import QUICK, serving

from robospa.clients import connect
from robospa.protocol.policy import TrialInfo
from robospa.protocol.transport import Timeouts

TRIAL = TrialInfo("Pick_Blocks_Size", "aloha-agilex", "pick the red block", 7, "5eed")
HEAD, LEFT, RIGHT = "head", "left_wrist", "right_wrist"


def image(name: str) -> Any:
    """An image whose every axis and colour can be told apart, another one for each camera."""
    rows, columns = np.indices((240, 320))
    offset = {HEAD: 0, LEFT: 80, RIGHT: 160}[name]
    colors = [rows % 80 + offset, columns % 80 + offset, np.full((240, 320), offset + 79)]
    return np.stack(colors, axis=-1).astype(np.uint8)


STATE = np.array(
    [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.25, -0.1, -0.2, -0.3, -0.4, -0.5, -0.6, 0.75], np.float32
)
EE = np.array(
    [
        [-0.3, -0.2, 0.9, 0.5, 0.5, -0.5, 0.5, 0.25],
        [0.31, 0.11, 1.1, np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5), 0.75],
    ],
    np.float32,
)


def observation(step: int = 0, **changes: Any) -> dict[str, Any]:
    """What a world shows; every number is found once only."""
    seen = {
        "images": {name: image(name) for name in (HEAD, LEFT, RIGHT)},
        "state": STATE.copy(),
        "ee": EE.copy(),
        "instruction": "pick the red block",
        "step": step,
    }
    return {**seen, **changes}


def joint_chunk(length: int = 3) -> Any:
    """(T, 14) in which every number is another one."""
    return np.arange(length * 14, dtype=np.float64).reshape(length, 14) / 1000


class StandIn:
    """What all of them have; subclasses say how to listen."""

    scheme = ""

    def __init__(self, model: Callable[[Any], Any] | None = None, instead: Any = None) -> None:
        self.model = model or (lambda request: joint_chunk())
        self.instead = instead
        self.extra: dict[str, Any] = {}
        self.requests: list[Any] = []
        self.port = 0
        self._over = contextlib.ExitStack()

    def _run(self, server: Any) -> None:
        self._over.enter_context(serving(server))

    def __enter__(self) -> str:
        self.listen()
        return f"{self.scheme}://127.0.0.1:{self.port}"

    def __exit__(self, *_: object) -> None:
        self._over.close()

    def listen(self) -> None:
        raise NotImplementedError


def array_object(value: Any) -> dict[str, Any]:
    """json_numpy's writing."""
    data = base64.b64encode(value.tobytes()).decode()
    return {"__numpy__": data, "dtype": value.dtype.str, "shape": list(value.shape)}


def json_numpy(value: Any) -> Any:
    """json_numpy's reading: an object with `__numpy__` is an array."""
    if isinstance(value, dict) and "__numpy__" in value:
        data = base64.b64decode(value["__numpy__"])
        return np.frombuffer(data, np.dtype(value["dtype"])).reshape(value["shape"])
    return value


@dataclass(frozen=True)
class Form:
    """The names under which a project writes an array; `coded`: its bytes are base64 text."""

    mark: Any
    data: Any
    dtype: Any
    shape: Any
    more: tuple[tuple[Any, Any], ...] = ()
    coded: bool = False

    def read(self, value: dict[Any, Any]) -> Any:
        if value.get(self.mark) is not True:
            return value
        data = value[self.data]
        raw = base64.b64decode(data) if self.coded else data
        return np.frombuffer(raw, np.dtype(value[self.dtype])).reshape(value[self.shape])

    def write(self, value: Any) -> Any:
        raw = value.tobytes()
        data = base64.b64encode(raw).decode() if self.coded else raw
        kind = str(value.dtype) if self.coded else value.dtype.str
        named = {self.data: data, self.dtype: kind, self.shape: list(value.shape)}
        return {self.mark: True, **dict(self.more), **named}


OPENPI = Form(b"__ndarray__", b"data", b"dtype", b"shape")
ND = Form(b"nd", b"data", b"type", b"shape", ((b"kind", b""),))
NAMED = Form("__ndarray__", "data", "dtype", "shape")
FRAMED = Form("__numpy_array__", "data", "dtype", "shape", coded=True)


# ---------------------------------------------------------------- HTTP


class Status(Exception):
    """An HTTP answer other than 200."""

    def __init__(self, status: int, body: Any) -> None:
        self.status, self.body = status, body


class Fast(StandIn):
    """The outside of a FastAPI application with one endpoint, POST /act."""

    def listen(self) -> None:
        outer = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"
            disable_nagle_algorithm = True  # else each answer waits 40 ms for the client's ACK

            def do_GET(self) -> None:
                if self.path == "/act":
                    self.answer(405, {"detail": "Method Not Allowed"})
                else:
                    self.answer(404, {"detail": "Not Found"})

            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                if self.path != "/act":
                    return self.answer(404, {"detail": "Not Found"})
                outer.content_type = self.headers.get("Content-Type")
                outer.authorization = self.headers.get("Authorization")
                try:
                    found = outer.act(body)
                except Status as status:
                    return self.answer(status.status, status.body)
                self.answer(200, found)

            def answer(self, status: int, body: Any) -> None:
                data = body if isinstance(body, bytes) else json.dumps(body).encode()
                self.send_response(status)
                self.send_header("Content-Length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, *_: object) -> None:
                return None

        server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        server.daemon_threads = True
        if self.tls is not None:
            server.socket = self.tls.wrap_socket(server.socket, server_side=True)
        self.port = server.server_port
        self._run(server)

    content_type: str | None = None
    authorization: str | None = None
    tls: Any = None

    def act(self, body: bytes) -> Any:
        raise NotImplementedError

    def said(self, seen: Any, write: Callable[[Any], Any]) -> Any:
        """The answer to an observation, as FastAPI writes it: NaN is a ValueError."""
        self.requests.append(seen)
        if self.instead is not None:
            return self.instead
        return json.dumps(write(self.model(seen)), allow_nan=False).encode()


class Go1(Fast):
    """GO-1's deploy.py: arrays nested in the body, any failure a bare 500."""

    scheme = "go1+http"

    def act(self, body: bytes) -> Any:
        try:
            seen = json.loads(body, object_hook=json_numpy)
            seen["state"].copy().shape, seen["ctrl_freqs"].copy().shape
            assert isinstance(seen["state"], np.ndarray), "a list has no shape"
            return self.said(seen, lambda rows: np.asarray(rows).tolist())
        except Exception as error:
            raise Status(500, b"Internal Server Error") from error


class Oft(Fast):
    """OpenVLA-OFT's deploy.py: arrays nested in the body, any failure a 200 and "error"."""

    scheme = "oft+http"

    def act(self, body: bytes) -> Any:
        try:
            seen = json.loads(body, object_hook=json_numpy)
            assert seen["full_image"].shape == (240, 320, 3) and seen["instruction"].lower()
            seen["wrists"] = [seen[name] for name in seen if "wrist" in name]
            return self.said(seen, lambda rows: [array_object(np.asarray(row)) for row in rows])
        except Exception:
            return "error"


class XVla(Fast):
    """X-VLA's deploy.py: arrays as texts, a domain id, any failure a 400 without a reason."""

    scheme = "xvla+http"

    def __init__(self, *args: Any, proprio: int = 20) -> None:
        super().__init__(*args)
        self.proprio = proprio

    def act(self, body: bytes) -> Any:
        try:
            told = json.loads(body)
        except ValueError as error:
            raise Status(422, {"detail": [{"msg": "JSON decode error"}]}) from error
        try:
            seen = {
                name: json.loads(value, object_hook=json_numpy)
                if name.startswith("image") or name == "proprio"
                else value
                for name, value in told.items()
            }
            if not any(name.startswith("image") for name in seen):
                raise Status(400, {"error": "No valid images found."})
            assert 0 <= seen["domain_id"] < 30
            assert seen["proprio"].dtype.kind == "f"
            assert seen["proprio"].shape == (self.proprio,)
            return self.said(seen, lambda rows: {"action": np.asarray(rows).tolist(), **self.extra})
        except Status:
            raise
        except Exception as error:
            raise Status(400, {"error": "Request failed"}) from error


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
