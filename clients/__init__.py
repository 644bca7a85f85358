"""One adapter per server dialect, chosen by the scheme of the URL.

ws://, wss://   robospa.v1; a server that does not know it is spoken to in openpi's dialect
openpi://       openpi's dialect without offering ours (host:port, plain WebSocket)
"""

from __future__ import annotations

from typing import Any
from urllib.parse import urlsplit

from robospa.protocol.client import RemotePolicy
from robospa.protocol.client import connect as _connect

__all__ = ["SCHEMES", "RemotePolicy", "address", "connect"]

SCHEMES = {
    "ws": "robospa.v1, or openpi's dialect if the server does not know it",
    "wss": "the same through TLS",
    "openpi": "openpi's dialect",
}


def connect(url: str, **options: Any) -> RemotePolicy:
    """A `Policy` behind `url`; options are those of `robospa.protocol.client.connect`.

    Raises ValueError for a URL of another form, and the errors of `robospa.protocol.errors`.
    """
    where, implied = address(url)
    return _connect(where, **{**implied, **options})


def address(url: str) -> tuple[str, dict[str, Any]]:
    """The WebSocket URL behind `url` and the options that its scheme implies."""
    parts = urlsplit(url)
    if parts.scheme not in SCHEMES:
        known = ", ".join(f"{name}:// ({what})" for name, what in SCHEMES.items())
        raise ValueError(f"{url!r} is no address of a policy server; known are {known}")
    if not parts.hostname:
        raise ValueError(
            f"{url!r} names no host: write for example {parts.scheme}://localhost:8000"
        )
    if parts.scheme == "openpi":
        return f"ws{url[len('openpi') :]}", {"force_openpi": True}
    return url, {}
