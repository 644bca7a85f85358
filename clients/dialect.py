"""A dialect: how the policy servers of one project are spoken to and recognised.

A package adds one by a `Dialect` and a line in its pyproject.toml, ours and others' alike:

    [project.entry-points."robospa.dialects"]
    mine = "my_package.client:DIALECT"

docs/adding-a-dialect.md has a whole example.
"""

from __future__ import annotations

import http.client
import ssl as ssl_module
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from typing import TYPE_CHECKING, Any, Literal

from robospa.protocol.codec import DEFAULT_LIMITS, Limits
from robospa.protocol.options import plain_options
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.protocol.transport import Address, Timeouts
from robospa.registry import DIALECTS, UnknownName, load

if TYPE_CHECKING:
    from robospa.clients.detect import Probe
    from robospa.protocol.client import WireClient

TLS_PORT = 443


@dataclass(frozen=True)
class Dialect:
    """A way to talk to policy servers.

    server: completes "it looks like ...", as "an openpi server".
    scheme: of its URLs; `secure_scheme` the same through TLS, "" where there is none.
    wire: what its messages travel in.
    port: used where a URL names none; through TLS it is 443.
    options: frozen dataclass of what its servers do not say (`robospa.protocol.options`).
    open_session: connects and greets; raises the errors of `robospa.protocol.errors`.
    recognise: whether a server speaks this dialect, by a few harmless questions that run no model.
    weak_sign: whether other servers may pass `recognise` too, so that it is asked after the others.
    also_reaches: schemes of other dialects whose servers this one gets on with.
    deciding_options: for mistakes that `robospa check --demo` names, the option that decides them.
    shared_state: whether one model keeps one state for all connections, so that two trials at once
        would see each other's observations and execute each other's actions.
    """

    server: str
    scheme: str
    wire: Literal["websocket", "http", "tcp"]
    options: type[Any]
    open_session: Callable[[ConnectionParams, Any], WireClient]
    port: int = 8000
    secure_scheme: str = ""
    recognise: Callable[[Probe], bool] | None = None
    weak_sign: bool = False
    also_reaches: tuple[str, ...] = ()
    deciding_options: Mapping[str, str] = field(default_factory=dict)
    shared_state: bool = False

    @property
    def schemes(self) -> tuple[str, ...]:
        """All its URL schemes, the plain one first."""
        return (self.scheme, self.secure_scheme) if self.secure_scheme else (self.scheme,)


@dataclass(frozen=True)
class Endpoint:
    """A server's address taken apart. `options` are as given, `path` has no query."""

    url: str
    dialect: Dialect
    scheme: str
    host: str
    port: int
    path: str
    options: Mapping[str, object]

    @property
    def secure(self) -> bool:
        """Whether the scheme asks for TLS."""
        return self.scheme == self.dialect.secure_scheme

    @property
    def authority(self) -> str:
        """host:port as it stands in a URL."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{host}:{self.port}"


@dataclass(frozen=True)
class ConnectionParams:
    """What every dialect's `open_session` gets beside its options."""

    endpoint: Endpoint
    timeouts: Timeouts
    limits: Limits = DEFAULT_LIMITS
    token: str | None = None
    ssl: ssl_module.SSLContext | None = None
    redirects: list[str] = field(default_factory=list, compare=False)
    """Addresses on the same host that a handshake was sent on to."""

    def websocket_address(self) -> Address:
        """The ws:// or wss:// address of the endpoint, whatever its own scheme."""
        scheme = "wss" if self.endpoint.secure else "ws"
        url = f"{scheme}://{self.endpoint.authority}{self.endpoint.path}"
        return Address(url, self.token, self.ssl, redirects=self.redirects)

    def open_http(self) -> http.client.HTTPConnection:
        """An HTTP connection to be made, with TLS if the scheme asks for it."""
        host, port, seconds = self.endpoint.host, self.endpoint.port, self.timeouts.connect
        if self.endpoint.secure:
            return http.client.HTTPSConnection(host, port, timeout=seconds, context=self.ssl)
        return http.client.HTTPConnection(host, port, timeout=seconds)


class StatelessSession:
    """A connection to a server that is sent nothing but observations: it keeps no trial.

    A subclass adds `infer` and `close` (`robospa.protocol.client.WireClient`), and `reset` and
    `end` where its server wants to know of them.
    """

    def __init__(
        self,
        dialect: str,
        spec: PolicySpec,
        options: object,
        warnings: Sequence[str],
        **said: object,
    ) -> None:
        """`said`: what the server tells of itself; all parts of `hello` are JSON values."""
        self.spec = spec
        self.hello: dict[str, object] = {
            "dialect": dialect,
            **said,
            "spec": spec.to_json(),
            "options": plain_options(options),
            "warnings": list(warnings),
        }

    def reset(self, id: int, trial: TrialInfo) -> None:
        """Nothing to send."""

    def end(self, id: int, outcome: Mapping[str, object]) -> None:
        """Nothing to send."""


def dialects() -> list[Dialect]:
    """Every dialect that a package registers, by scheme; one that cannot be loaded is warned of."""
    found: dict[str, Dialect] = {}
    for point in metadata.entry_points(group=DIALECTS):
        try:
            dialect = load(point.value)
        except UnknownName as error:
            warnings.warn(f"dialect {point.name!r} is left out: {error}", stacklevel=2)
            continue
        for scheme in dialect.schemes:
            if scheme in found and found[scheme] != dialect:
                raise ValueError(f"two packages register a dialect for {scheme}://; remove one")
            found[scheme] = dialect
    return [found[scheme] for scheme in sorted(found) if scheme == found[scheme].scheme]
