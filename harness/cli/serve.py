"""`robospa serve`: a policy of this installation behind a WebSocket.

Runs in the environment of the policy's model, on Python 3.10 as well, and imports nothing of the
simulator.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robospa.harness.cli.options import PORT

if TYPE_CHECKING:
    from ssl import SSLContext

    from robospa.protocol.options import OptionRow


MACHINE = ("device", "t5_device", "batch", "code", "endpoint", "key", "parallel", "log")
"""Options that a server's name leaves out: a policy is the same wherever its model runs."""
WEIGHTS = ("checkpoint", "path")
"""The same for a policy whose spec names its checkpoint."""


class BadOptions(Exception):
    """The policy cannot be started with these options; the message says why."""


def serve(
    policy: Annotated[
        str,
        typer.Argument(
            help="agent, learned, rdt, lerobot, go1, xvla, openpi, oracle, reactive, random, "
            "hold, replay, mistakes, tries-all, presses-all, commonest, or module:function"
        ),
    ],
    checkpoint: Annotated[
        Path | None, typer.Argument(help="weights of robospa learn: the path of `learned`")
    ] = None,
    host: Annotated[str, typer.Option(help="address to listen on")] = "127.0.0.1",
    port: Annotated[int, typer.Option(callback=PORT, help="port; 0 for any free one")] = 8000,
    token: Annotated[
        str | None, typer.Option(envvar="ROBOSPA_TOKEN", help="bearer token that clients need")
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option("--option", "--arg", help="NAME=VALUE for the policy; repeatable"),
    ] = None,
    endpoint: Annotated[
        str | None, typer.Option(metavar="URL", help="of `agent`: an OpenAI-compatible endpoint")
    ] = None,
    model: Annotated[str | None, typer.Option(help="of `agent`: the model's name there")] = None,
    options: Annotated[
        Path | None, typer.Option(help="JSON file with such options; --option wins")
    ] = None,
    show_options: Annotated[
        bool, typer.Option("--show-options", help="list the policy's options and exit")
    ] = False,
    certificate: Annotated[Path | None, typer.Option(help="TLS certificate chain (PEM)")] = None,
    key: Annotated[Path | None, typer.Option(help="TLS private key (PEM)")] = None,
    connections: Annotated[
        int, typer.Option(min=1, help="clients served at once; others wait briefly, then get 503")
    ] = 256,
) -> None:
    """Serve a policy until interrupted.

    A learned model is loaded once and serves every connection; other policies are made anew for
    each.
    """
    import logging

    from robospa.harness.factory import policy_factory
    from robospa.protocol.server import serve as run_server

    logging.basicConfig(level=logging.WARNING, format="robospa: %(message)s")
    make = policy_factory(policy)
    if show_options:
        return _show_options(policy, make)
    given = {**_from_file(options), **option_pairs(option or [])}
    short = {"path": checkpoint, "endpoint": endpoint, "model": model}
    given |= {name: str(value) for name, value in short.items() if value is not None}
    with _named_port(host, port):
        run_server(
            host=host,
            port=port,
            token=token,
            ssl=_tls(certificate, key),
            on_ready=lambda url: print(f"serving {policy} at {url} (Ctrl-C stops)", flush=True),
            **hosted(policy, make, given, connections),
        )


@contextmanager
def _named_port(host: str, port: int) -> Iterator[None]:
    """Raises BadOptions, with what to do, in place of the system's error for a port in use."""
    import errno

    try:
        yield
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise
        text = f"port {port} of {host} is in use: choose another --port (0 takes a free one)"
        raise BadOptions(text) from error


def _tls(certificate: Path | None, key: Path | None) -> SSLContext | None:
    import ssl

    if certificate is None and key is not None:
        raise BadOptions("--key is that of a --certificate: without one nothing is encrypted")
    if certificate is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key)
    except OSError as error:
        files = f"--certificate {certificate}" + (f" and --key {key}" if key else "")
        raise BadOptions(f"{files} cannot be used: {error.strerror or error}") from error
    return context


def options_class(make: Callable[..., object]) -> type[Any] | None:
    """The dataclass of options that annotates the only parameter of a policy's function; None if
    the function takes plain texts."""
    import dataclasses
    import inspect

    if len(inspect.signature(make).parameters) != 1:
        return None
    (only,) = inspect.signature(make, eval_str=True).parameters.values()
    found = only.annotation
    return found if isinstance(found, type) and dataclasses.is_dataclass(found) else None


def hosted(
    policy: str, make: Callable[..., Any], given: dict[str, object], connections: int = 256
) -> dict[str, Any]:
    """What the server runs: a shared policy or a factory of one per connection, and its options."""
    from functools import partial
    from importlib import metadata

    from robospa.protocol.connection_limits import ServerOptions
    from robospa.protocol.options import read_options

    kind, hint = options_class(make), f"see robospa serve {policy} --show-options"
    if kind is None:
        factory = partial(make, **given)
        try:
            factory()  # one that fails should do so before anybody connects
        except TypeError as error:
            raise BadOptions(f"{policy} cannot be made: {error} ({hint})") from error
        return {"policy_factory": factory, "options": ServerOptions(max_connections=connections)}
    try:
        chosen = read_options(kind, given)
    except ValueError as error:
        raise BadOptions(f"{policy} cannot be served: {error} ({hint})") from error
    made = make(chosen)
    name = " ".join(["robospa", metadata.version("robospa"), policy, *_changed(chosen, made)])
    return {
        "policy_factory" if callable(made) else "policy": made,
        # The name reaches every client, and so a run's manifest.
        "options": ServerOptions(
            name=name, max_connections=connections, threads=getattr(made, "threads", 1)
        ),
    }


def _changed(options: Any, made: Any) -> list[str]:
    import dataclasses

    named = bool(getattr(getattr(made, "spec", None), "checkpoint", ""))
    out = (*MACHINE, *WEIGHTS) if named else MACHINE
    decide = [field for field in dataclasses.fields(options) if field.name not in out]
    pairs = [(field, getattr(options, field.name)) for field in decide]
    return [f"{field.name}={value}" for field, value in pairs if value != field.default]


def _show_options(policy: str, make: Callable[..., object]) -> None:
    from robospa.protocol.options import option_table

    kind = options_class(make)
    if kind is None:
        import inspect

        names = ", ".join(inspect.signature(make).parameters) or "none"
        return print(f"options of {policy}: {names}")
    print_options(option_table(kind))


def print_options(rows: Sequence[OptionRow]) -> None:
    """Print a table of options, one per line."""
    width = max(len(row.name) for row in rows)
    for row in rows:
        print(f"{row.name:<{width}}  {row.help} [{row.values}; default {row.default or 'needed'}]")


def _from_file(path: Path | None) -> dict[str, object]:
    if path is None:
        return {}
    import json

    try:
        value = json.loads(path.read_text())
    except ValueError as error:
        raise BadOptions(f"{path} is no JSON: {error}") from error
    if not isinstance(value, dict):
        raise BadOptions(f"{path} must hold one JSON object of options")
    return value


def option_pairs(words: list[str]) -> dict[str, str]:
    """The options of words NAME=VALUE; typer.BadParameter for others, and for a name twice."""
    pairs = [word.partition("=") for word in words]
    wrong = [name for name, equals, _ in pairs if not equals or not name.isidentifier()]
    if wrong:
        raise typer.BadParameter(f"--option {wrong[0]!r} is not NAME=VALUE")
    names = [name for name, _, _ in pairs]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise typer.BadParameter(f"--option {twice!r} is given twice")
    return {name: value for name, _, value in pairs}
