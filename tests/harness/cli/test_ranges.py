"""Every number on a command line has bounds, and a refusal says them."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Iterator

import pytest
import typer

from robospa.harness.cli.main import COMMANDS, command_of, main

CHECKED_LATER = ("level", "fraction")  # where it is known what there is


def functions() -> Iterator[tuple[str, Callable[..., object]]]:
    """Every command of the command line, by name."""
    for name in COMMANDS:
        found = command_of(name)
        if isinstance(found, typer.Typer):
            for each in found.registered_commands:
                assert each.callback is not None
                yield f"{name} {each.callback.__name__}", each.callback
        else:
            yield name, found


def numbers() -> Iterator[tuple[str, typing.Any]]:
    """Every numeric flag that is no setting of an evaluation, and what it was made with."""
    for command, function in functions():
        own = [p.name for p in inspect.signature(inspect.unwrap(function)).parameters.values()]
        hints = typing.get_type_hints(function, include_extras=True)
        for name in own:
            hint = hints.get(name)
            made = getattr(hint, "__metadata__", [None])[-1]
            kinds = set(
                typing.get_args(getattr(hint, "__origin__", None))
                or [getattr(hint, "__origin__", None)]
            )
            if kinds & {int, float} and name not in CHECKED_LATER:
                yield f"{command} --{name}", made


NUMBERS = dict(numbers())


def test_there_are_such_flags() -> None:
    assert {"check --timeout", "submit block --trials", "seeds --count"} < set(NUMBERS)


@pytest.mark.parametrize("name", NUMBERS)
def test_no_flag_takes_every_number(name: str) -> None:
    made = NUMBERS[name]
    if made.callback is None:
        assert made.min is not None, name
        return
    for value in (float("nan"), float("inf"), -(10**9), 10**20):
        with pytest.raises(typer.BadParameter, match="is not from"):
            made.callback(value)
    assert made.callback(1) == 1


def test_a_refusal_says_the_range(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["check", "ws://127.0.0.1:9", "--timeout", "-5"])
    assert stop.value.code == 2
    assert "-5 is not from 0.001 to 604800" in capsys.readouterr().err
