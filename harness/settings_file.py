"""Settings as a file: TOML or JSON, one table a group, as a run keeps them.

    policy = ["ws://gpu1:8000", "ws://gpu2:8000"]

    [selection]
    tasks = "spatial"
    trials = 10

Paths in it are relative to the folder in which the command runs, as on the command line. A file
need not name every setting; the others have their defaults.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path

from robospa.harness.settings import (
    GROUPS,
    EvaluationSettings,
    SettingsError,
    Value,
    group_of,
    plain,
    updated,
)

FILE = "settings.toml"
"""In a run's folder: its settings, to be given to `robospa eval --config`."""
MOST_BYTES = 2**20
SECRETS = ("token",)


def read_settings(path: Path) -> EvaluationSettings:
    """The settings in the file at `path`: JSON if it is called so, else TOML.

    Raises SettingsError, naming the file, if it cannot be read, has an unknown key or a value that
    is impossible.
    """
    try:
        return updated(EvaluationSettings(), _values(_parse(path)))
    except SettingsError as error:
        raise SettingsError(f"{path}: {error}") from error


def to_toml(settings: EvaluationSettings) -> str:
    """All settings, the defaults too, as TOML that `read_settings` reads."""
    lines: list[str] = []
    for group, values in plain(settings).items():
        if group:
            lines += ["", f"[{group}]"]
        lines += [f"{name} = {_toml(v)}" for name, v in values.items() if v is not None]
    return "\n".join(lines) + "\n"


def _toml(value: Value) -> str:
    """A value of TOML: as in JSON, but for infinite numbers and one character."""
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _parse(path: Path) -> Mapping[str, object]:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise SettingsError(f"it has more than {MOST_BYTES} bytes")
        text = path.read_text()
        found = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except OSError as error:
        raise SettingsError(f"it cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        kind = "JSON" if path.suffix == ".json" else "TOML"
        raise SettingsError(f"it is no {kind} ({str(error)[:200]})") from error
    if not isinstance(found, dict):
        raise SettingsError("it is no map of settings")
    return found


def _values(data: Mapping[str, object]) -> dict[str, object]:
    """The settings in a file's `data`, by name without their groups."""
    values: dict[str, object] = {}
    for name, value in data.items():
        if name not in GROUPS:
            values |= _known("", {name: value})
        elif isinstance(value, dict):
            values |= _known(name, value)
        else:
            raise SettingsError(f"{name} is a group of settings: write a table [{name}]")
    return values


def _known(group: str, values: Mapping[str, object]) -> Mapping[str, object]:
    """`values` if all of them are settings of `group`; raises SettingsError with near matches."""
    groups = group_of()
    for name in values:
        if name in SECRETS:
            raise SettingsError(
                f"a {name} does not belong in a file: use --{name} or ROBOSPA_{name.upper()}"
            )
        if groups.get(name) != group:
            near = get_close_matches(name, [*groups, *GROUPS], n=1)
            hint = f"did you mean {_place(near[0])}? " if near else ""
            where = f"[{group}]" if group else "the top level"
            known = [n for n, g in groups.items() if g == group] + ([] if group else list(GROUPS))
            raise SettingsError(
                f"{where} has no setting {name!r}; {hint}known there are {', '.join(known)}"
            )
    return values


def _place(name: str) -> str:
    """The place of a setting in a file, for messages."""
    group = group_of().get(name)
    return f"{name} of [{group}]" if group else f"[{name}]" if name in GROUPS else name
