"""The page's list of trials: one compact row of JSON a trial, and the videos beside the page."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from msgspec import Struct

from robospa.results.comparison.profile import Pair
from robospa.results.failures.labels import NAMES, Failure, label
from robospa.results.records.action_problems import described, trial_problems
from robospa.results.records.runs import VIDEOS, Run, film_name
from robospa.results.records.trial_record import EventRow, TrialRecord
from robospa.results.report.run_card import END_NAMES, NOT_RUN
from robospa.results.scoring.first_choice import first_choice
from robospa.schema import Number, read
from robospa.trial import TrialKey

SHOWN_TRIALS = 60_000
"""Two whole benchmark runs. Beyond that browsers choke: successes are left out first."""
Failures = Mapping[TrialKey, Failure]
"""The type of every failed trial of a run."""


LATER = "success, not by the first choice"


def trial_rows(
    runs: Sequence[Run], folder: Path, failures: Sequence[Failures]
) -> list[dict[str, object]]:
    """A row for every trial of `runs`, in their order, with the type of its failure; videos are put
    into `folder`."""
    pairs = [(number, run, key) for number, run in enumerate(runs) for key in run.keys]
    if len(pairs) > SHOWN_TRIALS:
        pairs = sorted(pairs, key=lambda p: _succeeded(p[1], p[2]))[:SHOWN_TRIALS]
    several = len({run.folder for run in runs}) > 1
    return [_row(n, run, key, folder, failures[n].get(key), several) for n, run, key in pairs]


def _succeeded(run: Run, key: TrialKey) -> bool:
    record = run.records.get(key)
    return record is not None and record.success


def _row(
    number: int, run: Run, key: TrialKey, folder: Path, failure: Failure | None, several: bool
) -> dict[str, object]:
    """One trial; what is empty is left out, because 28,000 of them are one file."""
    record = run.records.get(key)
    row: dict[str, object] = {"run": number, "task": key.task, "level": key.level, "seed": key.seed}
    if record is None:
        return {**row, "end": NOT_RUN}
    place = folder / VIDEOS / str(number + 1) if several else folder / VIDEOS
    video = film(run, record, place)
    row |= {
        "name": key.slug if run.manifest.settings.profile else "",
        "end": LATER if record.success and not first_choice(record) else END_NAMES[record.end],
        "good": int(record.success),
        "done": record.done,
        "total": record.total,
        "steps": record.steps,
        "seconds": round(record.wall_time, 1),
        "instruction": record.instruction,
        "message": record.message,
        "problems": trial_problems(record),
        "attempts": record.attempts if record.attempts > 1 else 0,
        "events": happened(record),
        "digest": record.digest[:16],
        "video": video and video.relative_to(folder).as_posix(),
        "film": film_state(run, record) if video is None else "",
    }
    if failure is not None:
        why = described(failure.evidence, record)
        row |= {"failure": failure.kind, "why": why, "at": failure.time}
    return {name: value for name, value in row.items() if value not in ("", None, [])}


def pair_rows(
    pairs: Sequence[tuple[Run, str, Pair]], runs: Sequence[Run], folder: Path
) -> list[dict[str, object]]:
    """Axis and both trials, as in `trial_rows`, of `pairs` of profiles whose clean trials are among
    `runs`."""
    places = [run.folder for run in runs]
    several = len(set(places)) > 1
    made: list[dict[str, object]] = []
    for run, axis, pair in pairs:
        where = places.index(run.folder), run
        rows = [_row(*where, r.key, folder, label(r), several) for r in pair]
        made.append({"axis": axis, "trials": rows})
    return made


class KeptCall(Struct):
    """What the page shows of a call of a skill in a record."""

    skill: str
    feedback: str
    time: Number = 0
    at: tuple[Number, Number] | None = None


def happened(record: TrialRecord) -> list[list[float | str]]:
    """Events and calls of skills in the order of time; calls that are none are not shown."""
    rows = [event_row(event, record) for event in record.events]
    calls: list[KeptCall] = []
    with suppress(ValueError):
        calls = read(list[KeptCall], record.diagnostics.get("calls", []), "the calls")
    for call in calls:
        where = f" at {call.at[0]:.2f}, {call.at[1]:.2f}" if call.at else ""
        rows.append([round(float(call.time), 2), f"called {call.skill}{where}:", call.feedback])
    return sorted(rows, key=lambda row: float(row[0]))


EVENT_WORDS = {
    "closed": "gripper closed",
    "approached": "gripper came near",
    "grasped": "lifted",
    "subtask_done": "step {} done:",
    "subtask_undone": "step {} undone:",
    "wrong_object": "wrong object:",
    "wrong_order": "out of turn:",
    "repeated": "step {} done again:",
    "success": "task solved",
    "failed": "goal lost:",
    "clutter_moved": "moved clutter:",
}
CLOSED = {"touching": " on", "beside": " beside"}


def event_row(event: EventRow, record: TrialRecord) -> list[float | str]:
    """Simulated time [s], what happened, and to what, in words, of an event of `record`."""
    kind, note = str(event.get("kind", "")), str(event.get("note", ""))
    words = EVENT_WORDS.get(kind, kind.replace("_", " ")).format(int(event.get("index", -1)) + 1)
    if kind == "closed" and note in CLOSED:
        words, note = words + CLOSED[note], ""
    rest = described(f"{event.get('object') or ''} {note}".strip(), record)
    return [round(float(event.get("time", 0.0)), 2), words if rest else words.rstrip(":"), rest]


@dataclass(frozen=True)
class FailureCount:
    """Occurrences of a type of failure: `counts` has one number a run."""

    kind: str
    name: str
    counts: Sequence[int]


def failure_counts(failures: Sequence[Failures]) -> list[FailureCount]:
    """Occurrences of each type in each run, by frequency; types that never occur are left out."""
    counts: dict[str, list[int]] = {}
    for number, found in enumerate(failures):
        for failure in found.values():
            counts.setdefault(failure.kind, [0] * len(failures))[number] += 1
    made = [FailureCount(kind, NAMES.get(kind, kind), n) for kind, n in counts.items()]
    return sorted(made, key=lambda row: -sum(row.counts))


def film_state(run: Run, record: TrialRecord) -> str:
    """Of a trial without its film: whether that follows, or is still to be made by somebody."""
    if record.video != film_name(record.key):
        return ""
    return "follows" if run.in_progress else "owed"


def film(run: Run, record: TrialRecord, place: Path) -> Path | None:
    """Put the trial's video into the folder `place`; None if it has none inside its run."""
    if not record.video:  # first: resolving 28,000 paths takes seconds
        return None
    source = (run.folder / record.video).resolve()
    if not source.is_relative_to(run.folder.resolve()) or not source.is_file():
        return None
    put(source, target := place / source.name)
    return target


def put(source: Path, target: Path) -> None:
    """Make `target` the file `source`, or a copy of it, in place of what an earlier report put."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.exists() and target.samefile(source):
        return
    target.unlink(missing_ok=True)
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
