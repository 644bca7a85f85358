"""A trial as something to look at: where every body is at which time, and what happened when.

Pure data: it comes from a world (`robospa.harness.viewer.replay`) and is shown by a browser
(`robospa.harness.viewer.server`), and knows neither.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from robospa.geometry import Pose
from robospa.results.failures.labels import NAMES, label
from robospa.results.records.object_names import with_names
from robospa.results.records.trial_record import EventRow, TrialRecord
from robospa.results.report.run_card import END_NAMES

UNLISTED = frozenset({"approached"})
"""Kinds of events that are too many to be a list: a gripper came near something."""


@dataclass(frozen=True)
class Moment:
    """Something that happened at `time` [s, simulated], in words; `failure` is the trial's type."""

    time: float
    text: str
    failure: bool = False


@dataclass(frozen=True)
class Shown:
    """One instant of a trial.

    `poses` are those of all bodies that exist; `happened` counts the moments so far; `wanted` are
    the objects of subtasks that are still to be done.
    """

    time: float
    poses: Mapping[str, Pose]
    happened: int
    wanted: frozenset[str]


@dataclass(frozen=True)
class Playback:
    """A trial to be played.

    `times` [s, simulated] rise from 0; `frames` has the poses of all bodies at each of them.
    `names` are what a reader calls the objects, `subtasks` the numbers of the subtasks (from 0)
    that need an object, and `changes` the times at which one was done (True) or undone. `failure`
    is the type of the trial's failure with its evidence, empty for a success.
    """

    title: str
    instruction: str
    outcome: str
    times: Sequence[float]
    frames: Sequence[Mapping[str, Pose]]
    moments: Sequence[Moment]
    names: Mapping[str, str]
    subtasks: Mapping[str, tuple[int, ...]]
    changes: Sequence[tuple[float, int, bool]]
    failure: str = ""

    @property
    def end(self) -> float:
        """Time of the last frame [s]."""
        return self.times[-1]

    def shown(self, time: float) -> Shown:
        """What is to be seen at `time`: the last frame at or before it, the first one before 0."""
        frame = max(0, bisect_right(self.times, time + 1e-9) - 1)
        happened = sum(moment.time <= time + 1e-9 for moment in self.moments)
        done: dict[int, bool] = {}
        for when, index, now in self.changes:
            if when <= time + 1e-9:
                done[index] = now
        wanted = frozenset(
            name
            for name, numbers in self.subtasks.items()
            if not all(done.get(number, False) for number in numbers)
        )
        return Shown(self.times[frame], self.frames[frame], happened, wanted)


def playback_of(
    record: TrialRecord,
    times: Sequence[float],
    frames: Sequence[Mapping[str, Pose]],
    names: Mapping[str, str],
    subtasks: Mapping[str, tuple[int, ...]],
) -> Playback:
    """The playback of the trial of `record`, seen at `times` [s] as `frames`."""
    key = record.key
    outcome = END_NAMES[record.end]
    if record.total:
        outcome += f", {record.done} of {record.total} subtasks done"
    changes = [
        (float(event["time"]), int(event["index"]), event["kind"] == "subtask_done")
        for event in record.events
        if event["kind"] in ("subtask_done", "subtask_undone")
    ]
    failure = label(record)
    why = f"{NAMES[failure.kind]}: {failure.evidence}" if failure is not None else ""
    return Playback(
        f"{key.task.replace('_', ' ')}, level {key.level}, seed {key.seed}",
        record.instruction,
        outcome,
        times,
        frames,
        moments(record, names, times[-1]),
        names,
        subtasks,
        changes,
        with_names(why, names),
    )


def moments(record: TrialRecord, names: Mapping[str, str], end: float) -> list[Moment]:
    """The events of `record` and the type of its failure, in words and in the order of time; a
    failure that has no moment stands at the `end` [s]."""
    found = [
        Moment(float(event.get("time", 0.0)), with_names(_in_words(event), names))
        for event in record.events
        if event["kind"] not in UNLISTED
    ]
    failure = label(record)
    if failure is not None:
        when = end if failure.time is None else failure.time
        found.append(Moment(when, f"failure: {NAMES[failure.kind]}", failure=True))
    return sorted(found, key=lambda moment: moment.time)


def _in_words(event: EventRow) -> str:
    about, note = event.get("object", ""), event.get("note", "")
    if event["kind"] == "closed":  # its note says how: touching or beside
        return f"closed, {note} {about}".rstrip(" ,")
    number = event.get("index", -1)
    head = event["kind"].replace("_", " ")
    if event["kind"].startswith("subtask"):
        head = head.replace("subtask", f"subtask {number + 1}")
    return ": ".join([head, " ".join(word for word in (about, note) if word)]).rstrip(": ")
