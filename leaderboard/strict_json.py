"""JSON from strangers: one meaning, finite numbers, text that is only text.

Refuses repeated fields, NaN and infinities, nesting without end, control and invisible characters,
and anything in a string that a browser could take for markup or a script.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

from robospa.leaderboard.bundle import BundleError

SUSPECT = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u00ad\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff"
    "\ud800-\udfff]|<[A-Za-z/!?]|javascript:",
    re.IGNORECASE,
)
"""Control, invisible and direction-changing characters; openings of tags; script addresses."""
CLOSER_LOOK = re.compile(rb"[\\<\x7f-\xff]")
"""A line without any of these, and without "javascript:", holds no suspect text."""
DEEP = 16
"""Deeper nesting than any of our files has."""


def parse(data: bytes, what: str) -> Any:
    """The JSON value in `data`; BundleError, naming `what`, if it is not strictly one."""
    value = _decode(data, what)
    look(value, what)
    return value


def parse_map(data: bytes, what: str) -> dict[str, Any]:
    """The JSON object in `data`; BundleError if it is none."""
    return _map(parse(data, what), what)


def parse_row(data: bytes, what: str) -> dict[str, Any]:
    """The JSON object in `data`, whose text is plain; whether its numbers are finite and how deep
    it goes is for the caller to see, who looks at every field of so many rows anyway."""
    value = _map(_decode(data, what), what)
    if CLOSER_LOOK.search(data) or b"javascript:" in data.lower():
        look(value, what)
    return value


def _decode(data: bytes, what: str) -> Any:
    try:
        return json.loads(data.decode(), object_pairs_hook=_object, parse_constant=_no_constant)
    except RecursionError:
        raise BundleError(f"{what} is nested without end") from None
    except ValueError as error:
        raise BundleError(f"{what} is not strict JSON: {_brief(error)}") from None


def _map(value: Any, what: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise BundleError(f"{what} is not a JSON object")
    return value


def look(value: Any, what: str, depth: int = 0) -> None:
    """BundleError if any text in `value` is suspect, a number not finite, or it goes too deep."""
    if depth > DEEP:
        raise BundleError(f"{what} is nested more than {DEEP} deep")
    if isinstance(value, str):
        safe_text(value, what)
    elif isinstance(value, float) and not math.isfinite(value):
        raise BundleError(f"{what} holds a number that is not finite")
    elif isinstance(value, Mapping):
        for name, inner in value.items():
            safe_text(name, what)
            look(inner, what, depth + 1)
    elif isinstance(value, list):
        for inner in value:
            look(inner, what, depth + 1)


def safe_text(text: str, what: str) -> str:
    """`text`; BundleError if it holds markup, a script, or characters that cannot be seen."""
    found = SUSPECT.search(text)
    if found:
        raise BundleError(
            f"{what} holds text that is not plain ({found.group()!a} in {text[:40]!a}): markup, "
            "scripts and invisible characters are refused"
        )
    return text


def is_hash(value: object) -> bool:
    """Whether `value` is a sha256 in lower-case hexadecimal."""
    return isinstance(value, str) and re.fullmatch(r"[0-9a-f]{64}", value) is not None


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a field is there twice")
    return found


def _no_constant(name: str) -> Any:
    raise ValueError(f"{name} is not a number")


def _brief(error: Exception) -> str:
    """The reason, without quoting what may be megabytes."""
    return " ".join(str(error).split())[:120]
