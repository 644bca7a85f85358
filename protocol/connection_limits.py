"""Who may stay: places, deadlines and bounds of the connections of one server.

The network is not trusted. Everything that a client can make last or grow has a bound here, and a
client that oversteps one loses its own connection and nothing else:

    handshake not finished     dropped after `ServerOptions.handshake` seconds; of more than
                               `handshakes` under way the oldest is dropped
    no place left              a connection that never asked anything gives its place to a newer
                               one; if there is none, HTTP 503 after `patience`
    message in many pieces     must be whole `message` seconds after its first byte
    answers not read           nothing more is read from it, and after `message` seconds it ends
    fragments, pings           at most `FRAMES` frames without a finished message

Which of these happened is said in the log, in one line.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import time
from collections.abc import Callable
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.frames import Frame

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

log = logging.getLogger("robospa.server")

FRAMES = 4096
"""Frames (fragments, pings, pongs) that may come without a finished message."""
GRACE = 1.0
"""[s] that a new connection may be silent before its place can be given to another."""
NO_ROOM = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_DATA = (0, 1, 2)  # continuation, text, binary


class MonitoredConnection(ServerConnection):
    """A connection that keeps count of what its client does."""

    door: ConnectionLimiter
    asked = False
    """Whether a whole message has come."""
    handling = False
    """Whether its session is still under way."""
    began: float | None = None
    """When the first byte of an unfinished message came [s, loop time]."""
    unread: float | None = None
    """Since when the client has not read what was sent."""
    on_begin: Callable[[], None] | None = None
    _frames = 0
    _inside = False

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self.door.opened(self)

    def connection_lost(self, exc: Exception | None) -> None:
        self.door.lost(self)
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        super().pause_writing()
        self.unread = self.loop.time()
        self.transport.pause_reading()

    def resume_writing(self) -> None:
        super().resume_writing()
        self.unread = None
        if not self.recv_messages.paused:
            self.transport.resume_reading()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.unread is not None:
            self.transport.pause_reading()
        if not self._inside and not self.protocol.reader.buffer:
            self.began = None
        elif self.began is None:
            self.began = self.loop.time()
            if self.on_begin is not None:
                self.on_begin()

    def process_event(self, event: Any) -> None:
        if not isinstance(event, Frame) or self._allowed(event):
            super().process_event(event)
        elif not self.transport.is_closing():
            self.drop(f"it sent {FRAMES} fragments or pings without a finished message")

    def _allowed(self, frame: Frame) -> bool:
        if frame.opcode in _DATA:
            self._inside = not frame.fin
            if frame.fin:
                self._frames, self.began, self.asked = 0, None, True
                return True
        self._frames += 1
        return self._frames <= FRAMES

    def drop(self, reason: str) -> None:
        """End the connection at once, whatever waits to be sent."""
        log.warning("dropping the client %s: %s", self.client, reason)
        self.transport.abort()

    @property
    def client(self) -> str:
        """Its address, for the log."""
        address = self.transport.get_extra_info("peername")
        return f"{address[0]}:{address[1]}" if isinstance(address, tuple) else "(gone)"


class ConnectionLimiter:
    """Places for at most `places` connections, and the watch over all of them."""

    def __init__(self, places: int, *, patience: float, handshakes: int, message: float) -> None:
        self.places = places
        self._patience, self._handshakes, self._message = patience, handshakes, message
        self._seated: dict[MonitoredConnection, float] = {}
        self._waiting: list[object] = []
        self._open: dict[MonitoredConnection, None] = {}
        self._entering: dict[MonitoredConnection, None] = {}
        self._told: dict[str, float] = {}
        self._watch: asyncio.Task[None] | None = None
        self.connection: type[MonitoredConnection] = type(
            "MonitoredConnection", (MonitoredConnection,), {"door": self}
        )

    def start(self) -> None:
        """Begin to watch."""
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(self._no_room)
        self._watch = loop.create_task(self._look())

    def stop(self) -> None:
        """End the watch."""
        if self._watch is not None:
            self._watch.cancel()

    # ------------------------------------------------------------ the life of a connection

    def opened(self, connection: MonitoredConnection) -> None:
        """A socket was accepted; nothing has been read from it."""
        self._open[connection] = self._entering[connection] = None
        if len(self._entering) > self._handshakes:
            self.tell(f"more than {self._handshakes} handshakes at once: the oldest are dropped")
            oldest = next(iter(self._entering))
            del self._entering[oldest]
            oldest.transport.abort()

    async def seat(self, connection: MonitoredConnection) -> bool:
        """Wait a little for a place: a client that reconnects may be faster than the news that its
        old connection is gone. The newest is served first: a crowd that came before can wait."""
        clock, ticket = asyncio.get_running_loop().time, object()
        give_up = clock() + self._patience
        self._waiting.append(ticket)
        try:
            while True:
                newest = self._waiting[-1] is ticket
                if newest and (len(self._seated) < self.places or self._make_room(clock())):
                    self._seated[connection] = clock()
                    return True
                if clock() >= give_up:
                    self.tell(f"all {self.places} places are taken: a client was turned away")
                    return False
                await asyncio.sleep(0.01 if newest else 0.1)
        finally:
            self._waiting.remove(ticket)

    def _make_room(self, now: float) -> bool:
        """Take the place of the connection that has been silent longest and never asked."""
        for connection, since in self._seated.items():
            if not connection.asked and now - since >= GRACE:
                connection.drop("it never asked anything, and its place is needed")
                del self._seated[connection]
                return True
        return False

    def entered(self, connection: MonitoredConnection) -> None:
        """The handshake is over and a session begins."""
        self._entering.pop(connection, None)
        connection.handling = True

    def left(self, connection: MonitoredConnection) -> None:
        """The session is over."""
        connection.handling = False
        self._seated.pop(connection, None)

    def lost(self, connection: MonitoredConnection) -> None:
        """The socket is closed. A session that still has to end keeps its place until then."""
        self._open.pop(connection, None)
        self._entering.pop(connection, None)
        if not connection.handling:
            self._seated.pop(connection, None)

    # ------------------------------------------------------------ the watch

    async def _look(self) -> None:
        """Drop those who take too long over a message."""
        while True:
            await asyncio.sleep(min(1.0, self._message / 4))
            now = asyncio.get_running_loop().time()
            for connection in list(self._open):
                self._check(connection, now)

    def _check(self, connection: MonitoredConnection, now: float) -> None:
        if connection.unread is not None:
            if now - connection.unread > self._message:
                connection.drop(f"it has not read its answers for {self._message:g} s")
        elif connection.began is not None:
            if connection.recv_messages.paused:  # it is we who do not read
                connection.began = now
            elif now - connection.began > self._message:
                connection.drop(f"a message was not whole {self._message:g} s after it began")

    def _no_room(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Say it plainly if a connection cannot be accepted; asyncio tries again in a second."""
        if getattr(context.get("exception"), "errno", None) in NO_ROOM:
            self.tell(
                f"a client cannot be accepted: {context['exception']}; it waits. This process may "
                f"have {_most_files()} files and sockets open (see ulimit -n), "
                f"{len(self._open)} of them are clients"
            )
        else:
            loop.default_exception_handler(context)

    def tell(self, text: str) -> None:
        """Log a warning, but the same one at most every ten seconds."""
        now = time.monotonic()
        if now - self._told.get(text[:20], -10.0) >= 10.0:
            self._told[text[:20]] = now
            log.warning("%s", text)


def _most_files() -> str:
    return str(resource.getrlimit(resource.RLIMIT_NOFILE)[0]) if resource else "only so many"


def keep_alive(sock: socket.socket) -> None:
    """Let the kernel notice within two minutes that a silent client's machine is gone."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (("TCP_KEEPIDLE", 60), ("TCP_KEEPINTVL", 15), ("TCP_KEEPCNT", 4)):
        if hasattr(socket, name):
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
