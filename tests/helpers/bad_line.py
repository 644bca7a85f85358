"""A line between a client and a sound server that spoils what the server says, when it is told to.

One for all dialects: it knows bytes, not messages.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from typing import Any

HUGE = {
    "http": b"HTTP/1.1 200 OK\r\nContent-Length: 2147483648\r\n\r\n",
    "tcp": struct.pack(">I", 2**31),
    "socket": struct.pack(">BBQ", 0x82, 127, 2**31),
}
"""How 2 GB are announced."""


class BadLine:
    """Passes bytes to the port `to` and back. `mode` is good, hang, drip, cut, half, huge, twice or
    gone; `kind` a key of HUGE. A context manager that gives its port."""

    def __init__(self, to: int, kind: str) -> None:
        self.to, self.kind, self.mode = to, kind, "good"
        self._ends: list[socket.socket] = []
        self._over = threading.Event()

    def __enter__(self) -> int:
        self._door = socket.create_server(("127.0.0.1", 0))
        port: int = self._door.getsockname()[1]
        threading.Thread(target=self._welcome, daemon=True).start()
        return port

    def __exit__(self, *_: object) -> None:
        self._over.set()
        _end(self._door)
        self.cut()

    def cut(self) -> None:
        """End all connections."""
        for end in self._ends:
            _end(end)
        self._ends = []

    def _welcome(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._door.accept()
                server = socket.create_connection(("127.0.0.1", self.to))
                self._ends += [client, server]
                for work in ((client, server, self._there), (server, client, self._back)):
                    threading.Thread(target=self._carry, args=work, daemon=True).start()

    def _carry(self, source: Any, target: Any, how: Any) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(2**20):
                how(data, source, target)
        _end(source)
        _end(target)

    def _there(self, data: bytes, source: Any, target: Any) -> None:
        target.sendall(data)

    def _back(self, data: bytes, source: Any, target: Any) -> None:
        mode = self.mode
        if mode == "good":
            target.sendall(data)
        elif mode == "drip":
            while not self._over.wait(0.05):
                target.sendall(data[:1])
                data = data[1:] or b" "
        elif mode == "huge":
            target.sendall(HUGE[self.kind])
            moment()
            _end(target)
        elif mode == "twice":
            whole = data + _rest(source)
            target.sendall(whole + whole)
        elif mode in ("cut", "half"):
            target.sendall(data[: 10 * (mode == "half")])
            _end(target)
        else:
            assert mode == "hang"


def _rest(source: socket.socket) -> bytes:
    """What follows within a moment."""
    found = b""
    source.settimeout(0.1)
    with contextlib.suppress(TimeoutError):
        while piece := source.recv(2**20):
            found += piece
    source.settimeout(None)
    return found


def _end(end: socket.socket) -> None:
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()


def moment() -> None:
    """Time enough for bytes to cross a loopback."""
    time.sleep(0.05)
