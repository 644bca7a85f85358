"""The rows of a bundle: one a trial, each with the hash of the row before and of its actions.

The chain starts at the hash of the run's inputs, so a row cannot be changed, left out, repeated,
moved or carried into another run without changing every row after it and the last hash, which the
manifest and so the bundle's hash hold. It does not make a record true: replay does.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, fields
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.leaderboard.bundle import BundleError, sha256
from robospa.leaderboard.strict_json import is_hash, look, parse_row
from robospa.results.records.run_io import from_data
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KINDS: dict[str, type] = {"str": str, "int": int, "bool": bool, "float": float}
"""Type of a field by its annotation; a float may be written as a whole number. The fields that are
not plain are looked at by name."""
KEY_KINDS = {f.name: KINDS[str(f.type)] for f in fields(TrialKey)}
PLAIN = {f.name: KINDS[str(f.type)] for f in fields(TrialRecord) if str(f.type) in KINDS}
EVENT: dict[str, type] = {"time": float, "kind": str, "object": str, "index": int, "note": str}
STAMPED = {**EVENT, "step": int}
LATENCY = {"p50", "p95", "p99", "max"}
TOLD = {"queue", "infer", "batch"}
"""Entries of the latency that are only there if the policy's server told them."""
BIG = 2**63


@dataclass(frozen=True)
class Row:
    """A trial's record and the hash of its stored actions."""

    record: TrialRecord
    trace: str


def trace_hash(trace: NDArray[np.float32]) -> str:
    """Hash of stored actions, as little-endian float32."""
    return hashlib.sha256(np.ascontiguousarray(trace, "<f4").data).hexdigest()


def write_rows(rows: Iterable[Row], first: str) -> Iterator[bytes]:
    """The chained lines of `rows`, without newlines, starting from the hash `first`."""
    previous = first
    for row in rows:
        data = {"previous": previous, "trace": row.trace, "record": asdict(row.record)}
        line = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
        previous = sha256(line)
        yield line


def read_rows(lines: Iterable[bytes], first: str, what: str) -> Iterator[tuple[Row, str]]:
    """Every row with the hash up to it; BundleError at the first that is not what it should be."""
    previous = first
    for number, line in enumerate(lines, 1):
        where = f"{what}, row {number}"
        data = parse_row(line, where)
        if set(data) != {"previous", "trace", "record"} or not is_hash(data["trace"]):
            raise BundleError(f"{where} is not a row of previous, trace and record")
        if data["previous"] != previous:
            raise BundleError(
                f"{where} does not follow the row before it: rows were changed, moved or left out"
            )
        previous = sha256(line)
        yield Row(_record(data["record"], where), data["trace"]), previous


def _record(data: Any, where: str) -> TrialRecord:
    """The record in `data`, every field of its type."""
    if not isinstance(data, dict) or not isinstance(data.get("key"), dict):
        raise BundleError(f"{where} has no trial record")
    _check_fields(data["key"], KEY_KINDS, f"{where}, key")
    _check_fields(data, PLAIN, where)
    for name in ("latency", "timing"):
        found = data.get(name)
        if not isinstance(found, dict) or not all(_is(v, float) for v in found.values()):
            raise BundleError(f"{where}: {name} is not a map of numbers")
    if data["latency"] and set(data["latency"]) - TOLD != LATENCY:
        raise BundleError(f"{where}: latency is not p50, p95, p99 and max")
    if not isinstance(data.get("diagnostics"), dict):
        raise BundleError(f"{where}: diagnostics is not a map")
    look(data["diagnostics"], where)
    events = data.get("events")
    if not isinstance(events, list):
        raise BundleError(f"{where}: events is not a list")
    for event in events:
        kinds = STAMPED if isinstance(event, dict) and "step" in event else EVENT
        if not isinstance(event, dict) or len(event) != len(kinds):
            raise BundleError(f"{where} has an event with fields that no event has")
        _check_fields(event, kinds, where)
    try:
        return from_data(data)
    except ValueError as error:
        raise BundleError(f"{where}: {error}") from None


def _check_fields(data: dict[str, Any], kinds: dict[str, type], where: str) -> None:
    for name, kind in kinds.items():
        if not _is(data.get(name), kind):
            found = type(data[name]).__name__ if name in data else "missing"
            raise BundleError(f"{where}: {name} is {found}, not what a record has there")


def _is(value: object, kind: type) -> bool:
    """Whether `value` is of `kind`; True and False are no numbers, other numbers are finite."""
    found = type(value)
    if found is str or found is bool:
        return found is kind
    if found is int:
        return kind in (int, float) and -BIG < value < BIG  # type: ignore[operator]
    return found is float and kind is float and isfinite(value)  # type: ignore[arg-type]
