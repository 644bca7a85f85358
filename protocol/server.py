"""The policy server: several connections, one policy, inference off the event loop.

`serve(policy, host, port)` runs until it is interrupted; `ServerThread` is the same inside another
program. A client that offers `robospa.v1` gets it, one that offers nothing gets openpi's dialect,
one that offers another version of ours is refused. `GET /healthz` answers 200. A token, if set, is
required at the handshake (`Bearer ...`, or `Api-Key ...` as openpi's client sends it).
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import logging
import signal
import ssl as ssl_module
import threading
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field
from http import HTTPStatus
from typing import TYPE_CHECKING

from websockets.asyncio.server import Server, ServerConnection
from websockets.asyncio.server import serve as websocket_serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from robospa.protocol import errors, messages
from robospa.protocol.batching import QueueFull
from robospa.protocol.calls import check_calls
from robospa.protocol.codec import Limits, decode, decode_images
from robospa.protocol.connection_limits import ConnectionLimiter, MonitoredConnection, ServerOptions
from robospa.protocol.messages import SUBPROTOCOL, Error, Message
from robospa.protocol.openpi import serve_openpi
from robospa.protocol.policy import CALLED, Policy, PolicySpec, check_chunk, check_observation
from robospa.protocol.policy_host import PolicyFactory, PolicyHost, PolicySession
from robospa.protocol.transport import enlarge_buffers, keep_alive, keep_freed_memory

if TYPE_CHECKING:
    from typing_extensions import Self

log = logging.getLogger("robospa.server")
LIBRARY_LOG = logging.getLogger("robospa.server.websockets")
"""What websockets logs of clients, with tracebacks; ours is one line each."""
LIBRARY_LOG.setLevel(logging.CRITICAL)
OFFERED = Subprotocol(SUBPROTOCOL)
LAST_ANSWER = 0.1
"""[s] in which a handler whose connection is closed may return by itself."""


@dataclass
class ConnectionHandler:
    """Serves one connection in `robospa.v1` until it closes.

    Requests are answered strictly one after the other and each gets exactly one answer, so a failed
    reset can never shift the answers that follow. After an exception of the policy the trial is
    over: `infer` is refused until the next reset.
    """

    socket: MonitoredConnection
    policy: PolicySession
    spec: PolicySpec
    name: str
    limits: Limits
    _in_trial: bool = False
    _last_id: int = 0

    async def run(self) -> None:
        """Speak `robospa.v1`. Raises ConnectionClosed."""
        await self._send(messages.Hello(0, messages.VERSION, self.name, self.spec))
        while True:
            data = await self.socket.next_message()
            if isinstance(data, str):
                return await self._give_up(1003, "text frames do not exist in robospa.v1")
            try:
                value = decode(data, self.limits)
            except errors.DecodeError as error:
                return await self._give_up(1007, str(error))
            id = value.get("id") if isinstance(value, dict) else None
            if type(id) is not int or not self._last_id < id <= messages.MAX_ID:
                return await self._give_up(1008, f"request ids must increase from {self._last_id}")
            self._last_id = id
            answer = await self._answer(id, value)
            del data, value  # let the memory of this observation be used for the next one
            await self._send(answer)

    async def _answer(self, id: int, value: object) -> Message:
        try:
            request = messages.read_message(value)
            if isinstance(request, messages.Reset):
                self._in_trial = False
                await self.policy.reset(request.trial)
                self._in_trial = True
                return messages.Ready(id)
            if isinstance(request, messages.Infer | messages.End) and not self._in_trial:
                why = f"{request.type} needs a successful reset first"
                return Error(id, messages.NO_TRIAL, why, retriable=True)
            if isinstance(request, messages.Infer):
                return await self._infer(request)
            if isinstance(request, messages.End):
                self._in_trial = False
                await self.policy.end(request.outcome)
                return messages.Ended(id)
            raise errors.DecodeError(f"a client may not send {request.type}")
        except errors.DecodeError as error:
            return Error(id, messages.BAD_MESSAGE, str(error))
        except (QueueFull, errors.TransportError) as error:  # or what the policy waits for is away
            return Error(id, messages.BUSY, f"the server is busy: {error}", retriable=True)
        except Exception as error:
            self._in_trial = False
            said = errors.error_sentence(error)
            log.error("the policy failed: %s\n%s", said, errors.policy_traceback(error))
            retriable = getattr(error, "retriable", True)
            return Error(id, errors.POLICY_FAILED, said, retriable, self.policy.usage)

    async def _infer(self, request: messages.Infer) -> Message:
        received = request.observation
        try:
            if self.spec.image_codec == "jpeg":
                received = await asyncio.to_thread(decode_images, received, self.limits)
            observation = check_observation(received, self.spec)
        except errors.DecodeError as error:
            return Error(request.id, messages.BAD_OBSERVATION, str(error))
        try:
            answer, timing = await self.policy.infer(observation)
            if self.spec.action in CALLED:
                return messages.Calls(request.id, [*check_calls(answer, self.spec)], timing)
            return messages.Actions(request.id, check_chunk(answer, self.spec), timing)
        except errors.PolicyAnswerError as error:
            used = self.policy.usage
            return Error(request.id, messages.BAD_ANSWER, str(error), timing=used)

    async def _send(self, message: Message) -> None:
        await self.socket.send(messages.pack(message, self.limits))

    async def _give_up(self, close_code: int, reason: str) -> None:
        log.warning("closing a connection: %s", reason)
        await self._send(Error(0, messages.BAD_MESSAGE, reason))
        await self.socket.close(close_code, reason[:100])


async def refuse(socket: MonitoredConnection, ours: bool, error: Exception) -> None:
    """Send the reason why there is no session, in either dialect, and close."""
    reason = errors.error_sentence(error)
    await socket.send(messages.pack(Error(0, errors.POLICY_FAILED, reason)) if ours else reason)
    await socket.close(1011, "no policy for this connection")


@dataclass(eq=False)
class PolicyServer:
    """An async context manager around one listening socket.

    Give a `policy` or a `policy_factory` (`robospa.protocol.policy_host`). `port` 0 is any free
    one; `url` says where to connect once the server runs. `token`: required of clients. `ssl`: for
    wss. Raises ValueError for both or neither policy, OSError on entering if the port is taken.
    """

    policy: Policy | None = None
    host: str = "127.0.0.1"
    port: int = 0
    token: str | None = None
    _: KW_ONLY
    policy_factory: PolicyFactory | None = None
    ssl: ssl_module.SSLContext | None = None
    options: ServerOptions | None = None
    url: str = field(default="", init=False)

    def __post_init__(self) -> None:
        options = self._options = self.options or ServerOptions()
        self._policies = PolicyHost(
            self.policy, self.policy_factory, threads=options.threads, queue=options.queue
        )
        most = options.max_connections
        places = min(most, self._policies.max_sessions or most)
        self._limiter = ConnectionLimiter(places, options)
        self._server: Server | None = None

    async def __aenter__(self) -> Self:
        keep_freed_memory()
        self._server = await websocket_serve(
            self._handle,
            self.host,
            self.port,
            ssl=self.ssl,
            origins=[None],
            select_subprotocol=lambda _, offered: OFFERED if OFFERED in offered else None,
            process_request=self._admit,
            create_connection=self._limiter.connection_type,
            server_header=None,
            logger=LIBRARY_LOG,
            compression=None,
            max_size=self._options.limits.message,
            max_queue=2,  # frames that may wait while one request is served
            write_limit=2**20,
            ping_interval=None,
            open_timeout=self._options.handshake + self._options.patience,
            close_timeout=1,
        )
        for listener in self._server.sockets:
            enlarge_buffers(listener)
            keep_alive(listener)
        host, port = next(iter(self._server.sockets)).getsockname()[:2]
        scheme = "ws" if self.ssl is None else "wss"
        self.url = f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}"
        self._limiter.start()
        return self

    async def __aexit__(self, *_: object) -> None:
        assert self._server is not None
        self._server.close()
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._server.wait_closed(), 1)
        self._limiter.stop()
        self._policies.close()

    async def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """None to go on with the handshake, else the HTTP answer."""
        if request.path == "/healthz":
            return connection.respond(HTTPStatus.OK, "OK\n")
        if not _authorized(self.token, request):
            self._limiter.warn("a client was refused: its token is missing or wrong")
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
        if not await self._limiter.acquire(connection):
            text = f"all {self._limiter.capacity} places of this server are taken\n"
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, text)
        return None

    async def _handle(self, connection: ServerConnection) -> None:
        assert isinstance(connection, MonitoredConnection)
        self._limiter.session_began(connection)
        session = asyncio.ensure_future(self._serve_session(connection))
        closed = asyncio.ensure_future(connection.wait_closed())
        try:
            # A model that hangs must not keep the place of a client that has gone.
            await asyncio.wait((session, closed), return_when=asyncio.FIRST_COMPLETED)
            await asyncio.wait((session,), timeout=0 if session.done() else LAST_ANSWER)
            if session.done():
                await session
        except ConnectionClosed:
            pass
        except Exception:
            log.exception("the session with %s failed", connection.client)
        finally:
            session.cancel()
            closed.cancel()
            self._limiter.session_ended(connection)

    async def _serve_session(self, connection: MonitoredConnection) -> None:
        options, ours = self._options, connection.subprotocol == SUBPROTOCOL
        try:
            policy = await self._policies.open()
        except Exception as error:
            log.exception("no policy could be made for a new connection")
            return await refuse(connection, ours, error)
        connection.on_message_began = policy.request_began
        given = connection, policy, self._policies.spec, options.name, options.limits
        try:
            await (ConnectionHandler(*given).run() if ours else serve_openpi(*given))
        finally:
            policy.close()


class ServerThread(PolicyServer):
    """A policy server in a background thread: `with ServerThread(policy) as server: server.url`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._thread = threading.Thread(target=self._main, name="robospa-server", daemon=True)
        self._ready = threading.Event()
        self._failure: BaseException | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None

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
        async with self:
            self._ready.set()
            await self._stop.wait()

    __enter__ = start

    def __exit__(self, *_: object) -> None:
        self.stop()


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
    """Serve a policy over WebSocket until SIGINT or SIGTERM.

        robospa.serve(policy_factory=MyPolicy, host="0.0.0.0", port=8000, token="...")

    Args:
        policy: One object: for all connections if it has `infer_batch`, else for one at a time.
        host: Address to listen on.
        port: Port to listen on; 0 for any free one.
        token: What clients must send (`ROBOSPA_TOKEN`); without one, everybody can connect.
        policy_factory: Makes one policy per connection, in place of `policy`.
        ssl: Context for `wss://`.
        options: Limits and times.
        on_ready: Called with the URL once clients can connect.

    Raises:
        OSError: The port is taken.
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


def _authorized(token: str | None, request: Request) -> bool:
    if token is None:
        return True
    headers = request.headers.get_all("Authorization")
    kind, _, given = (headers[0] if len(headers) == 1 else "").partition(" ")
    same = hmac.compare_digest(given.strip().encode(errors="surrogateescape"), token.encode())
    return same and kind.lower() in ("bearer", "api-key")
