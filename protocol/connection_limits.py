"""Limits on the connections of one server: how many, how slow, how long silent.

The network is not trusted. Everything that a client can make last or grow has a limit here, and a
client that exceeds one loses its own connection and nothing else (the table is in
docs/protocol.md). websockets bounds the time of a handshake, the size of messages and the length of
queues; the rest it leaves to its user. Each case is logged in one line.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from websockets.asyncio.server import ServerConnection
from websockets.frames import Frame
from websockets.http11 import Request

from robospa.protocol.codec import DEFAULT_LIMITS, Limits
from robospa.protocol.transport import give_memory_back

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

log = logging.getLogger("robospa.server")

FRAMES = 4096
"""Frames (fragments, pings, pongs) that may come without a finished message."""
MUCH = 2**24
"""Bytes of an unfinished message whose end is worth giving memory back."""
GRACE = 1.0
"""[s] that a new connection may be silent before its place can be given to another."""
REPEAT = 10.0
"""[s] before the same warning is logged again."""
OUT_OF_FILES = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_DATA = (0, 1, 2)  # continuation, text, binary


@dataclass(frozen=True)
class ServerOptions:
    """Limits of one server.

    `idle`: seconds of silence after which a connection is closed. `patience`: seconds that a new
    connection waits for a free place. `message`: seconds within which a message has to be complete
    and an answer read. `unfinished`: bytes that messages still on their way may have together: over
    that the largest is dropped. `handshakes`: how many may be in progress at once, each for
    `handshake` seconds. `queue`: requests that may wait. `threads`: how many threads call policies
    (more than one only if they allow it).
    """

    max_connections: int = 256
    unfinished: int = 2**29
    queue: int = 256
    threads: int = 1
    idle: float = 3600.0
    patience: float = 2.0
    message: float = 60.0
    handshakes: int = 128
    handshake: float = 10.0
    name: str = "robospa"
    limits: Limits = field(default_factory=lambda: DEFAULT_LIMITS)


class MonitoredConnection(ServerConnection):
    """A connection that keeps count of what its client does. Times are the loop's [s]."""

    limiter: ConnectionLimiter
    has_sent = False
    """Whether a complete message has come."""
    in_session = False
    """Whether its handler is still running."""
    message_began: float | None = None
    """When the first byte of an unfinished message came."""
    unread_since: float | None = None
    """Since when the client has not read what was sent."""
    waiting_since: float | None = None
    """Since when its handler has been waiting for a message."""
    on_message_began: Callable[[], None] | None = None
    held = 0
    """Bytes of its unfinished message."""
    _frames = 0
    _fragments = 0
    _in_message = False
    _closing: asyncio.Task[None] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self.limiter.opened(self)

    def connection_lost(self, exc: Exception | None) -> None:
        self.limiter.closed(self)
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        super().pause_writing()
        self.unread_since = self.loop.time()
        self.transport.pause_reading()

    def resume_writing(self) -> None:
        super().resume_writing()
        self.unread_since = None
        if not self.recv_messages.paused:
            self.transport.resume_reading()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        self.limiter.hold(self, self._fragments + len(self.protocol.reader.buffer))
        if self.unread_since is not None:
            self.transport.pause_reading()
        if not self._in_message and not self.protocol.reader.buffer:
            self.message_began = None
        elif self.message_began is None:
            self.message_began = self.loop.time()
            if self.on_message_began is not None:
                self.on_message_began()

    def process_event(self, event: Frame | Request) -> None:  # type: ignore[override]
        if not isinstance(event, Frame) or self._allowed(event):
            super().process_event(event)
        elif not self.transport.is_closing():
            self.drop(f"it sent {FRAMES} fragments or pings without a finished message")

    def _allowed(self, frame: Frame) -> bool:
        if frame.opcode in _DATA:
            self._in_message = not frame.fin
            if frame.fin:
                self._frames, self._fragments = 0, 0
                self.message_began, self.has_sent = None, True
                return True
            self._fragments += len(frame.data)
        self._frames += 1
        return self._frames <= FRAMES

    async def next_message(self) -> str | bytes:
        """The next message; raises ConnectionClosed."""
        self.waiting_since = self.loop.time()
        try:
            return await self.recv()
        finally:
            self.waiting_since = None

    def drop(self, reason: str) -> None:
        """End the connection at once, whatever waits to be sent."""
        log.warning("dropping the client %s: %s", self.client, reason)
        self.transport.abort()
        self.protocol.reader.buffer.clear()

    def check(self, now: float, options: ServerOptions) -> None:
        """Drop the connection if it is too slow, close it if it is silent for too long."""
        slow, idle = options.message, options.idle
        if self.unread_since is not None:
            if now - self.unread_since > slow:
                self.drop(f"it has not read its answers for {slow:g} s")
        elif self.message_began is not None:
            if self.recv_messages.paused:  # it is we who do not read
                self.message_began = now
            elif now - self.message_began > slow:
                self.drop(f"a message was not complete {slow:g} s after it began")
        elif now - (self.waiting_since or now) > idle and self._closing is None:
            log.warning("closing the connection of %s: silent for %g s", self.client, idle)
            self._closing = self.loop.create_task(self.close(1000, f"silent for {idle:g} s"))

    @property
    def client(self) -> str:
        """Its address, for the log."""
        address = self.transport.get_extra_info("peername")
        return f"{address[0]}:{address[1]}" if isinstance(address, tuple) else "(gone)"


class ConnectionLimiter:
    """At most `capacity` sessions, and a task that checks all connections."""

    def __init__(self, capacity: int, options: ServerOptions) -> None:
        self.capacity, self._options = capacity, options
        self._held = 0
        self._sessions: dict[MonitoredConnection, float] = {}
        self._waiting: list[MonitoredConnection] = []
        self._open: dict[MonitoredConnection, None] = {}
        self._handshakes: dict[MonitoredConnection, None] = {}
        self._warned: dict[str, float] = {}
        self._task: asyncio.Task[None] | None = None

    @property
    def connection_type(self) -> type[MonitoredConnection]:
        """For `create_connection` of websockets: connections that report to this limiter."""
        return type("LimitedConnection", (MonitoredConnection,), {"limiter": self})

    def start(self) -> None:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(self._accept_failed)
        self._task = loop.create_task(self._check_all())

    def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()

    async def _check_all(self) -> None:
        period = min(1.0, self._options.message / 4, self._options.idle / 4)
        while True:
            await asyncio.sleep(period)
            now = asyncio.get_running_loop().time()
            for connection in list(self._open):
                connection.check(now, self._options)

    # ------------------------------------------------------------ the life of a connection

    def opened(self, connection: MonitoredConnection) -> None:
        """A socket was accepted; nothing has been read from it."""
        self._open[connection] = self._handshakes[connection] = None
        most = self._options.handshakes
        if len(self._handshakes) > most:
            self.warn(f"more than {most} handshakes at once: the oldest are dropped")
            oldest = next(iter(self._handshakes))
            del self._handshakes[oldest]
            oldest.transport.abort()

    async def acquire(self, connection: MonitoredConnection) -> bool:
        """Wait up to `patience` seconds for a place: a client that reconnects may be faster than
        the news that its old connection is closed. The newest is served first: a flood of
        connections that came earlier can wait."""
        clock = asyncio.get_running_loop().time
        deadline = clock() + self._options.patience
        self._waiting.append(connection)
        try:
            while True:
                newest = self._waiting[-1] is connection
                if newest and (len(self._sessions) < self.capacity or self._evict(clock())):
                    self._sessions[connection] = clock()
                    return True
                if clock() >= deadline:
                    self.warn(f"all {self.capacity} places are taken: a client was turned away")
                    return False
                await asyncio.sleep(0.01 if newest else 0.1)
        finally:
            self._waiting.remove(connection)

    def _evict(self, now: float) -> bool:
        """Free the place of the oldest connection that never sent a message."""
        for connection, since in self._sessions.items():
            if not connection.has_sent and now - since >= GRACE:
                connection.drop("it never sent a message, and its place is needed")
                del self._sessions[connection]
                return True
        return False

    def session_began(self, connection: MonitoredConnection) -> None:
        self._handshakes.pop(connection, None)
        connection.in_session = True

    def session_ended(self, connection: MonitoredConnection) -> None:
        connection.in_session = False
        self._sessions.pop(connection, None)

    def hold(self, connection: MonitoredConnection, size: int) -> None:
        """`connection` has `size` bytes of an unfinished message. If all have too many together,
        the one with most is dropped: messages that are really sent are unfinished for moments."""
        self._held += size - connection.held
        connection.held = size
        if self._held > self._options.unfinished:
            largest = max(self._open, key=lambda each: each.held)
            largest.drop(
                f"its unfinished message has {largest.held} bytes, and all together {self._held}, "
                f"of which {self._options.unfinished} are allowed"
            )
            self._held -= largest.held
            largest.held = 0
            give_memory_back()

    def closed(self, connection: MonitoredConnection) -> None:
        """The socket is closed. A handler that still runs keeps its place until it returns."""
        self._held -= connection.held
        if connection.held > MUCH:
            connection.protocol.reader.buffer.clear()
            give_memory_back()
        connection.held = 0
        self._open.pop(connection, None)
        self._handshakes.pop(connection, None)
        if not connection.in_session:
            self._sessions.pop(connection, None)

    # ------------------------------------------------------------ the log

    def _accept_failed(self, loop: asyncio.AbstractEventLoop, context: dict[str, object]) -> None:
        """Log in one line that a connection cannot be accepted; asyncio tries again in a second."""
        if getattr(context.get("exception"), "errno", None) in OUT_OF_FILES:
            most = resource.getrlimit(resource.RLIMIT_NOFILE)[0] if resource else "only so many"
            self.warn(
                f"a client cannot be accepted: {context['exception']}; it waits. This process may "
                f"have {most} files and sockets open (see ulimit -n), "
                f"{len(self._open)} of them are clients"
            )
        else:
            loop.default_exception_handler(context)

    def warn(self, text: str) -> None:
        """Log a warning, but the same one at most every `REPEAT` seconds."""
        now = time.monotonic()
        if now - self._warned.get(text[:20], -REPEAT) >= REPEAT:
            self._warned[text[:20]] = now
            log.warning("%s", text)
