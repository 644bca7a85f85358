"""One WebSocket to a policy server, with every failure turned into an error of this package.

Chosen for large messages on a quiet line: no compression, large socket buffers, one buffer and one
frame per message (fragments cost more wake-ups than their overlap saves on a busy machine), and no
keepalive pings (a server that computes for a minute is not dead; deadlines are set per call
instead). A transport that failed once is closed and stays closed.
"""

import contextlib
import ctypes
import ipaddress
import logging
import re
import socket
import ssl as ssl_module
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from http import HTTPStatus
from typing import Any, TypeVar
from urllib.parse import urljoin, urlsplit

from websockets.exceptions import (
    ConnectionClosed,
    InvalidMessage,
    InvalidStatus,
    WebSocketException,
)
from websockets.frames import CloseCode
from websockets.sync.client import ClientConnection
from websockets.sync.client import connect as websocket_connect
from websockets.typing import Subprotocol

from robospa.protocol import errors
from robospa.protocol.codec import DEFAULT_LIMITS, Limits
from robospa.protocol.messages import SUBPROTOCOL

T = TypeVar("T")
LIBRARY_LOG = logging.getLogger("robospa.client.websockets")
"""What websockets prints of odd servers, with tracebacks; here each ends in an error of ours."""
LIBRARY_LOG.setLevel(logging.CRITICAL)
REDIRECTS = 3
"""How often one handshake may be sent elsewhere."""
MOVED = (301, 302, 303, 307, 308)
"""Statuses with which an HTTP server sends a client to another address."""


@dataclass(frozen=True)
class Timeouts:
    """Deadlines in seconds. `wait`: how long to keep trying while nobody listens or the server
    answers HTTP 503, as one does that shuts down to restart. `first_infer` is for the first answer
    on a connection and after a change of task (compilation, loading)."""

    wait: float = 0.0
    connect: float = 30.0
    hello: float = 120.0
    reset: float = 600.0
    first_infer: float = 600.0
    infer: float = 120.0
    end: float = 30.0
    close: float = 1.0


@dataclass(frozen=True)
class Address:
    """Where and how to connect. `token_kind`: the word before the token in its header.
    `redirects` gets the addresses on the same host that a handshake was sent on to."""

    url: str
    token: str | None = None
    ssl: ssl_module.SSLContext | None = None
    token_kind: str = "Bearer"
    redirects: list[str] = field(default_factory=list, compare=False)

    def headers(self) -> dict[str, str]:
        if self.token is None:
            return {}
        return {"Authorization": f"{self.token_kind} {self.token}"}


class _Redirected(Exception):
    """The server sends this client to the address that is the error's text."""


class _Connection(ClientConnection):
    """A connection whose redirects are for us to judge: websockets would follow them anywhere."""

    def handshake(self, *args: Any, **kwargs: Any) -> None:
        try:
            super().handshake(*args, **kwargs)
        except InvalidStatus as error:
            if error.response.status_code in MOVED:
                raise _Redirected(error.response.headers.get("Location", "")) from error
            raise


LONG_IDLE = 5.0
"""Seconds without a message after which a lost connection may have been cut for that."""
CUT = "the server or a proxy before it may have cut it for that"


class Transport:
    """Sends and receives whole messages; `subprotocol` is what the server selected, or None."""

    _idle = 0.0  # seconds without a message before the last request, or until the loss was found

    def __init__(
        self,
        address: Address,
        timeouts: Timeouts,
        limits: Limits = DEFAULT_LIMITS,
        subprotocol: str | None = SUBPROTOCOL,
    ) -> None:
        self._limit, self._used = limits.message, time.monotonic()
        keep_freed_memory()
        self._socket, self.url = _open(address, timeouts, limits, subprotocol)
        self.subprotocol: str | None = self._socket.subprotocol
        seconds = max(timeouts.first_infer, timeouts.infer)
        wait = struct.pack("@ll", int(seconds), int(seconds % 1 * 1e6))
        with contextlib.suppress(OSError):
            self._socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, wait)

    def send(self, message: bytes) -> None:
        """Raises ConnectionLost."""
        self._idle, self._used = time.monotonic() - self._used, time.monotonic()
        try:
            self._socket.send(message)
        except (ConnectionClosed, OSError) as error:
            raise self._lost("while sending", error) from error

    def receive(self, timeout: float, what: str) -> bytes | str:
        """The next message: bytes, or str for a text frame. After CallTimeout the transport is
        closed, because a late answer could be taken for the next one."""
        try:
            data = self._socket.recv(timeout)
            self._used = time.monotonic()
            return data
        except TimeoutError as error:
            self.close()
            raise errors.CallTimeout(
                f"{self.url} did not send {what} within {timeout:g} s; "
                "look at the server's log, or allow more time"
            ) from error
        except (ConnectionClosed, OSError) as error:
            raise self._lost(f"while waiting for {what}", error) from error

    def has_more(self) -> bool:
        """Whether a message has arrived that was not received yet; it is dropped. Raises
        ConnectionLost if the other side has closed the connection meanwhile."""
        try:
            self._socket.recv(0)
        except TimeoutError:
            return False
        except ConnectionClosed as error:
            self._idle = time.monotonic() - self._used
            raise self._lost("while nothing was asked", error) from error
        return True

    @property
    def was_idle(self) -> bool:
        """Whether nothing was said for long before the last request, or before the connection was
        found lost: then it may have been cut for that."""
        return self._idle > LONG_IDLE

    def close(self) -> None:
        """Close; harmless when closed already."""
        self._socket.close()

    def _lost(self, when: str, error: Exception) -> errors.TransportError:
        self.close()
        idle = f" (it was idle for {self._idle:.0f} s: {CUT})" if self.was_idle else ""
        return errors.ConnectionLost(
            f"the connection to {self.url} ended {when}: {why_closed(error, self._limit)}{idle}"
        )


def why_closed(error: Exception, limit: int) -> str:
    """Why a connection ended, in words; `limit` is the most bytes that a message may have."""
    if not isinstance(error, ConnectionClosed):
        return str(error) or type(error).__name__
    if error.sent is not None and error.rcvd_then_sent is not True:
        if error.sent.code == CloseCode.MESSAGE_TOO_BIG:
            return (
                f"the server sent more than the {limit} bytes that a message may have; "
                "is it a policy server?"
            )
        if error.sent.code in (CloseCode.PROTOCOL_ERROR, CloseCode.INVALID_DATA):
            reason = errors.printable(error.sent.reason)
            return f"the server broke the rules of WebSocket ({reason}); is it a policy server?"
    if error.rcvd is not None:
        reason = f"{error.rcvd.code:d}: {errors.printable(error.rcvd.reason) or 'no reason given'}"
        return f"the server closed it ({reason}); look at its log"
    return "it was closed without a reason; look at the server's log"


class NotYet(Exception):
    """Nobody serves there yet; `error` is raised if nobody comes."""

    def __init__(self, error: Exception) -> None:
        super().__init__(str(error))
        self.error = error


def connect_until(url: str, wait: float, connect: Callable[[], T]) -> T:
    """What `connect` returns, called again for `wait` s while nobody listens or it raises NotYet.

    Raises ConnectFailed for any OSError, and what else `connect` raises.
    """
    give_up = time.monotonic() + wait
    while True:
        try:
            return connect()
        except ConnectionRefusedError as error:
            failure: Exception = errors.ConnectFailed(
                f"cannot connect to {url}: nothing listens there; start the policy server first"
            )
            cause: BaseException | None = error
        except NotYet as error:
            failure, cause = error.error, error.__cause__
        except OSError as error:
            raise errors.ConnectFailed(connect_failure(url, error)) from error
        if time.monotonic() >= give_up:
            raise failure from cause
        time.sleep(0.05)


NO_TLS = ("WRONG_VERSION_NUMBER", "RECORD_LAYER_FAILURE", "HTTP_REQUEST", "PACKET_LENGTH_TOO_LONG")
"""Reasons of OpenSSL for an answer that is none of TLS."""
TLS_SECONDS = 1.5


def connect_failure(url: str, error: Exception) -> str:
    """Why a connection could not be made, and what to do where TLS is the reason."""
    if isinstance(error, ssl_module.SSLCertVerificationError):
        return (
            f"cannot connect to {url}: its certificate is not trusted here ("
            f"{error.verify_message}); name its file (PEM) in the variable SSL_CERT_FILE, and the "
            "server as the certificate does"
        )
    if isinstance(error, ssl_module.SSLEOFError) or getattr(error, "reason", "") in NO_TLS:
        plain = re.sub(r"^(\w+)s:", r"\1:", url)
        return f"cannot connect to {url}: no TLS is spoken there; if that is right, try {plain}"
    return f"cannot connect to {url}: {error}"


def refuse_tls(url: str, error: Exception) -> None:
    """Raises HandshakeError if a connection without TLS came to `error` because TLS is needed."""
    parts = urlsplit(url)
    if parts.scheme not in ("ws", "http") or not parts.hostname or not parts.port:
        return
    context = ssl_module.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl_module.CERT_NONE
    with contextlib.suppress(OSError):
        with (
            socket.create_connection((parts.hostname, parts.port), TLS_SECONDS) as sock,
            context.wrap_socket(sock),
        ):
            pass
        secure = url.replace(parts.scheme, f"{parts.scheme}s", 1)
        raise errors.HandshakeError(f"{url} speaks TLS: use {secure}") from error


def _open(
    address: Address, timeouts: Timeouts, limits: Limits, offer: str | None
) -> tuple[ClientConnection, str]:
    """The connection, and the address where it was made in the end; ValueError for one of another
    form."""
    parts, shown = urlsplit(address.url), errors.without_secrets(address.url)
    if parts.scheme not in ("ws", "wss") or not parts.hostname or "@" in parts.netloc:
        raise ValueError(f"{shown!r} is not of the form ws://host:port or wss://host:port")
    for _ in range(1 + REDIRECTS):
        attempt = partial(_attempt, address, timeouts, limits, offer)
        try:
            return connect_until(address.url, timeouts.wait, attempt), address.url
        except _Redirected as error:
            address = _moved(address, str(error))
    raise errors.HandshakeError(f"{address.url} redirects for ever")


def _attempt(
    address: Address, timeouts: Timeouts, limits: Limits, offer: str | None
) -> ClientConnection:
    """One handshake, whose failures are errors of ours."""
    try:
        return _open_once(address, timeouts, limits, offer)
    except ConnectionRefusedError:
        raise
    except InvalidStatus as error:
        refused = _refused(address, error)
        if error.response.status_code == HTTPStatus.SERVICE_UNAVAILABLE:  # it may restart
            raise NotYet(refused) from error
        raise refused from error
    except TimeoutError as error:
        raise errors.ConnectFailed(
            f"{address.url} did not finish the handshake within {timeouts.connect:g} s; "
            "look at the server's log"
        ) from error
    except (OSError, ValueError, EOFError, WebSocketException) as error:
        if isinstance(error, WebSocketException) or _hung_up(error):
            refuse_tls(address.url, error)
        if not _hung_up(error):
            raise errors.ConnectFailed(connect_failure(address.url, error)) from error
        text = f"cannot connect to {address.url}: it hung up during the handshake ({error}); "
        raise NotYet(errors.ConnectFailed(text + "start the policy server behind it")) from error


def _moved(address: Address, location: str) -> Address:
    """Where the server sends this client; raises HandshakeError if that is another host, or a line
    in the clear instead of TLS: who answers there is not who was named, and would get the token."""
    here, url = urlsplit(address.url), urljoin(address.url, location)
    url = re.sub("^http", "ws", url)
    there = urlsplit(url)
    safe = there.scheme == "wss" or (there.scheme == "ws" and here.scheme == "ws")
    if not location or not safe or there.hostname != here.hostname or "@" in there.netloc:
        target = errors.printable(errors.without_secrets(location), 200) or "nowhere"
        raise errors.HandshakeError(
            f"{address.url} redirects to {target}, which is not "
            "followed to another host: give the address of the policy server itself"
        )
    address.redirects[:] = [url]
    return replace(address, url=url)


def _hung_up(error: Exception) -> bool:
    """Whether the other side hung up before it answered: it restarts, or a tunnel's end is not up.

    The same event raises one of several errors, depending on how far the handshake was.
    """
    if isinstance(error, InvalidMessage):
        return isinstance(error.__cause__, EOFError)
    return isinstance(error, EOFError | ConnectionResetError | BrokenPipeError | ConnectionClosed)


def _open_once(
    address: Address, timeouts: Timeouts, limits: Limits, offer: str | None
) -> ClientConnection:
    parts, sock = urlsplit(address.url), None
    if parts.hostname and is_loopback(parts.hostname):
        # Own socket: no detour through a proxy that the environment names, and buffers that
        # are set before the connection exists (the kernel scales its window by them).
        port = parts.port or (443 if parts.scheme == "wss" else 80)
        sock = loopback_socket(parts.hostname, port, timeouts.connect)
    manager = websocket_connect(
        address.url,
        sock=sock,
        ssl=address.ssl,
        subprotocols=[Subprotocol(offer)] if offer else None,
        additional_headers=address.headers(),
        compression=None,
        max_size=limits.message,
        open_timeout=timeouts.connect,
        close_timeout=timeouts.close,
        ping_interval=None,
        logger=LIBRARY_LOG,
        create_connection=_Connection,
    )
    # As of websockets 17 the result must be entered; before, entering it changes nothing.
    connection: ClientConnection = manager.__enter__()
    with contextlib.suppress(OSError):  # closed again already: the first message tells why
        enlarge_buffers(connection.socket)
    return connection


def _refused(address: Address, error: InvalidStatus) -> Exception:
    status = error.response.status_code
    body = errors.printable(bytes(error.response.body or b"").decode("utf-8", "replace"))
    if status == HTTPStatus.UNAUTHORIZED:
        return errors.Unauthorized(f"{address.url} refused the token: {body or status}")
    if status in (HTTPStatus.BAD_REQUEST, HTTPStatus.FORBIDDEN, HTTPStatus.UPGRADE_REQUIRED):
        return errors.HandshakeError(f"{address.url} refused the connection: {body or status}")
    return errors.ConnectFailed(
        f"{address.url} answered HTTP {status}: {body or 'no reason given'}"
    )


SOCKET_BUFFER = 4 * 2**20
"""Bytes asked of the kernel each way (it may give less): a full observation fits."""
_LARGEST_BLOCK = 31 * 2**20  # glibc learns from blocks up to 32 MiB


def keep_freed_memory() -> None:
    """Let this process keep up to about 64 MiB of freed memory for the next observation.

    The C library hands large blocks back to the kernel as soon as they are free and has to fetch
    them again, page by page, for the next message: 400 page faults and more than half of the
    processor time of a request. glibc raises its thresholds (to twice this size) when a large block
    has come and gone once; no page of the block is touched. Elsewhere the call does nothing.
    """
    bytearray(_LARGEST_BLOCK)


def give_memory_back() -> None:
    """Hand all freed memory back to the kernel, also what lies between blocks in use."""
    with contextlib.suppress(OSError, AttributeError):  # another C library
        ctypes.CDLL(None).malloc_trim(0)


def enlarge_buffers(sock: socket.socket) -> None:
    """Ask for room for a whole observation; sockets accepted by a listener inherit it."""
    for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
        sock.setsockopt(socket.SOL_SOCKET, option, SOCKET_BUFFER)


def keep_alive(sock: socket.socket) -> None:
    """Let the kernel notice within two minutes that a silent peer's machine is gone."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (("TCP_KEEPIDLE", 60), ("TCP_KEEPINTVL", 15), ("TCP_KEEPCNT", 4)):
        if hasattr(socket, name):
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def is_loopback(host: str) -> bool:
    """Whether `host` is this machine."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def loopback_socket(host: str, port: int, timeout: float) -> socket.socket:
    """A connected socket whose buffers were large before it connected: the kernel scales its
    window by them. `timeout` [s]. Raises OSError."""
    error: OSError = ConnectionRefusedError(f"{host} has no address")
    for family, kind, proto, _, target in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
        sock = socket.socket(family, kind, proto)
        try:
            enlarge_buffers(sock)
            sock.settimeout(timeout)
            sock.connect(target)
            sock.settimeout(None)
            return sock
        except OSError as failure:
            sock.close()
            error = failure
    raise error
