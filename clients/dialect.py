"""A dialect: how the policy servers of one project are spoken to and recognised.

A package adds one by a `Dialect` and a line in its pyproject.toml, ours and others' alike:

    [project.entry-points."robospa.dialects"]
    mine = "my_package.client:DIALECT"

docs/adding-a-dialect.md has a whole example.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import ssl as ssl_module
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import metadata
from typing import Any, Literal

from robospa.protocol.client import WireClient
from robospa.protocol.codec import DEFAULT_LIMITS, Limits
from robospa.protocol.errors import HandshakeError, WireError
from robospa.protocol.options import plain_options
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.protocol.transport import Address, Timeouts, Transport
from robospa.registry import DIALECTS, UnknownName, load

TLS_PORT = 443
Answer = tuple[object, Mapping[str, float]]
"""A chunk, which is checked later, and how long its parts took [ms], by name."""


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
    weak_sign: whether other servers may pass `recognise` too, or let it wait: it is asked last.
    sign: by what `recognise` knows it, completes "because".
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
    sign: str = ""
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

    per_trial = False

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


# ---------------------------------------------------------------- which dialect a server speaks
# Only asked when something has gone wrong already. A server that is busy answers none of the
# questions, and the error stays as it was.

ANSWER = 2**16
"""Bytes of an HTTP answer that are read."""


@dataclass(frozen=True)
class HttpAnswer:
    """`status` is None if what came back, or did not, was no HTTP."""

    status: int | None
    body: bytes = b""

    def json(self) -> dict[str, object] | None:
        """The body as a JSON map, None for anything else."""
        try:
            value = json.loads(self.body)
        except (ValueError, RecursionError):
            return None
        return value if isinstance(value, dict) else None


@dataclass(frozen=True)
class Probe:
    """Harmless questions to a server to be recognised: `params` have short deadlines and small
    limits, answers are bounded, and none runs a model."""

    params: ConnectionParams
    _answers: dict[tuple[str, str, bytes | None], HttpAnswer] = field(default_factory=dict)

    def http(self, method: str, path: str, body: bytes | None = None) -> HttpAnswer:
        """What the server answers; the same request is sent once."""
        request = (method, path, body)
        if request not in self._answers:
            connection = self.params.open_http()
            try:
                connection.request(method, path, body, {"Content-Type": "application/json"})
                response = connection.getresponse()
                self._answers[request] = HttpAnswer(response.status, response.read(ANSWER))
            except (OSError, ValueError, http.client.HTTPException):
                self._answers[request] = HttpAnswer(None)
            finally:
                connection.close()
        return self._answers[request]


SECONDS = 1.5
"""Deadline of each question."""
SMALL = Limits(message=2**22)
UNPICKLES = (
    "{} unpickles what it receives, so that whoever reaches it can run code there: robospa does "
    "not speak to it; serve the checkpoint by {} instead"
)
LEROBOT = UNPICKLES.format("LeRobot's asynchronous inference server", "`robospa serve lerobot`")
BEING_H = UNPICKLES.format("Being-H's server", "XPolicyLab's Being_H05")
REFUSED = {"grpc": LEROBOT, "lerobot": LEROBOT, "being-h": BEING_H}
"""Schemes under which servers may be looked for that are never spoken to, and why."""
HTTP2 = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
"""How a client of gRPC begins: the preface, and settings that change nothing."""
WEBSOCKET = "a WebSocket server"
HTTP = "an HTTP server of another kind"


def explain_error(error: WireError, params: ConnectionParams) -> WireError:
    """`error`, or a HandshakeError that also says which dialect the server seems to speak."""
    endpoint = params.endpoint
    found = detect(params)
    if found is None:
        return error
    spoken, looks = endpoint.dialect, found
    if isinstance(found, str):
        fits = found == WEBSOCKET and spoken.wire == "websocket"
    else:
        fits = found.scheme in (spoken.scheme, *spoken.also_reaches)
        scheme = found.secure_scheme if endpoint.secure and found.secure_scheme else found.scheme
        why = f", because {found.sign}" if found.sign else ""
        looks = f"{found.server}; try {scheme}://{endpoint.authority}{why}"
    if fits:
        return error
    explanation = HandshakeError(f"{endpoint.url} looks like {looks} ({error})")
    explanation.__cause__ = error
    return explanation


def detect(params: ConnectionParams) -> Dialect | str | None:
    """The dialect of the server, or a phrase for one of no known dialect; None: cannot be told."""
    timeouts = Timeouts(
        connect=SECONDS, hello=SECONDS, reset=SECONDS, first_infer=SECONDS, infer=SECONDS, close=0.2
    )
    probe = Probe(replace(params, timeouts=timeouts, limits=SMALL))
    status = probe.http("GET", "/health").status
    if status is not None and status >= 500:
        return None  # in trouble, or full: no sign of another dialect
    for dialect in sorted(dialects(), key=lambda dialect: dialect.weak_sign):
        if (dialect.wire == "tcp") == (status is None) and dialect.recognise is not None:
            # Whatever a question comes to, the error that led here is the one to report.
            with contextlib.suppress(Exception):
                if dialect.recognise(probe):
                    return dialect
    if status is None:
        return _refused(probe)
    if status != 426:
        try:
            Transport(probe.params.websocket_address(), timeouts, SMALL).close()
        except WireError:
            return HTTP
    return WEBSOCKET


def _refused(probe: Probe) -> str | None:
    """What a server without HTTP/1 shows: gRPC answers settings, ZeroMQ greets unasked."""
    endpoint = probe.params.endpoint
    try:
        with socket.create_connection((endpoint.host, endpoint.port), SECONDS) as sock:
            sock.settimeout(SECONDS)
            sock.sendall(HTTP2)
            first = sock.recv(10)
    except OSError:
        return None
    if first[3:5] == b"\x04\x00":
        return f"a gRPC server; {LEROBOT}"
    is_zmq = first[:1] == b"\xff" and first[9:10] == b"\x7f"
    return f"a ZeroMQ server of another kind; {BEING_H}" if is_zmq else None
