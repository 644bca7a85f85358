"""Clients to policy servers, one dialect chosen by the scheme of the URL.

    ws://localhost:8000                       robospa.v1, or openpi's dialect
    go1+http://gpu:9000?wrists=swapped        options of the dialect in the query

One module a vendor: a client to its own server, and a server of ours with its model. Dialects are
entry points (`robospa.clients.dialect`). Everything else (time limits, request ids, checking
chunks, reconnecting between trials) is the same for all.
"""

import ssl as ssl_module
from collections.abc import Mapping
from dataclasses import replace
from typing import Any
from urllib.parse import urlsplit

from robospa.clients.dialect import (
    REFUSED,
    TLS_PORT,
    ConnectionParams,
    Endpoint,
    dialects,
    explain_error,
)
from robospa.protocol import errors
from robospa.protocol.client import Identity, RemotePolicy, WireClient
from robospa.protocol.options import read_options, url_options
from robospa.protocol.transport import Timeouts

__all__ = ["check_options", "connect", "find_endpoint"]


PATIENCE = 4.0
"""[s] that a server may be silent before it is asked which dialect it speaks."""
TOKEN = "give the server's token with --token, ROBOSPA_TOKEN or token=, which is written nowhere"


def find_endpoint(url: str, options: Mapping[str, object] | None = None) -> Endpoint:
    """The server that `url` names; `options` are overruled by those in the URL.

    Raises ValueError for an unknown scheme or a URL without host.
    """
    shown = errors.without_secrets(url)
    parts = urlsplit(url)
    if "@" in parts.netloc:
        raise ValueError(f"{shown!r} holds a user or password, which is never used: {TOKEN}")
    by_scheme = {scheme: dialect for dialect in dialects() for scheme in dialect.schemes}
    dialect = by_scheme.get(parts.scheme)
    if parts.scheme in REFUSED:
        raise ValueError(f"{shown!r}: {REFUSED[parts.scheme]}")
    if dialect is None:
        hint = f"; did you mean ws://{shown}?" if ":" in url and "://" not in url else ""
        known = ", ".join(f"{scheme}://" for scheme in by_scheme) or "none (is robospa installed?)"
        raise ValueError(
            f"{shown!r} is no address of a policy server; they begin with {known} (ws:// for one "
            f"of robospa serve){hint}"
        )
    if not parts.hostname:
        raise ValueError(
            f"{shown!r} names no host: write for example {parts.scheme}://localhost:{dialect.port}"
        )
    usual = TLS_PORT if parts.scheme == dialect.secure_scheme else dialect.port
    try:
        port = parts.port or usual
        given = {**(options or {}), **url_options(parts.query)}
    except ValueError as error:
        raise ValueError(
            f"{shown!r} cannot be read: {errors.without_secrets(str(error))}"
        ) from error
    return Endpoint(url, dialect, parts.scheme, parts.hostname, port, parts.path, given)


def check_options(url: str, options: Mapping[str, object] | None = None) -> tuple[Endpoint, Any]:
    """The server that `url` names, and the options of its dialect; talks to nobody.

    Raises ValueError if `url` or an option cannot be.
    """
    endpoint = find_endpoint(url, options)
    try:
        return endpoint, read_options(endpoint.dialect.options, endpoint.options)
    except ValueError as error:
        raise ValueError(f"{errors.without_secrets(url)!r}: {error}") from error


def connect(
    url: str,
    token: str | None = None,
    timeouts: Timeouts | None = None,
    *,
    options: Mapping[str, object] | None = None,
    ssl: ssl_module.SSLContext | None = None,
    identity: Identity | None = None,
) -> RemotePolicy:
    """A `Policy` behind a server: `spec`, `reset`, `infer` and `close`.

        with robospa.connect("ws://127.0.0.1:8000") as policy:
            policy.reset(trial)
            chunk = policy.infer(observation)

    Args:
        url: Address of the server; its scheme is the dialect, its query has the dialect's options.
        token: Sent to the server if it asks for one.
        timeouts: Limits of each kind of answer [s].
        options: Options of the dialect; those in the URL win.
        ssl: Context for `wss://` and `https://`.
        identity: Who the server must be; by default it must stay who it is at the first connection.

    Raises:
        ValueError: The URL or an option is impossible.
        SpecMismatch: The server is another one than `identity`.
        WireError: No server answers there, or not as its dialect requires; all such errors are in
            `robospa.protocol.errors`.
    """
    endpoint, chosen = check_options(url, options)
    params = ConnectionParams(endpoint, timeouts or Timeouts(), token=token, ssl=ssl)
    known = identity is not None
    # A silent server is first given a short time: if it then looks like one of another dialect,
    # nobody waits for minutes.
    hello, handshake = min(PATIENCE, params.timeouts.hello), min(PATIENCE, params.timeouts.connect)
    brief = replace(params, timeouts=replace(params.timeouts, hello=hello, connect=handshake))
    if endpoint.dialect.wire not in ("websocket", "http"):
        brief = params

    def opened() -> WireClient:
        nonlocal known
        try:
            session = endpoint.dialect.open_session(params if known else brief, chosen)
        except errors.Unauthorized as error:
            raise errors.Unauthorized(f"{error}; {TOKEN}") from error.__cause__
        except (errors.HandshakeError, errors.TransportError, errors.ServerError) as error:
            # Once it has spoken this dialect, trouble is trouble and no sign of another one.
            if known or isinstance(error.__cause__, ConnectionRefusedError):
                raise
            explained = explain_error(error, params)
            silent = explained is error and isinstance(error.__cause__, TimeoutError)
            if not silent or brief.timeouts == params.timeouts:
                raise explained from error.__cause__
            session = endpoint.dialect.open_session(params, chosen)
        known = True
        if params.redirects:
            session.hello["redirected_to"] = params.redirects[-1]
        return session

    return RemotePolicy(url, opened, params.timeouts, identity)
