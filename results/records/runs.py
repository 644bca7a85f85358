"""Trial records as lines of JSON, and whole runs read back from their folder.

A line that was torn off at the end of a file (the writer was killed) is dropped: that trial has
to be run again. Anything else that is not a record is refused, naming file and line. Two records of
one trial must agree on everything that a repeatable world decides; if not, that is a
`RepeatabilityError`. A run may come from anywhere: `TrialRecord` says what a line may hold.
"""

import fcntl
import json
import os
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from pathlib import Path

from msgspec import structs

from robospa.results.records.manifest import (
    JOINTS,
    OFFICIAL,
    RunError,
    RunManifest,
    read_bytes,
    read_manifest,
)
from robospa.results.records.trial_record import INTERRUPTED, Roles, TrialRecord
from robospa.schema import parse_json, read
from robospa.text import some
from robospa.trial import TrialKey

TRIALS = "trials"
"""Folder inside a run that holds the record files."""
ACTIONS = "actions"
"""Folder inside a run that holds the executed actions of every trial."""

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
KEY_FIELDS = frozenset(f.name for f in fields(TrialKey))
MAX_FILE_BYTES = 2**30
"""More than this is read of no file of records."""


class RepeatabilityError(RunError):
    """Two records of the same trial differ: the world or the policy is not repeatable."""


@dataclass(frozen=True, repr=False)
class Run:
    """A run that was read: its manifest, its list of trials, and one record per finished trial."""

    folder: Path
    """The run's folder."""
    manifest: RunManifest
    """What `run.json` holds."""
    keys: tuple[TrialKey, ...]
    """The listed trials."""
    records: Mapping[TrialKey, TrialRecord]
    """The trials that have a result or were lost to infrastructure."""
    torn: tuple[str, ...] = ()
    """Names of the record files whose last line is incomplete."""
    repeated: tuple[TrialKey, ...] = ()
    """Trials that have more than one result; these agree."""
    in_progress: bool = False
    """Whether a process was running it when it was read."""

    @cached_property
    def without_result(self) -> tuple[TrialKey, ...]:
        """Listed trials without a result."""
        return tuple(k for k in self.keys if not finished(self.records.get(k)))

    @cached_property
    def waiting(self) -> tuple[TrialKey, ...]:
        """Listed trials that are still to be run, of a run in progress."""
        return tuple(k for k in self.keys if k not in self.records) if self.in_progress else ()

    @cached_property
    def missing(self) -> tuple[TrialKey, ...]:
        """Listed trials without a result that nobody is about to run: lost to infrastructure
        errors, or never run before the run stopped."""
        waiting = set(self.waiting)
        return tuple(k for k in self.without_result if k not in waiting)

    @cached_property
    def counted(self) -> tuple[TrialKey, ...]:
        """The trials that scores are of: all that are listed but the waiting ones."""
        waiting = set(self.waiting)
        return tuple(k for k in self.keys if k not in waiting) if waiting else self.keys

    def __repr__(self) -> str:
        """The folder and the counts, not thousands of records."""
        won = sum(record.success for record in self.records.values())
        done = len(self.keys) - len(self.without_result)
        return f"Run({str(self.folder)!r}, {won} successes in {done} of {len(self.keys)} trials)"


def finished(record: TrialRecord | None) -> bool:
    """Whether `record` is a result (a trial lost to infrastructure is none)."""
    return record is not None and record.end != "infrastructure"


def under_way(record: TrialRecord) -> bool:
    """Whether `record` says that an attempt has begun, and none how it ended."""
    return not finished(record) and [r.cause for r in record.retries[-1:]] == [INTERRUPTED]


def to_line(record: TrialRecord) -> str:
    """One line of JSON, newline included."""
    return json.dumps(asdict(record), separators=(",", ":"), ensure_ascii=False) + "\n"


def from_line(line: str) -> TrialRecord:
    """The record that `to_line` wrote; raises ValueError saying what is wrong with it."""
    return from_data(parse_json(line))


def from_data(data: object) -> TrialRecord:
    """The record in a decoded line; raises ValueError if there is none."""
    if not isinstance(data, dict) or not isinstance(data.get("key"), dict):
        raise ValueError("not a trial record")
    if unknown := [*(data.keys() - FIELDS), *(data["key"].keys() - KEY_FIELDS)]:
        names = ", ".join(sorted(unknown))[:200]
        raise ValueError(f"unknown fields {names}: written by a newer version?")
    record = read(TrialRecord, data, "the trial record")
    read(Roles, record.diagnostics, "the trial record's diagnostics")
    return record


def read_file(path: Path) -> list[TrialRecord]:
    """All whole records of one file, in order; raises RunError at the first corrupt line."""
    return _read_file(path)[0]


def _read_file(path: Path) -> tuple[list[TrialRecord], bool]:
    """The whole records of one file, and whether its last line was torn off."""
    *whole, rest = read_bytes(path, MAX_FILE_BYTES).split(b"\n")
    records = []
    for number, raw in enumerate(whole, 1):
        try:
            records.append(from_line(raw.decode()))
        except ValueError as error:
            raise RunError(f"{path}, line {number}: {error}") from error
    return records, bool(rest)


def differences(first: TrialRecord, second: TrialRecord) -> list[str]:
    """Names of the fields that two results of one trial disagree on though they must not."""
    return [name for name in DECIDED if getattr(first, name) != getattr(second, name)]


def withdraws(later: TrialRecord, earlier: TrialRecord) -> bool:
    """Whether `later` says that the policy error in which `earlier` ended does not count."""
    place = len(earlier.retries)
    return (
        earlier.end == "policy_error"
        and len(later.retries) > place
        and later.retries[place].cause == "policy_error"
    )


def merge(
    records: Iterable[TrialRecord], known: Mapping[TrialKey, TrialRecord] | None = None
) -> dict[TrialKey, TrialRecord]:
    """One record per trial: a result outranks a loss, a loss one with fewer attempts, and a record
    the policy error that it withdraws. Results must agree.

    Raises RepeatabilityError if they do not.
    """
    merged = dict(known or {})
    for record in records:
        present = merged.get(record.key)
        if present is None or withdraws(record, present):
            merged[record.key] = record
        elif withdraws(present, record):
            continue
        elif not finished(present):
            if finished(record) or len(record.retries) >= len(present.retries):
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
    for path in _record_files(folder):
        merged = merge(read_file(path), merged)
    return merged


def read_run(folder: str | Path) -> Run:
    """The run in `folder`, finished or not.

    Raises:
        RunError: There is no run, or a file of it is damaged or contradicts itself.
        RepeatabilityError: Two records of one trial differ in more than times.
    """
    folder = Path(folder)
    going_on = in_progress(folder)
    manifest = read_manifest(folder)
    records: dict[TrialKey, TrialRecord] = {}
    results: list[TrialRecord] = []
    torn: list[str] = []
    for path in _record_files(folder):
        found, was_torn = _read_file(path)
        records = merge(found, records)
        results += [record for record in found if finished(record)]
        torn += [path.name] * was_torn
    counts = Counter(r.key for r in results if not withdraws(records[r.key], r))
    repeated = tuple(key for key, count in counts.items() if count > 1)
    if going_on:
        records = {key: r for key, r in records.items() if not under_way(r)}
    there = films_in(folder)  # of which some are made long afterwards
    for key in records if there else ():
        if not records[key].video and (name := film_name(key)) in there:
            records[key] = replace(records[key], video=name)
    return Run(folder, manifest, manifest.keys, records, tuple(torn), repeated, going_on)


def action_path(folder: Path, key: TrialKey) -> Path:
    """Where the executed actions of `key` lie."""
    return folder / ACTIONS / f"{key.slug}.npz"


def lost_actions(folder: Path, records: Mapping[TrialKey, TrialRecord]) -> list[str]:
    """One sentence if files of actions are gone that were on disk before their records: a copy of a
    run that was cut off, or one that was moved while it was written."""
    actions = folder / ACTIONS
    there = set(os.listdir(actions)) if actions.is_dir() else set()
    done = [key for key, record in records.items() if finished(record)]
    lost = [key.slug for key in done if action_path(folder, key).name not in there]
    if not lost:
        return []
    return [
        f"{len(lost)} of {len(done)} finished trials have lost the file of their actions: "
        f"{some(lost)}; copy them back from where the run was made"
    ]


def _record_files(folder: Path) -> list[Path]:
    return sorted((folder / TRIALS).glob("*.jsonl"))


VIDEOS = "videos"
"""Folder inside a run that holds the films."""


def film_name(key: TrialKey) -> str:
    """Path of the film of `key` inside its run's folder."""
    return f"{VIDEOS}/{key.slug}.mp4"


def films_in(folder: Path) -> frozenset[str]:
    """Paths of the films that are there, inside the run's `folder`."""
    try:
        return frozenset(f"{VIDEOS}/{name}" for name in os.listdir(folder / VIDEOS))
    except OSError:
        return frozenset()


LOCK = ".lock"
"""File of a run's folder that its driver holds a lock on."""


def in_progress(folder: Path) -> bool:
    """Whether a process is running the run in `folder`.

    A driver that starts at the very instant of the look tries again (`running.run_lock`).
    """
    try:
        file = os.open(folder / LOCK, os.O_RDONLY)
    except OSError:
        return False
    try:
        return is_locked(file)
    finally:
        os.close(file)


def is_locked(handle: int) -> bool:
    """Whether another process holds an open file for itself; False where locks do not tell."""
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:  # any other: a file system without locks
        return isinstance(error, BlockingIOError)
    return False


MARK = "@"
"""Between a run's folder and a robot, scene mode or split of it: `runs/mine@piper`."""
PARTS = ("embodiment", "mode", "split")


def by_setting(run: Run) -> list[Run]:
    """`run` itself, or a run for each robot, scene mode and split that it holds, in its order."""
    settings = dict.fromkeys(map(_setting, run.keys))
    if len(settings) < 2:
        return [run]
    return [_part(run, setting) for setting in settings]


def _setting(key: TrialKey) -> tuple[str, str, str]:
    return key.embodiment, key.mode, key.split


def _part(run: Run, setting: tuple[str, str, str]) -> Run:
    keys = tuple(key for key in run.keys if _setting(key) == setting)
    chosen = set(keys)
    parts = {name: (value,) for name, value in zip(PARTS, setting, strict=True)}
    settings = structs.replace(run.manifest.settings, **parts)
    return replace(
        run,
        manifest=structs.replace(run.manifest, settings=settings),
        keys=keys,
        records={key: record for key, record in run.records.items() if key in chosen},
        repeated=tuple(key for key in run.repeated if key in chosen),
    )


def setting_name(run: Run) -> str:
    """Robots, scene modes and splits of `run` in a few words, with its suite and clock where they
    are not the benchmark's; the usual mode and split go without saying."""
    return ", ".join(part for part in setting_parts(run) if part not in ("", "clean", "heldout"))


def setting_parts(run: Run) -> tuple[str, ...]:
    """The suite if it is no own one, robots, scene modes, splits, clock and track of `run`, this if
    it is not that of joints."""
    official = run.manifest.suite if run.manifest.suite.startswith(OFFICIAL) else ""
    values = [dict.fromkeys(getattr(key, part) for key in run.keys) for part in PARTS]
    tracks = ", ".join(run.manifest.tracks)
    return (official, *map(", ".join, values), run.manifest.clock, tracks * (tracks != JOINTS))


def read_part(name: str) -> Run:
    """The run in a folder, or the part that `FOLDER@ROBOT`, `FOLDER@MODE` or `FOLDER@SPLIT` names.

    Raises RunError if the folder holds several of these and `name` does not choose one.
    """
    folder, mark, chosen = name.rpartition(MARK)
    if Path(name).exists() or not mark:
        folder, chosen = name, ""
    parts = by_setting(read_run(Path(folder).resolve()))
    found = [
        part
        for part in parts
        if not chosen or chosen in (*_setting(part.keys[0]), setting_name(part))
    ]
    if len(found) == 1:
        return found[0]
    names = ", ".join(setting_name(part) for part in parts)
    raise RunError(
        f"{folder} holds trials of {names}: choose one, such as {folder}{MARK}"
        f"{parts[0].keys[0].embodiment}"
    )
