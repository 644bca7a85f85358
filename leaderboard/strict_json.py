"""JSON from strangers: one meaning, finite numbers, text that is only text.

Refuses repeated fields, NaN and infinities, nesting without end, control and invisible characters,
and anything in a string that a browser could take for markup or a script. Types are not checked
here: `robospa.schema.read` does that with the value that comes out.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from robospa.leaderboard.bundle import BundleError
from robospa.schema import parse_json

SUSPECT = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u00ad\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff"
    "\ud800-\udfff]|<[A-Za-z/!?]|javascript:",
    re.IGNORECASE,
)
"""Control, invisible and direction-changing characters; openings of tags; script addresses."""
CLOSER_LOOK = re.compile(rb"[\\<\x7f-\xff]")
"""A line without any of these, and without "javascript:", holds no suspect text."""
MAX_DEPTH = 16
"""Deeper nesting than any of our files has."""


def parse(data: bytes, what: str) -> object:
    """The JSON value in `data`; BundleError, naming `what`, if it is not strictly one."""
    value = _decode(data, what)
    check_text(value, what)
    return value


def parse_map(data: bytes, what: str) -> dict[str, object]:
    """The JSON object in `data`; BundleError if it is none."""
    return _map(parse(data, what), what)


def parse_row(data: bytes, what: str) -> dict[str, object]:
    """The JSON object in `data`, whose text is plain. Whether its numbers are finite and how deep
    it is nested is left to the caller, who checks every field of so many rows anyway."""
    value = _map(_decode(data, what), what)
    if CLOSER_LOOK.search(data) or b"javascript:" in data.lower():
        check_text(value, what)
    return value


def _decode(data: bytes, what: str) -> object:
    try:
        value: object = parse_json(data.decode())
    except ValueError as error:
        raise BundleError(f"{what} is not strict JSON: {str(error)[:120]}") from None
    return value


def _map(value: object, what: str) -> dict[str, object]:
    if not isinstance(value, dict):
        raise BundleError(f"{what} is not a JSON object")
    return value


def check_text(value: object, what: str, depth: int = 0) -> None:
    """BundleError if any text in `value` is suspect, a number not finite, or it goes too deep."""
    if depth > MAX_DEPTH:
        raise BundleError(f"{what} is nested more than {MAX_DEPTH} deep")
    if isinstance(value, str):
        _check_string(value, what)
    elif isinstance(value, float) and not math.isfinite(value):
        raise BundleError(f"{what} holds a number that is not finite")
    elif isinstance(value, Mapping):
        for name, inner in value.items():
            _check_string(name, what)
            check_text(inner, what, depth + 1)
    elif isinstance(value, list):
        for inner in value:
            check_text(inner, what, depth + 1)


def _check_string(text: str, what: str) -> None:
    found = SUSPECT.search(text)
    if found:
        raise BundleError(
            f"{what} holds text that is not plain ({found.group()!a} in {text[:40]!a}): markup, "
            "scripts and invisible characters are refused"
        )
