"""Named, typed options: what a server does not report about itself, and how one is started.

Every dialect, and every server of ours that loads a model, has a frozen dataclass whose fields are
its conventions: made with `option(...)`, each has a default, a sentence of help and, where there
are few, its choices. They are set in a URL (`go1+http://host:9000?wrists=swapped`), on the command
line (`robospa serve rdt --option ctrl_freq=25`) or in a JSON file, and checked here.
"""

import dataclasses
import math
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import parse_qsl

import msgspec

from robospa.registry import did_you_mean
from robospa.schema import convert

T = TypeVar("T")


@dataclass(frozen=True)
class OptionRow:
    """An option for people: its name, default, choices (or type) and help."""

    name: str
    default: str
    values: str
    help: str


def option(default: Any, help: str, choices: Sequence[str] = (), needed: bool = False) -> Any:
    """A field of an options dataclass; one that is `needed` may not be left empty."""
    told = {"help": help, "choices": tuple(choices), "needed": needed}
    return dataclasses.field(default=default, metadata=told)


def read_options(cls: type[T], given: Mapping[str, Any]) -> T:
    """An options dataclass from JSON values or from texts of a URL; ValueError in one sentence."""
    hints = typing.get_type_hints(cls)
    known = {field.name: field for field in dataclasses.fields(cls)}  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for name, value in given.items():
        if name not in known:
            near = did_you_mean(name, known)
            raise ValueError(f"there is no option {name!r}; {near}known are {', '.join(known)}")
        values[name] = _read(name, value, hints[name])
        choices = known[name].metadata.get("choices", ())
        if choices and values[name] not in choices:
            raise ValueError(f"option {name}={value!r} is not one of {', '.join(choices)}")
    made = cls(**values)
    check_ranges(made)
    return made


def check_ranges(options: object) -> None:
    """Raises ValueError, in one sentence that says what is allowed, for a number of an options
    dataclass that is not finite or not within the bounds (msgspec's `Meta`) of its annotation, and
    for an option that is needed and not given."""
    for field in dataclasses.fields(options):  # type: ignore[arg-type]
        if field.metadata.get("needed") and not getattr(options, field.name):
            raise ValueError(f"option {field.name} is needed: {field.metadata['help']}")
    for name, hint in typing.get_type_hints(type(options), include_extras=True).items():
        value = getattr(options, name)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            continue
        rules = [rule for kind in _alternatives(hint) for rule in getattr(kind, "__metadata__", ())]
        bounds = next((r for r in rules if isinstance(r, msgspec.Meta)), msgspec.Meta())
        within = (
            (bounds.ge is None or value >= bounds.ge)
            and (bounds.gt is None or value > bounds.gt)
            and (bounds.le is None or value <= bounds.le)
        )
        if not within or (isinstance(value, float) and not math.isfinite(value)):
            raise ValueError(f"{name} is {str(value)[:40]}, and must be {_range(bounds)}")


def _range(bounds: msgspec.Meta) -> str:
    """Bounds in words."""
    limits = {"at least": bounds.ge, "more than": bounds.gt, "at most": bounds.le}
    words = [
        f"{word} {limit:g}" if limit < 1e6 else f"{word} {limit}"
        for word, limit in limits.items()
        if limit is not None
    ]
    return " and ".join(words) or "a finite number"


def url_options(query: str) -> dict[str, str]:
    """The options in a URL's query; ValueError if one is given twice or is no `name=value`."""
    pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
    names = [name for name, _ in pairs]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ValueError(f"option {twice!r} is given twice in the URL")
    return dict(pairs)


def plain_options(options: Any) -> dict[str, Any]:
    """All options as JSON values, the defaults too."""
    found = dataclasses.asdict(options)
    for name, value in found.items():
        if isinstance(value, tuple | Path):
            found[name] = list(value) if isinstance(value, tuple) else str(value)
    return found


def option_table(cls: type[Any]) -> list[OptionRow]:
    """All options, one row each, for documents and help."""
    hints = typing.get_type_hints(cls)
    rows = []
    for field in dataclasses.fields(cls):
        choices = field.metadata.get("choices", ())
        values = ", ".join(choices) if choices else _type_name(hints[field.name])
        plain = field.default is None or isinstance(field.default, bool)
        shown = str(field.default).lower() if plain else str(field.default)
        rows.append(OptionRow(field.name, shown, values, field.metadata.get("help", "")))
    return rows


def _read(name: str, value: Any, hint: Any) -> Any:
    """One option as its annotation has it; texts of a URL count as the numbers they spell."""
    allowed = _alternatives(hint)
    if isinstance(value, str):
        if value in ("", "none") and type(None) in allowed:
            value = None
        elif bool in allowed:
            value = {"yes": True, "on": True, "no": False, "off": False}.get(value.lower(), value)
        elif allowed == (tuple[str, ...],):
            value = (value,)
    try:
        return convert(value, hint, strict=False, dec_hook=_decode)
    except msgspec.ValidationError:
        text = str(value)[:80]
        raise ValueError(f"option {name}={text!r} is not a {_type_name(hint)}") from None


def _decode(kind: type[Any], value: Any) -> Any:
    """What msgspec does not read by itself."""
    if kind is not Path:
        raise NotImplementedError(f"an option cannot be a {kind.__name__}")
    return Path(value)


def _alternatives(hint: Any) -> tuple[Any, ...]:
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        return typing.get_args(hint)
    return (hint,)


def _type_name(hint: Any) -> str:
    names = {
        bool: "yes or no",
        int: "whole number",
        float: "number",
        str: "text",
        Path: "path",
        tuple[str, ...]: "list of texts",
        tuple[int, ...]: "list of whole numbers",
    }
    kinds = [k for k in _alternatives(hint) if k is not type(None)]
    return " or ".join(names.get(kind, str(kind)) for kind in kinds)
