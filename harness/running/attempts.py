"""Attempts at trials that did not count: how many a trial has had, over all drivers of its run.

A fault that the harness sees itself repeats the trial. A policy can bring such faults about, so
every attempt is on disk before it gets the trial, as the record of a loss that the end of the
driver would be, and a trial has a fixed number of them however often the run is resumed.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from robospa.harness.running.record_store import RecordWriter
from robospa.harness.running.scheduler import TrialQueue
from robospa.results.records.action_problems import error_kind, problem_counts
from robospa.results.records.runs import finished
from robospa.results.records.trial_record import INTERRUPTED, RetryRow, TrialRecord
from robospa.results.scoring.repeats import reached_policy
from robospa.trial import TrialKey

Retries = tuple[RetryRow, ...]


def attempts_spent(retries: Retries) -> int:
    """How many of these attempts are charged to the trial for ever: all that the policy may have
    had."""
    return sum(map(reached_policy, retries))


def earlier_retries(known: Mapping[TrialKey, TrialRecord]) -> dict[TrialKey, Retries]:
    """The attempts of earlier drivers at trials that have no result yet."""
    return {key: r.retries for key, r in known.items() if not finished(r) and r.retries}


CUT_OFF = RetryRow(INTERRUPTED, "the run ended before the trial did")
"""An attempt that has begun and, as far as is known, not ended."""


class LossWriter:
    """Records losses in a file of the driver's own, which is made when first needed."""

    def __init__(self, folder: Path, queue: TrialQueue) -> None:
        self._folder, self._queue = folder, queue
        self._writer: RecordWriter | None = None

    def write(self, key: TrialKey, message: str, retries: Retries) -> TrialRecord:
        """The record of a trial without a result, which is then on disk; raises StorageError."""
        self._writer = self._writer or RecordWriter(self._folder)
        variant = self._queue.info(key)
        record = TrialRecord(
            key=key,
            category=variant.category,
            instruction="",
            scene_digest="",
            end="infrastructure",
            success=False,
            done=0,
            best=0,
            total=variant.subtasks,
            candidates=variant.candidates,
            steps=0,
            physics_steps=0,
            policy_calls=0,
            digest="",
            actions_digest="",
            wall_time=0.0,
            message=message,
            attempts=len(retries),
            retries=retries,
        )
        self._writer.write(record)
        return record

    def close(self) -> None:
        """Close the file, if there is one."""
        if self._writer is not None:
            self._writer.close()


FIRST = 5
"""So many first trials of a task, or of the run, with the same error stop the run; so many first
results are looked at for problems."""
IN_A_ROW = 10
"""So many trials in a row with the same error at one server stop it later on."""
ADVICE = (
    "mend the cause and resume the run, or add --policy-errors count to count such trials as "
    "failures"
)


@dataclass(frozen=True)
class ErrorVerdict:
    """Why the run stops, and whose policy errors are withdrawn."""

    text: str
    withdrawn: tuple[TrialRecord, ...] = ()


@dataclass
class ErrorWatch:
    """Sees every result of a run as it comes."""

    sound: set[str] = field(default_factory=set)
    """Tasks of which a trial has ended in another way than by a policy error."""
    _rows: dict[str, list[TrialRecord]] = field(default_factory=dict)
    """By policy, the last results in a row with the same error."""

    def know(self, records: Iterable[TrialRecord]) -> None:
        """Take note of results of earlier drivers."""
        self.sound |= {r.key.task for r in records if finished(r) and r.end != "policy_error"}

    def add(self, record: TrialRecord, target: str) -> ErrorVerdict | None:
        """A trial at the policy `target` has its `record`; whether the run should stop."""
        if record.end == "infrastructure":
            return None
        if record.end != "policy_error":
            self.sound.add(record.key.task)
            self._rows.pop(target, None)
            return None
        row = self._rows.setdefault(target, [])
        if row and error_kind(row[-1].message) != error_kind(record.message):
            row.clear()
        row.append(record)
        task = record.key.task
        of_task = [r for r in row if r.key.task == task]
        same = f"ended in the same policy error: {record.message}"
        if task not in self.sound and len(of_task) >= FIRST:
            return ErrorVerdict(
                f"the first {FIRST} trials of {task} all {same}; {ADVICE}", (*of_task,)
            )
        if not self.sound and len(row) >= FIRST:
            return ErrorVerdict(f"the first {FIRST} trials all {same}; {ADVICE}", (*row,))
        if len(row) >= IN_A_ROW:
            return ErrorVerdict(f"{IN_A_ROW} trials in a row {same}; {ADVICE}")
        return None


@dataclass
class ProblemWatch:
    """Sees the first results of a run as they come."""

    _seen: list[TrialRecord] = field(default_factory=list)

    def add(self, record: TrialRecord) -> list[str]:
        """A trial has its `record`; after the first ones, a sentence for each kind of problem that
        is too frequent to be chance."""
        if record.end == "infrastructure" or len(self._seen) >= FIRST:
            return []
        self._seen.append(record)
        if len(self._seen) < FIRST:
            return []
        found = [count for count in problem_counts(self._seen) if count.often]
        return [f"warning: in the first {FIRST} trials {count}" for count in found]
