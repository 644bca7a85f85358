"""What every stand-in server shares, and those over HTTP; the observation that each is shown."""

import base64
import contextlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
from wire_helpers import serving

from robospa.protocol.policy import TrialInfo

TRIAL = TrialInfo("Pick_Blocks_Size", "aloha-agilex", "pick the red block", 7, "5eed")
HEAD, LEFT, RIGHT = "head", "left_wrist", "right_wrist"


def image(name: str) -> Any:
    """An image whose every axis and colour can be told apart, another one for each camera."""
    rows, columns = np.indices((240, 320))
    offset = {HEAD: 0, LEFT: 80, RIGHT: 160}[name]
    colors = [rows % 80 + offset, columns % 80 + offset, np.full((240, 320), offset + 79)]
    return np.stack(colors, axis=-1).astype(np.uint8)


def shows(found: Any, *names: str) -> None:
    """`found` has under these names what head, left and right wrist see, uint8 and unchanged."""
    for theirs, ours in zip(names, (HEAD, LEFT, RIGHT), strict=True):
        assert found[theirs].dtype == np.uint8
        assert np.array_equal(found[theirs], image(ours))


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
