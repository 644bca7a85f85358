"""Validation of a run's files, which may come from anywhere: field types, ranges, printable text.

Names become parts of paths, so only plain ones pass. The leaderboard is stricter still
(`leaderboard.strict_json`).
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

from robospa.results.records.trial_record import END_REASONS, TrialRecord
from robospa.trial import TrialKey

MANIFEST_MAPS = (
    "settings",
    "settings.policy",
    "settings.policy.spec",
    "settings.policies",
    "settings.world",
    "about",
    "about.policy",
    "about.policies",
    "about.versions",
    "about.machine",
    "about.world",
    "about.git",
    "about.arguments",
    "categories",
)
"""Parts of a run's manifest that are maps; every one after the ones that it is in."""
MANIFEST_VALUES: dict[str, tuple[type, ...]] = {
    "suite": (str,),
    "seed_hash": (str,),
    "settings.policy.spec.name": (str,),
    "settings.step_scale": (int, float),
    "settings.privileged": (bool,),
    "about.code": (str,),
    "about.warnings": (list,),
}
NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
"""Names that become parts of paths."""
MAX_INTEGER = 2**53
"""Largest integer of a field: larger ones are not exact as a double."""
TEXTS = (
    "category",
    "instruction",
    "scene_digest",
    "end",
    "digest",
    "actions_digest",
    "message",
    "video",
)
COUNTS = (
    "done",
    "best",
    "total",
    "candidates",
    "steps",
    "physics_steps",
    "policy_calls",
    "attempts",
    "policy_seed",
)
MAPS = ("latency", "timing", "diagnostics")


def parse(text: str) -> Any:
    """The JSON value in `text`; ValueError if it is none, has a field twice, is nested without
    end, or holds text that cannot be written down."""
    try:
        value = json.loads(text, object_pairs_hook=_without_repeats)
    except RecursionError:
        raise ValueError("it is nested without end") from None
    except ValueError as error:
        raise ValueError(str(error)[:200]) from None
    if "\\u" in text or "\\U" in text:  # half a character: no file and no terminal takes it
        try:
            json.dumps(value, ensure_ascii=False).encode()
        except UnicodeEncodeError:
            raise ValueError("it holds half of a character (a lone surrogate)") from None
    return value


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; one that says the same thing twice is refused: which one would be true?"""
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        twice = next(name for name, _ in pairs if name in seen or seen.add(name))  # type: ignore[func-returns-value]
        raise ValueError(f"the field {twice[:80]!r} is there twice")
    return found


def check_manifest(manifest: Mapping[str, Any]) -> None:
    """ValueError, naming the part, if one that is there is not of its kind."""
    for path in MANIFEST_MAPS:
        _at(manifest, path, (dict,), "map")
    for path, kinds in MANIFEST_VALUES.items():
        _at(manifest, path, kinds, "value of its kind")
    for category in manifest.get("categories", {}).values():
        if not isinstance(category, str):
            raise ValueError("categories are not all text")
    if not _is_number(manifest.get("settings", {}).get("step_scale", 1.0)):
        raise ValueError("settings.step_scale is no number")


def _at(manifest: Mapping[str, Any], path: str, kinds: tuple[type, ...], what: str) -> None:
    value: Any = manifest
    for name in path.split("."):
        if name not in value:
            return
        value = value[name]
    if type(value) not in kinds:
        raise ValueError(f"{path} is no {what}")


def check_key(key: TrialKey) -> None:
    """ValueError unless `key` is made of plain names and numbers."""
    for name in (key.task, key.embodiment, key.mode, key.split):
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise ValueError(f"{str(name)[:80]!r} is no plain name of a task, robot, mode or split")
    for number in (key.level, key.seed):
        if type(number) is not int or not 0 <= number <= MAX_INTEGER:
            raise ValueError(f"{str(number)[:80]} is no level or seed")


def check_record(record: TrialRecord) -> None:
    """ValueError, naming the field, unless every field is of its kind."""
    check_key(record.key)
    values = record.__dict__
    for name in TEXTS:
        if not isinstance(values[name], str):
            raise ValueError(f"{name} is no text")
    for name in COUNTS:
        if type(values[name]) is not int or not 0 <= values[name] <= MAX_INTEGER:
            raise ValueError(f"{name} {str(values[name])[:40]} is no count")
    for name in MAPS:
        if not isinstance(values[name], Mapping):
            raise ValueError(f"{name} is no map")
    if record.end not in END_REASONS:
        raise ValueError(f"end {record.end[:40]!r} is none of {', '.join(END_REASONS)}")
    if type(record.success) is not bool:
        raise ValueError("success is neither true nor false")
    if not _is_number(record.wall_time):
        raise ValueError("wall_time is no number")
    for event in record.events:
        if not _is_event(event):
            raise ValueError(f"{str(event)[:120]} is no event")
    for name in ("latency", "timing"):
        for value in values[name].values():
            if not _is_number(value):
                raise ValueError(f"{name} is no map to numbers")


def _is_event(event: Any) -> bool:
    """Written for speed: a run has hundreds of thousands of them."""
    if type(event) is not dict:
        return False
    get = event.get
    time, index, step = get("time", 0.0), get("index", 0), get("step", 0)
    return (
        type(get("kind")) is str
        and type(get("object", "")) is str
        and type(get("note", "")) is str
        and type(index) is int
        and type(step) is int
        and -MAX_INTEGER <= index <= MAX_INTEGER
        and -MAX_INTEGER <= step <= MAX_INTEGER
        and type(time) in (int, float)
        and -MAX_INTEGER <= time <= MAX_INTEGER
    )


def _is_number(value: object) -> bool:
    if type(value) is int:
        return abs(value) <= MAX_INTEGER
    return type(value) is float and math.isfinite(value)
