"""Typed access to the fields of a decoded map; every refusal names the field and what came."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from robospa.protocol.errors import DecodeError

MISSING: Any = object()
TOLD = 2**16
"""Characters of a server's words about itself that a run keeps."""
IDENTIFIER = re.compile(r"(?:[A-Za-z0-9_+-][A-Za-z0-9_.+-]{0,127})?")


class Fields:
    """A map with string keys, read field by field. Unknown fields are left alone: they belong to
    later minor versions."""

    def __init__(self, what: str, value: Any) -> None:
        if not isinstance(value, Mapping) or not all(type(key) is str for key in value):
            raise DecodeError(f"{what} is not a map with text keys but {kind(value)}")
        self.what = what
        self.value = value

    def raw(self, name: str, default: Any = MISSING) -> Any:
        found = self.value.get(name, default)
        if found is MISSING:
            raise DecodeError(f"{self.what} lacks the field {name!r}")
        return found

    def refuse(self, name: str, wanted: str, found: Any) -> DecodeError:
        return DecodeError(f"{self.what}: {name!r} must be {wanted}, not {kind(found)}")

    def text(self, name: str, default: Any = MISSING, choices: tuple[str, ...] = ()) -> str:
        found = self.raw(name, default)
        if type(found) is not str:
            raise self.refuse(name, "text", found)
        if choices and found not in choices:
            raise self.refuse(name, f"one of {', '.join(choices)}", found)
        return found

    def name(self, name: str, default: Any = MISSING) -> str:
        """Text for people; see `is_name`."""
        found = self.text(name, default)
        if not is_name(found):
            raise self.refuse(name, "printable text of at most 200 characters", found)
        return found

    def identifier(self, name: str) -> str:
        """Text that is safe as part of a file's name; may be empty."""
        found = self.text(name)
        if not IDENTIFIER.fullmatch(found):
            wanted = "at most 128 letters, digits and _ - . +, and not begin with a dot"
            raise DecodeError(f"{self.what}: {name!r} must be {wanted}, not {found[:40]!r}")
        return found

    def whole(
        self, name: str, default: Any = MISSING, low: int = -(2**63), high: int = 2**63 - 1
    ) -> int:
        found = self.raw(name, default)
        if type(found) is not int or not low <= found <= high:
            raise self.refuse(name, f"a whole number from {low} to {high}", found)
        return found

    def flag(self, name: str, default: Any = MISSING) -> bool:
        found = self.raw(name, default)
        if type(found) is not bool:
            raise self.refuse(name, "true or false", found)
        return found

    def items(self, name: str, default: Any = MISSING) -> list[Any]:
        found = self.raw(name, default)
        if not isinstance(found, (list, tuple)):
            raise self.refuse(name, "a list", found)
        return list(found)

    def map(self, name: str, default: Any = MISSING) -> dict[str, Any]:
        found = self.raw(name, default)
        if not isinstance(found, Mapping) or not all(type(key) is str for key in found):
            raise self.refuse(name, "a map with text keys", found)
        return dict(found)


def is_name(value: Any) -> bool:
    """Whether `value` can stand in a table or on a terminal as it is."""
    return type(value) is str and len(value) <= 200 and value.isprintable()


def as_said(value: Any, most: int = TOLD) -> Any:
    """What a server says about itself as JSON values, for the record of a run: arrays as lists,
    numbers that JSON has not as text; more than `most` characters of it are left out."""
    found = _plain(value)
    size = len(json.dumps(found))
    return found if size <= most else f"left out: {size} characters"


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else repr(value)


def kind(value: Any) -> str:
    """A short name for what came instead."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return repr(value)[:60]
    return f"a {type(value).__name__}"
