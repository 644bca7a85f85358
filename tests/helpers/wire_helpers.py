"""Policies, observations and a scripted server for the wire's tests."""

import contextlib
import socket
import ssl
import subprocess
import threading
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from websockets.sync.client import ClientConnection
from websockets.sync.client import connect as open_websocket
from websockets.sync.server import serve
from websockets.typing import Subprotocol

from robospa.observation import CameraSpec, Observation
from robospa.protocol.client import connect
from robospa.protocol.messages import SUBPROTOCOL, Hello, Message, pack, unpack
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.protocol.transport import Address, Timeouts, Transport

CAMERA = CameraSpec("head", 8, 6)
SPEC = PolicySpec("test", cameras=(CAMERA,), horizon=4, action_dim=14)
TRIAL = TrialInfo("pick_blocks_size", "aloha-agilex", "pick it", 7)
QUICK = Timeouts(connect=10, hello=10, reset=10, first_infer=10, infer=10, end=10, close=0.2)


class Recall:
    """Answers the step of the observation in every number; remembers its trials."""

    def __init__(self, spec: PolicySpec = SPEC, answer: Any = None) -> None:
        self.spec, self.answer = spec, answer
        self.trials: list[TrialInfo] = []
        self.seen: list[Observation] = []
        self.outcomes: list[Any] = []
        self.fail_reset = 0
        self.fail_infer = 0

    def reset(self, trial: TrialInfo) -> None:
        if self.fail_reset:
            self.fail_reset -= 1
            raise RuntimeError("the checkpoint is not loaded yet\nsecond line")
        self.trials.append(trial)

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        if self.fail_infer:
            self.fail_infer -= 1
            raise RuntimeError("CUDA error: device lost")
        self.seen.append(observation)
        if self.answer is not None:
            found: NDArray[np.float32] = self.answer
            return found
        return np.full((2, 14), observation["step"], np.float32)

    def end(self, outcome: Any) -> None:
        self.outcomes.append(outcome)


class Together(Recall):
    """Answers batches; waits for `open` before each call, so that a test decides what gathers."""

    def __init__(self, size: int = 8) -> None:
        super().__init__(PolicySpec("together", cameras=(), state="none", horizon=4, batch=size))
        self.open = threading.Event()
        self.started = threading.Event()
        self.batches: list[list[int]] = []

    def infer_batch(
        self, observations: Sequence[Observation], sessions: Sequence[int]
    ) -> list[NDArray[np.float32]]:
        self.batches.append([o["step"] for o in observations])
        self.started.set()
        assert self.open.wait(20)
        return [np.full((1, 14), o["step"], np.float32) for o in observations]


def observation(step: int = 0, **changes: Any) -> dict[str, Any]:
    """What SPEC asks for."""
    image = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)
    seen = {
        "images": {"head": image},
        "state": np.arange(14, dtype=np.float32),
        "ee": np.zeros((2, 8), np.float32),
        "instruction": "pick it",
        "step": step,
    }
    return {**seen, **changes}


@contextlib.contextmanager
def serving(server: Any) -> Iterator[None]:
    """Until the end a server with `serve_forever` and `shutdown` listens."""
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield
    finally:
        server.shutdown()
        thread.join(5)
        if hasattr(server, "server_close"):
            server.server_close()


@contextlib.contextmanager
def scripted(greeting: Any, answers: Sequence[Any] = ()) -> Iterator[str]:
    """A server that sends prepared frames: each of `answers` is a frame, or a function of the
    request's bytes. `greeting` is sent first. Frames of type str go out as text."""

    def handler(peer: Any) -> None:
        if greeting is not None:
            peer.send(greeting)
        for answer in answers:
            request = peer.recv()
            frame = answer(request) if callable(answer) else answer
            if frame is None:
                return
            peer.send(frame)
        with contextlib.suppress(Exception):
            peer.recv()

    server = serve(
        handler,
        "127.0.0.1",
        0,
        select_subprotocol=lambda _, offered: offered[0] if offered else None,
        compression=None,
        max_size=None,
        max_queue=1,
        close_timeout=0.2,
    )
    with serving(server):
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"


def self_signed(tmp_path: Path) -> tuple[ssl.SSLContext, ssl.SSLContext]:
    """TLS of a server with a certificate of its own, and of a client that trusts it."""
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    command = [
        *("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1"),
        *("-subj", "/CN=localhost", "-addext", "subjectAltName=IP:127.0.0.1"),
        *("-keyout", str(key), "-out", str(certificate)),
    ]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=60)
    except FileNotFoundError:
        pytest.skip("openssl is not installed")
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(certificate, key)
    return server, ssl.create_default_context(cafile=certificate)


HELLO = pack(Hello(0, "1.1", "scripted", SPEC))


def answer(make: Any) -> Any:
    """A frame for `scripted` from a function of the request's id."""
    return lambda request: pack(make(unpack(request).id))


@contextlib.contextmanager
def begun(server: Any) -> Iterator[Any]:
    """A client of ours whose trial has begun."""
    with connect(server.url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
        yield remote


def raw(url: str) -> Transport:
    """A connection past the hello."""
    transport = Transport(Address(url), QUICK)
    transport.receive(10, "hello")
    return transport


@contextlib.contextmanager
def websocket(url: str) -> Iterator[ClientConnection]:
    """A connection of the websockets package, past the hello: it can send what we never would."""
    with open_websocket(
        url, subprotocols=[Subprotocol(SUBPROTOCOL)], compression=None, close_timeout=0.2
    ) as connection:
        connection.recv(10)
        yield connection


def ask(transport: Transport, frame: bytes) -> Message:
    transport.send(frame)
    data = transport.receive(10, "answer")
    assert isinstance(data, bytes)
    return unpack(data)


@contextlib.contextmanager
def port_that(serve: Callable[[socket.socket], None]) -> Iterator[str]:
    """A port whose first client is given to `serve`, in a thread."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def first() -> None:
            with contextlib.suppress(OSError), server.accept()[0] as peer:
                serve(peer)

        thread = threading.Thread(target=first, daemon=True)
        thread.start()
        yield f"ws://127.0.0.1:{server.getsockname()[1]}"
    thread.join(10)


@contextlib.contextmanager
def allocating_less_than(size: int) -> Iterator[None]:
    """At no time in the block has it allocated `size` bytes."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < size
    finally:
        tracemalloc.stop()


def until(condition: Any) -> None:
    """Return as soon as `condition()` holds."""
    while not condition():
        threading.Event().wait(0.005)
