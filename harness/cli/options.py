"""What commands share: flags made from settings, bounds of numbers, JSON output."""

import inspect
import math
import sys
import typing
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import fields
from typing import Annotated, TypeVar

import typer

SPELLINGS = {
    "embodiment": ("--embodiment", "--embodiments"),
    "trials": ("--trials", "--episodes"),
    "out": ("--out", "--output"),
}
"""Flags that are written in several ways: one robot, several; as other evaluators call them."""
AsJson = Annotated[bool, typer.Option("--json", help="print JSON; progress on standard error")]
Token = Annotated[
    str | None, typer.Option(envvar="ROBOSPA_TOKEN", help="bearer token of the server")
]
F = TypeVar("F", bound=Callable[..., object])


def print_json(found: object) -> None:
    """Print `found`, of plain values, dataclasses and paths, as JSON."""
    import json

    from msgspec import to_builtins

    print(json.dumps(to_builtins(found, enc_hook=str), indent=1))


def aside(text: str) -> None:
    """Print `text` on standard error."""
    print(text, file=sys.stderr, flush=True)


# -- bounds of numbers that are no settings of an evaluation ----------------------------------


def between(low: float, high: float) -> Callable[[float | None], float | None]:
    """A callback of a flag: refuses a number that is not from `low` to `high`, in one sentence."""

    def check(value: float | None) -> float | None:
        if value is not None and not (math.isfinite(value) and low <= value <= high):
            raise typer.BadParameter(f"{value:g} is not from {low:g} to {high:g}")
        return value

    return check


DAYS = between(0, 7 * 24 * 3600)
"""Seconds, at most a week."""
SECONDS = between(1e-3, 7 * 24 * 3600)
"""The same, but some."""
PORT = between(0, 65535)
PROCESSES = between(0, 4096)
TRIALS = between(1, 1_000_000)
SEED = between(0, 2**63 - 1)
SHARE = between(0, 1)


# -- flags made from settings -----------------------------------------------------------------


def _show_all(context: typer.Context, value: bool) -> None:
    if value:
        for one in context.command.params:
            if getattr(one, "rich_help_panel", None):
                setattr(one, "hidden", False)  # noqa: B010
        print(context.get_help())
        raise typer.Exit


HELP_ALL = inspect.Parameter(
    "help_all",
    inspect.Parameter.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[
        bool,
        typer.Option(
            "--help-all", is_eager=True, callback=_show_all, help="show all options and exit"
        ),
    ],
)


def with_flags(
    kinds: Collection[type], without: Collection[str] = (), first: Collection[str] = ()
) -> Callable[[F], F]:
    """Give a command, beside its own parameters, a flag for every field of the dataclasses `kinds`.

    Those called `first` stand in its help, all others only under --help-all, in a section for each
    group of settings. The command gets the values as keywords: it takes `**given`, whose place they
    have in its signature.
    """

    def decorate(command: F) -> F:
        signature = inspect.signature(command, eval_str=True)
        own = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
        flags = [flag for kind in kinds for flag in _flags(kind, without, first)]
        command.__dict__["__signature__"] = signature.replace(parameters=[*own, HELP_ALL, *flags])
        return command

    return decorate


def _flags(
    kind: type, without: Collection[str], first: Collection[str]
) -> Iterator[inspect.Parameter]:
    hints = typing.get_type_hints(kind)
    for field in fields(kind):
        if field.name in without or "help" not in field.metadata:
            continue
        about = typer.Option(
            *SPELLINGS.get(field.name, ()),
            help=field.metadata["help"],
            hidden=field.name not in first,
            rich_help_panel=kind.__name__.removesuffix("Settings"),
            autocompletion=_completion(field.metadata["choices"]),
        )
        yield inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=Annotated[hints[field.name], about],
        )


def _completion(choices: Sequence[str]) -> Callable[[str], list[str]] | None:
    def continued(incomplete: str) -> list[str]:
        return [choice for choice in choices if choice.startswith(incomplete)]

    return continued if choices else None


def given_flags(context: typer.Context) -> dict[str, object]:
    """The parameters of a command that were given a value on the command line."""
    return {
        name: value
        for name, value in context.params.items()
        if (source := context.get_parameter_source(name)) is not None and source.name != "DEFAULT"
    }
