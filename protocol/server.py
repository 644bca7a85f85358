"""The policy server: several connections, one policy, inference off the event loop.

`serve(policy, host, port)` runs until it is interrupted; `ServerThread` is the same inside another
program. A client that offers `robospa.v1` gets it, one that offers nothing gets openpi's dialect,
one that offers another version of ours is refused. `GET /healthz` answers 200.

A token, if set, is required at the handshake (`Authorization: Bearer ...`, or `Api-Key ...` as
openpi's client sends it) and compared in constant time. Browsers are refused (no `Origin`). Without
TLS (`ssl`) tokens and frames travel in the clear.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import logging
import signal
import socket
import ssl as ssl_module
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from types import TracebackType
from typing import TYPE_CHECKING

from websockets.asyncio.server import Server, ServerConnection
from websockets.asyncio.server import serve as websocket_serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from robospa.protocol.codec import DEFAULT_LIMITS, Limits
from robospa.protocol.connection_limits import ConnectionLimiter, MonitoredConnection, keep_alive
from robospa.protocol.handler import ConnectionHandler, refuse
from robospa.protocol.memory import keep_freed_memory
from robospa.protocol.messages import SUBPROTOCOL
from robospa.protocol.policy import Policy
from robospa.protocol.policy_host import PolicyFactory, PolicyHost
from robospa.protocol.transport import SOCKET_BUFFER
from robospa.protocol.waiting import within

if TYPE_CHECKING:
    from typing_extensions import Self

log = logging.getLogger("robospa.server")
QUIET = logging.getLogger("robospa.server.websockets")
"""What the library has to say of strangers, with tracebacks; ours is one line each."""
QUIET.setLevel(logging.CRITICAL)
LAST_WORDS = 0.1
"""[s] in which a session whose connection is gone may end by itself."""


@dataclass(frozen=True)
class ServerOptions:
    """Bounds of one server. `idle`: seconds of silence after which a connection is closed.
    `patience`: seconds that a new connection waits for a free place. `message`: seconds within
    which a message has to be whole and an answer read. `handshakes`: connections that may be
    entering at once, within `handshake` seconds. `queue`: requests that may wait. `threads`: how
    many threads call policies (more than one only if they allow it)."""

    max_connections: int = 256
    queue: int = 256
    threads: int = 1
    idle: float = 3600.0
    patience: float = 2.0
    message: float = 60.0
    handshakes: int = 128
    handshake: float = 10.0
    name: str = "robospa"
    limits: Limits = field(default_factory=lambda: DEFAULT_LIMITS)


class PolicyServer:
    """An async context manager around one listening socket. See `serve` for the arguments."""

    def __init__(
        self,
        policy: Policy | None = None,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        *,
        policy_factory: PolicyFactory | None = None,
        ssl: ssl_module.SSLContext | None = None,
        options: ServerOptions | None = None,
    ) -> None:
        self._options = options or ServerOptions()
        self._policies = PolicyHost(
            policy,
            policy_factory,
            threads=self._options.threads,
            queue=self._options.queue,
        )
        self._address, self._token, self._ssl = (host, port), token, ssl
        most = self._options.max_connections
        self._limiter = ConnectionLimiter(
            min(most, self._policies.max_sessions or most),
            patience=self._options.patience,
            handshakes=self._options.handshakes,
            message=self._options.message,
        )
        self._server: Server | None = None

    @property
    def url(self) -> str:
        """Where to connect; the real port also when 0 was asked for."""
        assert self._server is not None, "the server is not running"
        host, port = next(iter(self._server.sockets)).getsockname()[:2]
        scheme = "ws" if self._ssl is None else "wss"
        return f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}"

    async def __aenter__(self) -> Self:
        keep_freed_memory()
        self._server = await websocket_serve(
            self._handle,
            *self._address,
            ssl=self._ssl,
            origins=[None],
            select_subprotocol=_select,
            process_request=self._admit,
            create_connection=self._limiter.connection,
            server_header=None,
            logger=QUIET,
            compression=None,
            max_size=self._options.limits.message,
            max_queue=2,  # frames that may wait while one request is served
            write_limit=2**20,
            ping_interval=None,
            open_timeout=self._options.handshake + self._options.patience,
            close_timeout=1,
        )
        for listener in self._server.sockets:
            _tune(listener)
        self._limiter.start()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        assert self._server is not None
        self._server.close()
        with contextlib.suppress(TimeoutError):
            await within(1, self._server.wait_closed())
        self._limiter.stop()
        self._policies.close()

    async def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """None to go on with the handshake, else the HTTP answer."""
        if request.path == "/healthz":
            return connection.respond(HTTPStatus.OK, "OK\n")
        if not _authorized(self._token, request):
            self._limiter.tell("a client was refused: its token is missing or wrong")
            return connection.respond(HTTPStatus.UNAUTHORIZED, "missing or wrong token\n")
        offered = ",".join(request.headers.get_all("Sec-WebSocket-Protocol"))
        names = [name.strip() for name in offered.split(",")]
        if SUBPROTOCOL not in names and any(name.startswith("robospa.") for name in names):
            text = f"this server speaks {SUBPROTOCOL}, not {offered[:100]}\n"
            return connection.respond(HTTPStatus.BAD_REQUEST, text)
        if "Upgrade" not in request.headers:
            text = "a policy server, for WebSocket connections only (RoboSPA)\n"
            return connection.respond(HTTPStatus.UPGRADE_REQUIRED, text)
        assert isinstance(connection, MonitoredConnection)
        if not await self._limiter.seat(connection):
            text = f"all {self._limiter.places} places of this server are taken\n"
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, text)
        return None

    async def _handle(self, connection: ServerConnection) -> None:
        assert isinstance(connection, MonitoredConnection)
        self._limiter.entered(connection)
        talk = asyncio.ensure_future(self._converse(connection))
        gone = asyncio.ensure_future(connection.wait_closed())
        try:
            # A model that hangs must not keep the place of a client that has gone.
            await asyncio.wait((talk, gone), return_when=asyncio.FIRST_COMPLETED)
            await asyncio.wait((talk,), timeout=0 if talk.done() else LAST_WORDS)
            if talk.done():
                await talk
        except ConnectionClosed:
            pass
        except TimeoutError:
            log.warning("closing a connection that was silent for %g s", self._options.idle)
        except Exception:
            log.exception("the session with %s failed", connection.client)
        finally:
            talk.cancel()
            gone.cancel()
            self._limiter.left(connection)

    async def _converse(self, connection: MonitoredConnection) -> None:
        options, ours = self._options, connection.subprotocol == SUBPROTOCOL
        try:
            policy = await self._policies.open()
        except Exception as error:
            log.exception("no policy could be made for a new connection")
            return await refuse(connection, ours, error)
        connection.on_begin = policy.coming
        try:
            session = ConnectionHandler(
                connection, policy, self._policies.spec, options.name, options.limits, options.idle
            )
            await (session.run() if ours else session.run_openpi())
        finally:
            policy.close()


def _select(connection: ServerConnection, offered: Sequence[Subprotocol]) -> Subprotocol | None:
    return Subprotocol(SUBPROTOCOL) if SUBPROTOCOL in offered else None


def _authorized(token: str | None, request: Request) -> bool:
    if token is None:
        return True
    headers = request.headers.get_all("Authorization")
    kind, _, given = (headers[0] if len(headers) == 1 else "").partition(" ")
    same = hmac.compare_digest(given.strip().encode(errors="surrogateescape"), token.encode())
    return same and kind.lower() in ("bearer", "api-key")


def _tune(listener: socket.socket) -> None:
    """Accepted sockets inherit these: room for a whole observation, and the kernel notices a
    client whose machine is gone."""
    for option in (socket.SO_RCVBUF, socket.SO_SNDBUF):
        listener.setsockopt(socket.SOL_SOCKET, option, SOCKET_BUFFER)
    keep_alive(listener)


def serve(
    policy: Policy | None = None,
    host: str = "127.0.0.1",
    port: int = 8000,
    token: str | None = None,
    *,
    policy_factory: PolicyFactory | None = None,
    ssl: ssl_module.SSLContext | None = None,
    options: ServerOptions | None = None,
    on_ready: Callable[[str], None] | None = None,
) -> None:
    """Serve until SIGINT or SIGTERM. Give a policy or a factory (`robospa.protocol.policy_host`).

    `on_ready` is called with the URL once clients can connect. Raises OSError if the port is taken.
    """
    server = PolicyServer(
        policy, host, port, token, policy_factory=policy_factory, ssl=ssl, options=options
    )
    if token is None and host not in ("127.0.0.1", "localhost", "::1"):
        log.warning("listening on %s without a token: anybody who reaches it can use it", host)

    async def main() -> None:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        for name in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(name, stop.set)
        async with server:
            if on_ready is not None:
                on_ready(server.url)
            await stop.wait()

    asyncio.run(main())


class ServerThread:
    """A policy server in a background thread: `with ServerThread(policy) as server: server.url`.

    Takes the arguments of `PolicyServer`; the port is chosen freely unless given.
    """

    def __init__(
        self,
        policy: Policy | None = None,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        *,
        policy_factory: PolicyFactory | None = None,
        ssl: ssl_module.SSLContext | None = None,
        options: ServerOptions | None = None,
    ) -> None:
        self._server = PolicyServer(
            policy, host, port, token, policy_factory=policy_factory, ssl=ssl, options=options
        )
        self._thread = threading.Thread(target=self._main, name="robospa-server", daemon=True)
        self._ready = threading.Event()
        self._failure: BaseException | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        self.url = ""

    def start(self) -> Self:
        """Returns when clients can connect. Raises OSError if the port is taken."""
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            raise self._failure
        return self

    def stop(self) -> None:
        """Close all connections and the port."""
        if self._loop is not None and self._stop is not None and self._thread.is_alive():
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(10)

    def _main(self) -> None:
        try:
            asyncio.run(self._run())
        except BaseException as error:
            self._failure = error
        finally:
            self._ready.set()

    async def _run(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        async with self._server:
            self.url = self._server.url
            self._ready.set()
            await self._stop.wait()

    __enter__ = start

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
