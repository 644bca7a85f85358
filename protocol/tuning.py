"""Settings of the operating system: large socket buffers, keepalive, memory that is kept."""

from __future__ import annotations

import ipaddress
import socket

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
