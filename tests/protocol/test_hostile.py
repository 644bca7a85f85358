"""Who is let in, and that whatever a client does, it harms only itself."""

import base64
import contextlib
import http.client
import logging
import os
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from run_fakes import FakePolicy
from websockets.datastructures import Headers
from websockets.exceptions import InvalidStatus
from websockets.http11 import Request, Response
from websockets.sync.client import connect as open_socket
from websockets.sync.server import serve
from websockets.typing import Origin
from wire_helpers import (
    QUICK,
    TRIAL,
    Recall,
    allocating_less_than,
    observation,
    raw,
    self_signed,
    serving,
    until,
)

from robospa.clients import connect
from robospa.protocol.client import connect as connect_ours
from robospa.protocol.codec import encode
from robospa.protocol.connection_limits import FRAMES, ServerOptions
from robospa.protocol.errors import (
    ConnectFailed,
    ConnectionLost,
    HandshakeError,
    TransportError,
    Unauthorized,
)
from robospa.protocol.messages import Infer, Reset, pack
from robospa.protocol.server import ServerThread
from robospa.protocol.transport import Address, _moved

KEY = base64.b64encode(b"0123456789abcdef").decode()
HANDSHAKE = (
    "GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    f"Sec-WebSocket-Key: {KEY}\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Protocol: robospa.v1\r\n\r\n"
).encode()
HURRIED = ServerOptions(message=0.2, patience=2.0)


def frame(payload: bytes, opcode: int = 2, fin: bool = True, size: int | None = None) -> bytes:
    """A client's frame (mask of zeros); `size`: what it claims to hold."""
    length = len(payload) if size is None else size
    first = (0x80 if fin else 0) | opcode
    if length < 126:
        head = struct.pack(">BB", first, 0x80 | length)
    else:
        head = struct.pack(">BBQ", first, 0x80 | 127, length)
    return head + bytes(4) + payload


@pytest.fixture
def dial() -> Iterator[Callable[..., socket.socket]]:
    """Plain sockets to a server, closed with the test; `data` is sent at once."""
    with ExitStack() as stack:

        def dialled(server: ServerThread, data: bytes = b"") -> socket.socket:
            port = int(server.url.rsplit(":", 1)[1])
            sock = stack.enter_context(socket.create_connection(("127.0.0.1", port), 20))
            sock.sendall(data)
            return sock

        yield dialled


def ended(sock: socket.socket, data: bytes = b"") -> bytes:
    """What came after `data` until the server closed, which may be before it has read all."""
    parts = []
    with contextlib.suppress(ConnectionError):
        sock.sendall(data)
        while part := sock.recv(65536):
            parts.append(part)
    return b"".join(parts)


def served(server: ServerThread, token: str | None = None) -> bool:
    """Whether a real client gets its answer."""
    with connect(server.url, token, QUICK) as remote:
        remote.reset(TRIAL)
        return bool(remote.infer(observation(3))[0, 0] == 3)


def greeted(dial: Any, server: ServerThread) -> socket.socket:
    """A socket past the handshake and the hello."""
    sock: socket.socket = dial(server, HANDSHAKE)
    while b"hello" not in sock.recv(65536):
        pass
    return sock


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", b""),
        (bytes(range(256)) * 40, b""),
        (b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", b"426"),
        (b"GET /../../etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n", b"426"),
        (b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999\r\n\r\n", b""),
        (b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n\r\n", b""),
        (b"GET / HTTP/1.1\r\n" + b"X-Long: " + b"a" * 100_000 + b"\r\n\r\n", b""),
        (b"GET / HTTP/1.1\r\n" + b"X-Many: 1\r\n" * 5_000 + b"\r\n", b""),
        (HANDSHAKE.replace(b"13", b"7"), b"400"),
        (HANDSHAKE.replace(KEY.encode(), b"short"), b"400"),
        (HANDSHAKE.replace(b"robospa.v1", b"robospa.v7"), b"400"),
    ],
)
def test_what_is_no_handshake_is_refused(
    start: Any, dial: Any, request_: bytes, status: bytes
) -> None:
    server = start(policy_factory=Recall)
    said = ended(dial(server), request_)
    assert status in said.split(b"\r\n")[0]
    assert b"Traceback" not in said and b"python" not in said.lower() and b"root:" not in said
    assert served(server)


def test_strangers_learn_nothing_and_are_refused_first(start: Any, dial: Any) -> None:
    server = start(policy_factory=Recall, token="s3cret")
    said = [
        ended(dial(server, request))
        for request in (
            HANDSHAKE,
            HANDSHAKE.replace(b"\r\n\r\n", b"\r\nAuthorization: Bearer s3cre\r\n\r\n"),
            HANDSHAKE.replace(b"\r\n\r\n", b"\r\nAuthorization: Bearer \xff\xfe\r\n\r\n"),
            HANDSHAKE.replace(b"\r\n\r\n", b"\r\nAuthorization: Bearer s3cret" * 2 + b"\r\n\r\n"),
            HANDSHAKE.replace(b"robospa.v1", b"robospa.v9"),
            b"GET /anything HTTP/1.1\r\nHost: x\r\n\r\n",
        )
    ]
    answers = {tuple(ln for ln in s.split(b"\r\n") if not ln.startswith(b"Date")) for s in said}
    assert len(answers) == 1, "every refusal is the same"
    assert said[0].startswith(b"HTTP/1.1 401") and b"s3cret" not in said[0]
    assert b"Server:" not in said[0] and b"robospa.v1" not in said[0]
    assert served(server, "s3cret")


def test_a_handshake_that_is_never_finished_ends(start: Any, dial: Any) -> None:
    server = start(policy_factory=Recall, options=ServerOptions(handshake=0.2, patience=0.1))
    slow = [dial(server), dial(server, HANDSHAKE[:40])]
    assert [ended(sock) for sock in slow] == [b"", b""]
    assert served(server)


def test_of_many_handshakes_the_oldest_are_dropped(start: Any, dial: Any) -> None:
    server = start(policy_factory=Recall, options=ServerOptions(handshakes=10))
    idle = [dial(server) for _ in range(30)]
    assert served(server)
    assert ended(idle[0]) == b""


def test_without_file_descriptors_it_waits_and_says_so(
    start: Any, dial: Any, caplog: pytest.LogCaptureFixture
) -> None:
    import resource

    server = start(policy_factory=Recall)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    first = dial(server)
    spare = max(int(name) for name in os.listdir("/proc/self/fd")) + 1
    late = socket.socket()  # made before, connected after nothing is left
    resource.setrlimit(resource.RLIMIT_NOFILE, (spare, hard))
    try:
        held = []
        with contextlib.suppress(OSError):
            while True:
                held.append(os.dup(0))
        late.connect(first.getpeername())
        until(lambda: "cannot be accepted" in caplog.text)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        for number in held:
            os.close(number)
        late.close()
    assert "ulimit -n" in caplog.text
    assert served(server)


@pytest.mark.parametrize(
    "begun", [frame(pack(Reset(1, TRIAL)))[:3], frame(b"abc", fin=False)], ids=["bytes", "fragment"]
)
def test_a_message_that_is_never_complete(start: Any, dial: Any, begun: bytes) -> None:
    server = start(policy_factory=Recall, options=HURRIED)
    sock = greeted(dial, server)
    sock.sendall(begun)
    assert served(server)
    ended(sock)  # comes back because the server gives up


def test_a_long_inference_is_no_slow_client(start: Any) -> None:
    class Slow(Recall):
        def infer(self, seen: Any) -> Any:
            time.sleep(0.3)
            return super().infer(seen)

    server = start(policy_factory=Slow, options=HURRIED)
    transport = raw(server.url)
    transport.send(pack(Reset(1, TRIAL)))
    for id in range(2, 5):  # more than the server reads ahead
        transport.send(pack(Infer(id, observation(id))))
    for _ in range(4):
        transport.receive(10, "answer")
    transport.close()


def test_who_never_reads_its_answers_is_not_read_either(start: Any, dial: Any) -> None:
    server = start(policy_factory=Recall, options=HURRIED)
    sock = greeted(dial, server)
    sock.settimeout(0.05)
    pings = b"".join(frame(b"x" * 125, 9) for _ in range(2000)) + frame(encode({"id": 0}))
    sent = 0
    with contextlib.suppress(TimeoutError, ConnectionError):
        for _ in range(300):
            sent += sock.send(frame(pack(Reset(sent + 1, TRIAL))) + pings)
    assert sent < 100_000_000
    sock.settimeout(20)
    assert served(server)
    ended(sock)


@pytest.mark.parametrize("opcode", [0, 9, 10])
def test_floods_of_small_frames_end_the_connection(start: Any, dial: Any, opcode: int) -> None:
    server = start(policy_factory=Recall)
    sock = greeted(dial, server)
    opening = frame(b"a", fin=False) if opcode == 0 else b""
    ended(sock, opening + frame(b"", opcode, fin=opcode != 0) * (FRAMES + 10))
    assert served(server)


@pytest.mark.parametrize("claim", [2**63 - 1, 2**40, 65 * 2**20])
def test_a_frame_that_claims_too_much_allocates_nothing(start: Any, dial: Any, claim: int) -> None:
    server = start(policy_factory=Recall)
    sock = greeted(dial, server)
    with allocating_less_than(4_000_000):
        said = ended(sock, frame(b"start", size=claim))
    assert struct.pack(">H", 1009) in said
    assert served(server)


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (frame(b"\x91" * 100_000 + b"\xc0"), 1007),
        (frame(b"\xdf\xff\xff\xff\xff" + b"\x81" * 60), 1007),
        (frame(b"hello", 1), 1003),
        (frame(b"\xff\xfe", 1), 1007),
        (frame(b"x", 3), 1002),
        (frame(b"x" * 200, 9), 1002),
        (b"\x82\x05plain", 1002),
    ],
)
def test_frames_that_are_no_message_are_told_why(
    start: Any, dial: Any, data: bytes, code: int
) -> None:
    server = start(policy_factory=Recall)
    assert struct.pack(">H", code) in ended(greeted(dial, server), data)
    assert served(server)


@pytest.mark.parametrize("cut", [1, 5, 30])
def test_a_message_that_is_cut_off_frees_the_place(start: Any, dial: Any, cut: int) -> None:
    server = start(Recall())  # one place
    sock = greeted(dial, server)
    sock.sendall(frame(pack(Reset(1, TRIAL)))[:-cut])
    sock.close()
    assert served(server)


def test_a_model_that_hangs_does_not_keep_the_places_of_those_who_left(start: Any) -> None:
    hung = threading.Event()

    class Hangs(Recall):
        spec = replace(Recall().spec, batch=1)

        def infer_batch(self, seen: Any, sessions: Any) -> Any:
            hung.wait(20)
            return [self.infer(one) for one in seen]

    server = start(Hangs(), options=ServerOptions(max_connections=2))
    for _ in range(4):
        transport = raw(server.url)
        transport.send(pack(Reset(1, TRIAL)))
        transport.send(pack(Infer(2, observation())))
        transport.close()
    until(lambda: not server._limiter._sessions)
    hung.set()
    assert served(server)


def test_who_never_asks_gives_way(start: Any, caplog: pytest.LogCaptureFixture) -> None:
    server = start(policy_factory=Recall, options=ServerOptions(max_connections=2))
    busy = connect(server.url, timeouts=QUICK)
    busy.reset(TRIAL)
    idle = raw(server.url)
    assert served(server)
    with pytest.raises(ConnectionLost):
        idle.receive(10, "nothing")
    busy.infer(observation())
    busy.close()
    assert "its place is needed" in caplog.text


def test_a_crowd_that_asks_keeps_its_places(start: Any) -> None:
    options = ServerOptions(max_connections=2, patience=1.3)
    server = start(policy_factory=Recall, options=options)
    with connect(server.url, timeouts=QUICK) as one, connect(server.url, timeouts=QUICK) as two:
        one.reset(TRIAL)
        two.reset(TRIAL)
        with pytest.raises(TransportError, match="all 2 places"):
            connect_ours(server.url, timeouts=QUICK)


def test_the_log_is_one_line_a_fault(
    start: Any, dial: Any, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    server = start(policy_factory=Recall, token="s3cret")
    for _ in range(20):
        ended(dial(server, HANDSHAKE))
        ended(dial(server, b"nonsense\r\n\r\n"))
    assert caplog.text.count("\n") == 1 and "token is missing or wrong" in caplog.text


@pytest.mark.parametrize("fin", [True, False])
def test_unfinished_messages_have_a_limit_together(
    start: Any, dial: Callable[..., socket.socket], caplog: pytest.LogCaptureFixture, fin: bool
) -> None:
    """In one frame that is announced larger, or in fragments; the largest is dropped."""
    server = start(policy_factory=Recall, options=ServerOptions(unfinished=1_000_000))

    def unfinished(size: int) -> socket.socket:
        sock = dial(server, HANDSHAKE)
        assert sock.recv(1)
        payload = bytes(size)
        sock.sendall(frame(payload, size=size + 1) if fin else frame(payload, fin=False))
        return sock

    held = [unfinished(size) for size in (300_000, 400_000, 200_000)]
    until(lambda: server._limiter._held >= 900_000)
    assert "unfinished message" not in caplog.text
    unfinished(250_000)
    until(lambda: "its unfinished message has 400" in caplog.text)
    ended(held[1])
    assert server._limiter._held <= 1_000_000
    for sock in held:
        sock.close()
    until(lambda: server._limiter._held < 400_000)


def test_the_token_is_needed(start: Any) -> None:
    url = start(policy_factory=Recall, token="s3cret").url
    connect(url, token="s3cret", timeouts=QUICK).close()
    for token in (None, "", "wrong", "s3cret2"):
        with pytest.raises(Unauthorized, match="missing or wrong token"):
            connect(url, token=token, timeouts=QUICK)


def test_browsers_are_refused(start: Any) -> None:
    url = start(Recall()).url
    with pytest.raises(InvalidStatus), open_socket(url, origin=Origin("https://example.org")):
        pass


def test_health(start: Any) -> None:
    port = int(start(Recall(), token="s3cret").url.rsplit(":", 1)[1])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request("GET", "/healthz")
    response = connection.getresponse()
    assert (response.status, response.read()) == (200, b"OK\n")
    connection.close()


def test_a_taken_port_is_an_error(start: Any) -> None:
    port = int(start(Recall()).url.rsplit(":", 1)[1])
    with pytest.raises(OSError, match="address already in use"):
        ServerThread(Recall(), port=port).start()


def test_tls(start: Any, tmp_path: Path) -> None:
    inside, trust = self_signed(tmp_path)
    url = start(policy_factory=Recall, ssl=inside, token="s3cret").url
    assert url.startswith("wss://")
    with connect(url, token="s3cret", timeouts=QUICK, ssl=trust) as remote:
        remote.reset(TRIAL)
        assert remote.infer(observation(1))[0, 0] == 1
    with pytest.raises(ConnectFailed, match=r"self-signed.*SSL_CERT_FILE"):
        connect(url, token="s3cret", timeouts=QUICK)
    with pytest.raises(HandshakeError, match=f"speaks TLS: use {url}"):
        connect(url.replace("wss:", "ws:"), timeouts=QUICK)
    plain = start(policy_factory=Recall).url
    with pytest.raises(ConnectFailed, match=f"no TLS is spoken there.*try {plain}"):
        connect(plain.replace("ws:", "wss:"), timeouts=QUICK)


@contextmanager
def redirecting(location: str) -> Iterator[tuple[str, list[Request]]]:
    """A WebSocket server that sends everybody to `location`; its URL, and what it was asked."""
    asked: list[Request] = []

    def answer(connection: Any, request: Request) -> Response:
        asked.append(request)
        return Response(302, "Found", Headers({"Location": location, "Content-Length": "0"}), b"")

    server = serve(lambda connection: None, "127.0.0.1", 0, process_request=answer)
    with serving(server):
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}", asked


def test_another_host_is_not_followed_and_gets_no_token() -> None:
    with ServerThread(FakePolicy(), token="secret") as other:
        target = other.url.replace("127.0.0.1", "localhost")
        with (
            redirecting(target) as (url, _),
            pytest.raises(HandshakeError, match=r"redirects to ws://localhost:.*not followed"),
        ):
            connect(url, "secret", QUICK)
        assert not other._limiter._sessions


def test_another_address_of_the_same_host_is_followed_and_recorded() -> None:
    with ServerThread(FakePolicy()) as other, redirecting(other.url) as (url, asked):
        with connect(url, timeouts=QUICK) as policy:
            assert policy.hello["redirected_to"] == other.url
            policy.reconnect()
        assert len(asked) == 2
    with ServerThread(FakePolicy()) as server, connect(server.url, timeouts=QUICK) as policy:
        assert "redirected_to" not in policy.hello


def test_a_circle_ends() -> None:
    with redirecting("/again") as (url, asked), pytest.raises(HandshakeError, match="for ever"):
        connect_ours(url, timeouts=QUICK)
    assert 1 < len(asked) < 6


@pytest.mark.parametrize(
    ("url", "location", "target"),
    [
        ("ws://gpu:8000", "/v2", "ws://gpu:8000/v2"),
        ("ws://gpu:8000", "https://gpu/v2", "wss://gpu/v2"),
        ("ws://gpu:8000", "wss://GPU:8443", "wss://GPU:8443"),
        ("wss://gpu", "wss://gpu:1/", "wss://gpu:1/"),
        ("wss://gpu", "ws://gpu", None),
        ("ws://gpu", "wss://gpu.evil.org", None),
        ("ws://gpu", "wss://gpu@evil.org", None),
        ("ws://gpu", "//evil.org/", None),
        ("ws://gpu", "file:///etc/passwd", None),
        ("ws://gpu", "", None),
    ],
)
def test_where_a_redirect_may_lead(url: str, location: str, target: str | None) -> None:
    if target is None:
        with pytest.raises(HandshakeError, match="redirects to"):
            _moved(Address(url), location)
    else:
        assert _moved(Address(url, "token"), location) == Address(target, "token")
