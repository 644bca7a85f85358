"""`robospa serve`: a policy of this installation behind a WebSocket."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def serve(
    policy: Annotated[str, typer.Argument(help="oracle, random, hold, replay, or module:function")],
    host: Annotated[str, typer.Option(help="address to listen on")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="port to listen on; 0 for any free one")] = 8000,
    token: Annotated[
        str | None, typer.Option(envvar="ROBOSPA_TOKEN", help="bearer token that clients need")
    ] = None,
    arg: Annotated[
        list[str] | None, typer.Option(help="NAME=VALUE for the policy's function; repeatable")
    ] = None,
    certificate: Annotated[Path | None, typer.Option(help="TLS certificate chain (PEM)")] = None,
    key: Annotated[Path | None, typer.Option(help="TLS private key (PEM)")] = None,
) -> None:
    """Serve a policy until interrupted. Every connection gets a policy of its own."""
    import logging
    from functools import partial

    from robospa.harness.factory import policy_factory
    from robospa.protocol.server import serve as run_server

    logging.basicConfig(level=logging.WARNING, format="robospa: %(message)s")
    make = partial(policy_factory(policy), **_arguments(arg or []))
    make()  # a factory that fails should do so before anybody connects
    tls = None
    if certificate is not None:
        import ssl

        tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        tls.load_cert_chain(certificate, key)

    def ready(url: str) -> None:
        print(f"serving {policy} at {url} (Ctrl-C stops)", flush=True)

    run_server(policy_factory=make, host=host, port=port, token=token, ssl=tls, on_ready=ready)


def _arguments(words: list[str]) -> dict[str, str]:
    pairs = [word.partition("=") for word in words]
    wrong = [name for name, equals, _ in pairs if not equals or not name.isidentifier()]
    if wrong:
        raise typer.BadParameter(f"--arg {wrong[0]!r} is not NAME=VALUE")
    return {name: value for name, _, value in pairs}
