"""One adapter per server dialect, chosen by the scheme of the URL.

    ws://localhost:8000                       robospa.v1, or openpi's dialect
    go1+http://gpu:9000?wrists=swapped        options of the dialect in the query

A dialect is a module of this package with `Options`, a frozen dataclass of its conventions (see
`robospa.protocol.options`), and `open_session`, which makes a `WireClient`. Everything else
(time limits, request ids, checking chunks, reconnecting between trials) is the same for all.
"""

from __future__ import annotations

import importlib
import ssl as ssl_module
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from robospa.clients.detect import explained
from robospa.protocol.client import RemotePolicy, WireClient, expecting
from robospa.protocol.codec import DEFAULT_LIMITS, Limits
from robospa.protocol.errors import HandshakeError, TransportError, Unauthorized
from robospa.protocol.options import read_options, url_options
from robospa.protocol.policy import PolicySpec
from robospa.protocol.transport import Timeouts

__all__ = [
    "SCHEMES",
    "Dialect",
    "Line",
    "RemotePolicy",
    "Target",
    "check_options",
    "connect",
    "find",
]


@dataclass(frozen=True)
class Dialect:
    """A way to talk: the `module` of this package, `what` it reaches, its usual `port`."""

    module: str
    what: str
    port: int = 8000


SCHEMES: Mapping[str, Dialect] = {
    "ws": Dialect(
        "robospa_v1.client", "robospa.v1, or openpi's dialect if the server does not know it"
    ),
    "wss": Dialect("robospa_v1.client", "the same through TLS", 443),
    "openpi": Dialect("openpi.client", "openpi's serve_policy"),
    "go1+http": Dialect("go1.client", "GO-1's deploy.py", 9000),
    "go1+https": Dialect("go1.client", "the same through TLS", 443),
    "xvla+http": Dialect("xvla.client", "X-VLA's deploy.py"),
    "xvla+https": Dialect("xvla.client", "the same through TLS", 443),
    "xpolicylab": Dialect("xpolicylab.client", "XPolicyLab's policy server", 19000),
    "vla-eval": Dialect("vla_eval.client", "vla-eval's model servers"),
    "robotwin+tcp": Dialect("robotwin.client", "RoboTwin's policy_model_server", 9999),
}


@dataclass(frozen=True)
class Target:
    """A server's address taken apart. `options` are as given, `path` has no query."""

    url: str
    dialect: Dialect
    scheme: str
    host: str
    port: int
    path: str
    options: Mapping[str, Any]

    @property
    def secure(self) -> bool:
        """Whether the scheme asks for TLS."""
        return self.scheme.endswith(("wss", "https"))


@dataclass(frozen=True)
class Line:
    """What every dialect's `open_session` gets beside its options."""

    target: Target
    timeouts: Timeouts
    limits: Limits = DEFAULT_LIMITS
    token: str | None = None
    ssl: ssl_module.SSLContext | None = None


def find(url: str, options: Mapping[str, Any] | None = None) -> Target:
    """The server that `url` names; `options` are overruled by those in the URL.

    Raises ValueError for an unknown scheme or a URL without host.
    """
    parts = urlsplit(url)
    dialect = SCHEMES.get(parts.scheme)
    if dialect is None:
        known = ", ".join(f"{name}:// ({d.what})" for name, d in SCHEMES.items())
        raise ValueError(f"{url!r} is no address of a policy server; known are {known}")
    if not parts.hostname:
        raise ValueError(
            f"{url!r} names no host: write for example {parts.scheme}://localhost:{dialect.port}"
        )
    try:
        port = parts.port or dialect.port
        given = {**(options or {}), **url_options(parts.query)}
    except ValueError as error:
        raise ValueError(f"{url!r} cannot be read: {error}") from error
    return Target(url, dialect, parts.scheme, parts.hostname, port, parts.path, given)


def check_options(url: str, options: Mapping[str, Any] | None = None) -> None:
    """Raises ValueError if `url` or an option cannot be; talks to nobody."""
    _prepare(url, options)


def _prepare(url: str, options: Mapping[str, Any] | None) -> tuple[Target, Any, Any]:
    """The server, its dialect's module and the options to speak it with."""
    target = find(url, options)
    module = importlib.import_module(f"robospa.clients.{target.dialect.module}")
    try:
        return target, module, read_options(module.Options, target.options)
    except ValueError as error:
        raise ValueError(f"{url!r}: {error}") from error


def connect(
    url: str,
    token: str | None = None,
    timeouts: Timeouts | None = None,
    *,
    options: Mapping[str, Any] | None = None,
    limits: Limits = DEFAULT_LIMITS,
    ssl: ssl_module.SSLContext | None = None,
    expect: PolicySpec | None = None,
) -> RemotePolicy:
    """A `Policy` behind `url`; `options` are those of the URL's dialect.

    `expect`: refuse (SpecMismatch) a server with another spec. Raises ValueError for a URL or an
    option that cannot be, and the errors of `robospa.protocol.errors`.
    """
    target, module, chosen = _prepare(url, options)
    line = Line(target, timeouts or Timeouts(), limits, token, ssl)
    known = expect is not None

    def opened() -> WireClient:
        nonlocal known
        try:
            session: WireClient = module.open_session(line, chosen)
            known = True
            return session
        except Unauthorized:
            raise
        except (HandshakeError, TransportError) as error:
            # Once it has spoken this dialect, trouble is trouble and no sign of another one.
            if known or isinstance(error.__cause__, ConnectionRefusedError):
                raise
            raise explained(error, line) from error.__cause__

    return expecting(RemotePolicy(url, opened, line.timeouts), expect)
