"""Trial records as lines of JSON, and whole runs read back from their folder.

A line that was torn off at the end of a file (the writer was killed) is dropped: that trial is owed
again. Anything else that is not a record is refused, naming file and line. Two records of one trial
must agree on everything that a repeatable world decides; if not, that is a `RepeatabilityError`.
A run may come from strangers: names become paths, so they are plain; see `results.strangers`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from robospa.results.records.schema import check_key, check_manifest, check_record, parse
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

TRIALS = "trials"
"""Folder inside a run that holds the record files."""
MANIFEST = "run.json"

DECIDED = (
    "instruction",
    "scene_digest",
    "end",
    "success",
    "done",
    "best",
    "total",
    "steps",
    "physics_steps",
    "digest",
    "actions_digest",
)
"""Fields that have to be equal in every record of one trial."""
FIELDS = frozenset(f.name for f in fields(TrialRecord))
FORMAT = 1
"""Version of a run's folder. A newer one is refused."""
MOST_RECORDS = 2**30
MOST_MANIFEST = 2**26
"""Bytes of a file of records and of `run.json`, at most: more is read of neither."""


class RunError(Exception):
    """A run's folder cannot be read; the message names file and line."""


class RepeatabilityError(RunError):
    """Two records of the same trial differ: the world or the policy is not repeatable."""


@dataclass(frozen=True)
class Run:
    """A run read back: its manifest, the trials it is to hold, and one record per finished one."""

    folder: Path
    manifest: Mapping[str, Any]
    keys: tuple[TrialKey, ...]
    records: Mapping[TrialKey, TrialRecord]

    @property
    def missing(self) -> tuple[TrialKey, ...]:
        """Listed trials without a result: never run, or lost to infrastructure errors."""
        return tuple(k for k in self.keys if not finished(self.records.get(k)))


def finished(record: TrialRecord | None) -> bool:
    """Whether `record` is a result (a trial lost to infrastructure is none)."""
    return record is not None and record.end != "infrastructure"


def to_line(record: TrialRecord) -> str:
    """One line of JSON, newline included."""
    return json.dumps(asdict(record), separators=(",", ":"), ensure_ascii=False) + "\n"


def from_line(line: str) -> TrialRecord:
    """The record that `to_line` wrote; raises ValueError saying what is wrong with it."""
    return from_data(parse(line))


def from_data(data: Any) -> TrialRecord:
    """The record in a decoded line, which is used up; raises ValueError if there is none."""
    if not isinstance(data, dict) or not isinstance(data.get("key"), dict):
        raise ValueError("not a trial record")
    unknown = sorted(set(data) - FIELDS)
    if unknown:
        raise ValueError(f"unknown fields {', '.join(unknown)[:200]}: written by a newer version?")
    try:
        key = TrialKey(**data.pop("key"))
        record = TrialRecord(key=key, **{**data, "events": tuple(data.get("events", ()))})
    except TypeError as error:
        raise ValueError(f"not a trial record: {str(error)[:200]}") from error
    check_record(record)
    return record


def read_file(path: Path) -> list[TrialRecord]:
    """All whole records of one file, in order; raises RunError at the first corrupt line."""
    lines = read_bytes(path, MOST_RECORDS).split(b"\n")
    whole = lines[:-1]  # what follows the last newline was torn off, or is empty
    records = []
    for number, raw in enumerate(whole, 1):
        try:
            records.append(from_line(raw.decode()))
        except ValueError as error:
            raise RunError(f"{path}, line {number}: {error}") from error
    return records


def read_bytes(path: Path, most: int) -> bytes:
    """All of `path`; raises RunError if it cannot be read or has more than `most` bytes."""
    try:
        if path.stat().st_size > most:
            raise RunError(f"cannot read {path}: it has more than {most} bytes")
        return path.read_bytes()
    except OSError as error:
        raise RunError(f"cannot read {path}: {error.strerror}") from error


def differences(first: TrialRecord, second: TrialRecord) -> list[str]:
    """Names of the fields that two results of one trial disagree on though they must not."""
    return [name for name in DECIDED if getattr(first, name) != getattr(second, name)]


def merge(
    records: Iterable[TrialRecord], known: Mapping[TrialKey, TrialRecord] | None = None
) -> dict[TrialKey, TrialRecord]:
    """One record per trial: a result outranks a loss, and results must agree.

    Raises RepeatabilityError if they do not.
    """
    merged = dict(known or {})
    for record in records:
        present = merged.get(record.key)
        if present is None or not finished(present):
            merged[record.key] = record
        elif finished(record):
            changed = differences(present, record)
            if changed:
                raise RepeatabilityError(
                    f"two different records of trial {record.key.slug}: they disagree on "
                    f"{', '.join(changed)}; this run is not repeatable and cannot be scored"
                )
    return merged


def read_records(folder: Path) -> dict[TrialKey, TrialRecord]:
    """One record per trial from all files of the run in `folder`."""
    merged: dict[TrialKey, TrialRecord] = {}
    for path in sorted((folder / TRIALS).glob("*.jsonl")):
        merged = merge(read_file(path), merged)
    return merged


def read_manifest(folder: Path) -> dict[str, Any]:
    """The run's `run.json`; raises RunError if there is none or it is broken."""
    path = folder / MANIFEST
    if not path.exists():
        raise RunError(f"{folder} is not a run: it has no {MANIFEST}")
    try:
        data = parse(read_bytes(path, MOST_MANIFEST).decode())
    except ValueError as error:
        raise RunError(f"cannot read {path}: {error}") from error
    if not isinstance(data, dict) or not isinstance(data.get("trials"), list):
        raise RunError(f"{path} is no run manifest: it has no list of trials")
    version = data.get("format", FORMAT)
    if type(version) is not int or version > FORMAT:
        raise RunError(
            f"{path} has format {str(version)[:20]}, and this robospa reads up to {FORMAT}: "
            "use the version that wrote it or a newer one"
        )
    try:
        check_manifest(data)
    except ValueError as error:
        raise RunError(f"{path} is no run manifest: {error}") from error
    return data


def manifest_keys(manifest: Mapping[str, Any]) -> tuple[TrialKey, ...]:
    """The trials that a manifest lists; raises RunError if one of them is malformed."""
    keys: list[TrialKey] = []
    try:
        for row in manifest["trials"]:
            names = (row["task"], row["level"], row["embodiment"], row["mode"], row["split"])
            task, level, embodiment, mode, split = names
            if not isinstance(row["seeds"], list):
                raise ValueError("its seeds are no list")
            for seed in row["seeds"]:
                keys.append(TrialKey(task, level, seed, embodiment, mode, split))
                check_key(keys[-1])
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(
            f"the manifest's list of trials is malformed: {repr(error)[:200]}"
        ) from error
    return tuple(keys)


def read_run(folder: str | Path) -> Run:
    """The run in `folder`; raises RunError (or RepeatabilityError) if it cannot be trusted."""
    folder = Path(folder)
    manifest = read_manifest(folder)
    return Run(folder, manifest, manifest_keys(manifest), read_records(folder))
