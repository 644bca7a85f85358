"""Trial records as lines of JSON, and whole runs read back from their folder.

A line that was torn off at the end of a file (the writer was killed) is dropped: that trial has
to be run again. Anything else that is not a record is refused, naming file and line. Two records of
one trial must agree on everything that a repeatable world decides; if not, that is a
`RepeatabilityError`. A run may come from anywhere: `TrialRecord` says what a line may hold.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from robospa.results.records.films import film_name, films_in
from robospa.results.records.manifest import RunError, RunManifest, read_bytes, read_manifest
from robospa.results.records.run_state import in_progress
from robospa.results.records.trial_record import TrialRecord
from robospa.schema import parse_json, read
from robospa.text import some
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from pandas import DataFrame

    from robospa.results.failures.labels import FailedTrials
    from robospa.results.tables import Table

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
    """A run that was read: its manifest, its list of trials, and one record per finished trial.

        run = robospa.load_run("runs/mine")
        print(run.table())
        frame = run.to_pandas()
        by_level = frame.groupby("level").success.mean()

    In a notebook it shows its scores and its failures.
    """

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

    def table(self) -> Table:
        """The success rates with their intervals, by task and level: `print` shows it as text, a
        notebook as HTML."""
        from robospa.results.report.run_view import run_table

        return run_table(self)

    def failures(self) -> FailedTrials:
        """A list of every failed trial with the type of its failure and the evidence for it;
        `print` and a notebook show a line of each."""
        from robospa.results.failures.labels import failed_trials

        return failed_trials(self.records.values())

    def to_pandas(self) -> DataFrame:
        """One row a listed trial, as `robospa.results.frame.trial_columns` has them; of a
        trial without a result everything but its key and `end` is missing.

        Raises MissingPackage without pandas, which the extra `notebook` brings.
        """
        from robospa.results.frame import to_pandas

        return to_pandas(self)

    def to_parquet(self, path: str | Path) -> None:
        """Write the rows of `to_pandas` as a Parquet file.

        Raises MissingPackage without pyarrow, which the extra `notebook` brings.
        """
        from robospa.results.frame import to_parquet

        to_parquet(self, Path(path))

    def __repr__(self) -> str:
        """The folder and the counts, not thousands of records."""
        won = sum(record.success for record in self.records.values())
        done = len(self.keys) - len(self.without_result)
        return f"Run({str(self.folder)!r}, {won} successes in {done} of {len(self.keys)} trials)"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        from robospa.results.report.run_view import run_html

        return run_html(self)


def finished(record: TrialRecord | None) -> bool:
    """Whether `record` is a result (a trial lost to infrastructure is none)."""
    return record is not None and record.end != "infrastructure"


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
    return read(TrialRecord, data, "the trial record")


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

        run = robospa.load_run("runs/mine")
        ends = {key: record.end for key, record in run.records.items()}

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
    records = _with_films(records, films_in(folder))
    return Run(folder, manifest, manifest.keys, records, tuple(torn), repeated, going_on)


def _with_films(
    records: Mapping[TrialKey, TrialRecord], there: frozenset[str]
) -> dict[TrialKey, TrialRecord]:
    """`records`, of which each names its film if there is one: some are made long afterwards."""
    return {
        key: replace(record, video=name)
        if there and not record.video and (name := film_name(key)) in there
        else record
        for key, record in records.items()
    }


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
